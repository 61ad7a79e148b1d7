//! The people whom this side has met in calls, by their keys: anyone may take a name, but nobody another one's key.

use identity::{LineFile, PublicKey};
use link_protocol::PersonName;
use std::path::{Path, PathBuf};

/// People that are kept, those met first go first.
const MOST: usize = 1000;
/// Bytes of the file that are looked at.
const MOST_BYTES: u64 = 1 << 20;
/// Files that could not be read, which are kept.
const MOST_ASIDE: u32 = 100;

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
    /// Those in `file`, which need not be there. What of it cannot be read is told, and the file kept aside: whoever is only there is new.
    #[must_use]
    pub fn open(file: PathBuf) -> Self {
        let file = LineFile::new(file, MOST_BYTES);
        let (met, trouble) = match file.read() {
            Ok(lines) => {
                let met: Vec<_> = lines.iter().filter_map(|text| read(text)).collect();
                let unread = lines.len() - met.len();
                let trouble = (unread > 0).then(|| format!("{unread} lines are no key and name"));
                (met, trouble)
            }
            Err(error) => (Vec::new(), Some(error.to_string())),
        };
        let shown = file.path().display();
        match trouble.map(|why| (set_aside(file.path()), why)) {
            None => Self {
                met,
                file: Some(file),
            },
            Some((Ok(aside), why)) => {
                log::warn!(
                    "not all whom you have met can be read from {shown} ({why}): it is kept as {}, and another one begun",
                    aside.display()
                );
                let another = Self {
                    met,
                    file: Some(file),
                };
                another.keep();
                another
            }
            // It is not written over.
            Some((Err(error), why)) => {
                log::warn!(
                    "not all whom you have met can be read from {shown} ({why}), nor can it be kept aside ({error}): whom you meet is not written down"
                );
                Self { met, file: None }
            }
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
        self.keep();
        Meeting::New
    }

    /// Writes down whom this side has met.
    fn keep(&self) {
        if let Some(file) = &self.file {
            let lines = self.met.iter().map(|(key, name)| format!("{key} {name}"));
            if let Err(error) = file.write(lines) {
                let path = file.path().display();
                log::warn!("whom you have met cannot be kept in {path}: {error}");
            }
        }
    }
}

/// A line of the file.
fn read(line: &str) -> Option<(PublicKey, PersonName)> {
    let (key, name) = line.split_once(' ')?;
    Some((key.parse().ok()?, name.parse().ok()?))
}

/// Gives a file another name, which no other file has.
fn set_aside(path: &Path) -> std::io::Result<PathBuf> {
    for number in 1..=MOST_ASIDE {
        let mut aside = path.as_os_str().to_owned();
        aside.push(format!(".unreadable-{number}"));
        let aside = PathBuf::from(aside);
        if !aside.try_exists()? {
            std::fs::rename(path, &aside)?;
            return Ok(aside);
        }
    }
    Err(std::io::Error::other("too many are kept aside already"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use identity::Identity;

    #[test]
    fn a_list_that_cannot_be_read_is_kept_aside() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("met");
        let key = Identity::from_seed(&[1; 32]).expect("a key").public();
        let ada: PersonName = "Ada".parse().expect("a name");
        let good = format!("{key} Ada\n");
        for (number, (bytes, meeting)) in (1..).zip([
            // Not text; and text with a line of something else.
            (&b"\xff\xfe"[..], Meeting::New),
            (&[good.as_bytes(), b"damaged\n"].concat(), Meeting::Again),
        ]) {
            std::fs::write(&file, bytes).expect("written");
            drop(Acquaintances::open(file.clone()));
            let mut met = Acquaintances::open(file.clone());
            let aside = folder.path().join(format!("met.unreadable-{number}"));
            assert_eq!(std::fs::read(aside).expect("kept"), bytes, "as it was");
            assert_eq!(met.meet(key, &ada), meeting, "what could be read");
            let other = Identity::from_seed(&[2; 32]).expect("a key").public();
            met.meet(other, &"Bob".parse().expect("a name"));
            let text = std::fs::read_to_string(&file).expect("another one");
            assert!(text.starts_with(&good), "{text}");
        }
    }

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
