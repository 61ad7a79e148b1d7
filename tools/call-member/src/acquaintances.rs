//! The people whom this side has met in calls, by their keys: anyone may take a name, but nobody another one's key.

use identity::{LineFile, PublicKey};
use link_protocol::PersonName;
use std::path::PathBuf;

/// People that are kept, those met first go first.
const MOST: usize = 1000;
/// Bytes of the file that are looked at.
const MOST_BYTES: u64 = 1 << 20;

/// Whom this side has met; kept in a file where there is one, a line `KEY NAME` each.
#[derive(Debug, Default)]
pub struct Acquaintances {
    file: Option<LineFile>,
    met: Vec<(PublicKey, PersonName)>,
}

/// What is known of someone with this key and this name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Meeting {
    /// Neither was met.
    New,
    /// They were met under this name.
    Again,
    /// They were met under another name.
    Renamed {
        /// That one.
        before: PersonName,
    },
    /// The name is that of someone else who was met, or looks like it.
    Namesake,
}

impl Acquaintances {
    /// Those in `file`, which need not be there. That it cannot be read is told: they are all new then.
    #[must_use]
    pub fn open(file: PathBuf) -> Self {
        let file = LineFile::new(file, MOST_BYTES);
        let lines = file.read().unwrap_or_else(|error| {
            let path = file.path().display();
            log::warn!("whom you have met cannot be read from {path}: {error}");
            Vec::new()
        });
        let line = |line: &str| {
            let (key, name) = line.split_once(' ')?;
            Some((key.parse().ok()?, name.parse().ok()?))
        };
        Self {
            met: lines.iter().filter_map(|text| line(text)).collect(),
            file: Some(file),
        }
    }

    /// Meets someone, and keeps who is new.
    pub fn meet(&mut self, key: PublicKey, name: &PersonName) -> Meeting {
        if let Some((_, before)) = self.met.iter().find(|(met, _)| *met == key) {
            return if before == name {
                Meeting::Again
            } else {
                let before = before.clone();
                Meeting::Renamed { before }
            };
        }
        let seen = name.as_seen();
        if self.met.iter().any(|(_, met)| met.as_seen() == seen) {
            return Meeting::Namesake;
        }
        if self.met.len() >= MOST {
            self.met.remove(0);
        }
        self.met.push((key, name.clone()));
        if let Some(file) = &self.file {
            let lines = self.met.iter().map(|(key, name)| format!("{key} {name}"));
            if let Err(error) = file.write(lines) {
                let path = file.path().display();
                log::warn!("that you have met {name} cannot be kept in {path}: {error}");
            }
        }
        Meeting::New
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use identity::Identity;

    #[test]
    fn people_are_known_by_their_keys_and_namesakes_are_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("met");
        let key = |seed| Identity::from_seed(&[seed; 32]).expect("a key").public();
        let name = |text: &str| -> PersonName { text.parse().expect("a name") };
        let ada = name("Ada Lovelace");
        let mut met = Acquaintances::open(file.clone());
        assert_eq!(met.meet(key(1), &ada), Meeting::New);
        assert_eq!(met.meet(key(1), &ada), Meeting::Again);
        assert_eq!(met.meet(key(2), &name("ADA LOVELACE")), Meeting::Namesake);
        let mut met = Acquaintances::open(file.clone());
        assert_eq!(met.meet(key(1), &ada), Meeting::Again, "kept");
        let renamed = met.meet(key(1), &name("Bob"));
        assert_eq!(
            renamed,
            Meeting::Renamed {
                before: ada.clone()
            }
        );
        assert_eq!(met.meet(key(2), &ada), Meeting::Namesake, "still");
        for seed in 0..MOST {
            let mut bytes = [9; 32];
            bytes[..8].copy_from_slice(&seed.to_le_bytes());
            let seed = bytes;
            let key = Identity::from_seed(&seed).expect("a key").public();
            let _ = met.meet(key, &name(&format!("n{}", key.fingerprint())));
        }
        assert_eq!(Acquaintances::open(file).met.len(), MOST, "bounded");
        assert_eq!(met.meet(key(1), &ada), Meeting::New, "forgotten");
    }
}
