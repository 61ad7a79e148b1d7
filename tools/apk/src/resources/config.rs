//! Which devices a resource is for: the qualifiers behind a folder's name.

/// Language, region, density, version of Android; zero where a folder does not say. The order is the table's: what is for all comes first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Config {
    language: [u8; 2],
    region: [u8; 2],
    density: u16,
    version: u16,
}

const DENSITIES: [(&str, u16); 9] = [
    ("ldpi", 120),
    ("mdpi", 160),
    ("tvdpi", 213),
    ("hdpi", 240),
    ("xhdpi", 320),
    ("xxhdpi", 480),
    ("xxxhdpi", 640),
    ("anydpi", 0xfffe),
    ("nodpi", 0xffff),
];

impl Config {
    /// Of a folder `TYPE-QUALIFIERS`, the type and what the qualifiers mean.
    pub(crate) fn parse(folder: &str) -> Result<(&str, Self), String> {
        let mut parts = folder.split('-').peekable();
        let kind = parts.next().unwrap_or_default();
        let mut config = Self::default();
        if let Some(language) = parts
            .next_if(|part| part.len() == 2 && part.bytes().all(|one| one.is_ascii_lowercase()))
        {
            config.language = pair(language);
            if let Some(region) = parts.next_if(|part| {
                part.len() == 3
                    && part.starts_with('r')
                    && part[1..].bytes().all(|one| one.is_ascii_uppercase())
            }) {
                config.region = pair(&region[1..]);
            }
        }
        if let Some((_, density)) = parts
            .peek()
            .and_then(|part| DENSITIES.iter().find(|(name, _)| name == part))
        {
            config.density = *density;
            parts.next();
        }
        if let Some(version) = parts
            .peek()
            .and_then(|part| part.strip_prefix('v'))
            .and_then(|digits| digits.parse().ok())
        {
            config.version = version;
            parts.next();
        }
        match parts.next() {
            None => Ok((kind, config)),
            Some(part) => Err(format!(
                "this packager does not know the qualifier {part:?} there; it knows a language of two letters, a region (rDE), a density ({}) and a version (v26), in this order",
                DENSITIES.map(|(name, _)| name).join(", ")
            )),
        }
    }

    /// Whether any device may use it. Pictures of any density are: Android scales them.
    pub(crate) fn is_for_all(self, pictures: bool) -> bool {
        self == Self {
            density: if pictures { self.density } else { 0 },
            ..Self::default()
        }
    }

    /// In which respects two differ, as a resource's flags say it (`ResTable_typeSpec`).
    pub(crate) fn differences(self, other: Self) -> u32 {
        let mut flags = 0;
        if (self.language, self.region) != (other.language, other.region) {
            flags |= 0x0004;
        }
        if self.density != other.density {
            flags |= 0x0100;
        }
        if self.version != other.version {
            flags |= 0x0400;
        }
        flags
    }

    /// `ResTable_config`.
    pub(crate) fn encode(self) -> [u8; 64] {
        let mut bytes = [0; 64];
        bytes[0] = 64;
        bytes[8..10].copy_from_slice(&self.language);
        bytes[10..12].copy_from_slice(&self.region);
        bytes[14..16].copy_from_slice(&self.density.to_le_bytes());
        bytes[24..26].copy_from_slice(&self.version.to_le_bytes());
        bytes
    }
}

fn pair(text: &str) -> [u8; 2] {
    let mut bytes = text.bytes();
    [bytes.next().unwrap_or(0), bytes.next().unwrap_or(0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn qualifiers_are_read_in_androids_order() {
        let parsed = |folder| Config::parse(folder).map(|(kind, config)| (kind.to_owned(), config));
        assert_eq!(parsed("values"), Ok(("values".into(), Config::default())));
        assert_eq!(
            parsed("values-de-rAT"),
            Ok((
                "values".into(),
                Config {
                    language: *b"de",
                    region: *b"AT",
                    ..Config::default()
                }
            ))
        );
        assert_eq!(
            parsed("mipmap-anydpi-v26"),
            Ok((
                "mipmap".into(),
                Config {
                    density: 0xfffe,
                    version: 26,
                    ..Config::default()
                }
            ))
        );
        for folder in [
            "mipmap-v26-anydpi",
            "values-night",
            "values-rDE",
            "drawable-dpi",
            "drawable-v",
            "drawable-",
            "values-de-de",
            "values-vé",
        ] {
            assert!(Config::parse(folder).is_err(), "{folder}");
        }
    }
}
