//! What a person was in their last call: so that the next one needs no options.

use crate::device_options::cache;
use anyhow::{Context, bail};
use link_protocol::PersonName;
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Bytes of the file, at most.
const MOST: u64 = 64 << 10;

/// A person's avatar and name.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Remembered {
    /// The avatar's package.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) avatar: Option<PathBuf>,
    /// What others read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) name: Option<PersonName>,
}

/// The file, in the user's folder for what this program keeps.
fn file() -> anyhow::Result<PathBuf> {
    Ok(cache()?.join("me.json"))
}

impl Remembered {
    /// What was kept last; nothing where nothing was. A file that cannot be read is told of, and changes nothing.
    pub(crate) fn load() -> Self {
        let loaded = file().and_then(|file| Self::read(&file));
        loaded.unwrap_or_else(|why| {
            log::warn!("{why:#}: give --avatar and --name");
            Self::default()
        })
    }

    fn read(file: &Path) -> anyhow::Result<Self> {
        let cannot = || format!("cannot read {}", file.display());
        match std::fs::metadata(file) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Self::default()),
            Err(error) => return Err(error).with_context(cannot),
            Ok(found) if found.len() > MOST => bail!("{} is too long", file.display()),
            Ok(_) => {}
        }
        let text = std::fs::read_to_string(file).with_context(cannot)?;
        serde_json::from_str(&text).with_context(cannot)
    }

    /// Keeps this for the next call. That it cannot is told, and changes nothing.
    pub(crate) fn keep(&self) {
        let kept = file().and_then(|file| self.write(&file));
        if let Err(why) = kept {
            log::warn!("{why:#}: the next call has to be told --avatar and --name");
        }
    }

    fn write(&self, file: &Path) -> anyhow::Result<()> {
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let text = serde_json::to_string_pretty(self)?;
        // A program that is ended in the middle leaves the old file.
        let fresh = file.with_extension(format!("new-{}", std::process::id()));
        std::fs::write(&fresh, text)
            .and_then(|()| std::fs::rename(&fresh, file))
            .with_context(|| format!("cannot write {}", file.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_kept_is_found_again_and_nonsense_is_an_error() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("kept/me.json");
        let nothing = Remembered::read(&file).expect("nothing is no error");
        assert_eq!(nothing, Remembered::default());
        let me = Remembered {
            avatar: Some("/home/ada/me.m3a".into()),
            name: Some("Ada".parse().expect("a name")),
        };
        me.write(&file).expect("it can be written");
        assert_eq!(Remembered::read(&file).expect("it can be read"), me);
        let left: Vec<_> = std::fs::read_dir(folder.path().join("kept"))
            .expect("a folder")
            .collect();
        assert_eq!(left.len(), 1, "nothing else is left: {left:?}");
        std::fs::write(&file, r#"{"name": "a\nb"}"#).expect("it can be written");
        assert!(Remembered::read(&file).is_err(), "no name");
    }
}
