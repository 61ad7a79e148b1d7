//! The people whom this side has met in calls, by their keys: anyone may take a name, but nobody another one's key.

use identity::{LineFile, PublicKey};
use link_protocol::PersonName;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// People that are kept; those who were met least recently go first.
const MOST: usize = 1000;
/// As many new people as are kept, within so long, are reported: whoever makes up keys has others forgotten.
const MANY_WITHIN: Duration = Duration::from_secs(86_400);
/// Bytes of the file that are looked at.
const MOST_BYTES: u64 = 1 << 20;
/// Files that could not be read, which are kept.
const MOST_ASIDE: u32 = 100;

/// Whom this side has met; kept in a file where there is one, a line `KEY NAME` each.
#[derive(Debug, Default)]
pub struct Acquaintances {
    file: Option<LineFile>,
    /// Those who were met last are last.
    met: Vec<Acquaintance>,
    /// When the newest of them were met first.
    new: VecDeque<Instant>,
}

/// A person who was met.
#[derive(Debug)]
struct Acquaintance {
    key: PublicKey,
    name: PersonName,
    /// How the name looks.
    seen: [String; 2],
}

impl Acquaintance {
    fn new(key: PublicKey, name: PersonName) -> Self {
        let seen = name.as_seen();
        Self { key, name, seen }
    }
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

/// That so many new people were met that all who were known before may be forgotten.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "careful: you met {MOST} people with new keys within a day, so someone may be making up keys to have you forget others: compare fingerprints with people you know"
)]
pub struct ManyNew;

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
                new: VecDeque::new(),
            },
            Some((Ok(aside), why)) => {
                log::warn!(
                    "not all whom you have met can be read from {shown} ({why}): it is kept as {}, and another one begun",
                    aside.display()
                );
                let another = Self {
                    met,
                    file: Some(file),
                    new: VecDeque::new(),
                };
                another.keep();
                another
            }
            // It is not written over.
            Some((Err(error), why)) => {
                log::warn!(
                    "not all whom you have met can be read from {shown} ({why}), nor can it be kept aside ({error}): whom you meet is not written down"
                );
                Self {
                    met,
                    ..Self::default()
                }
            }
        }
    }

    /// Meets a person, and keeps them as the one who was met last.
    pub fn meet(&mut self, key: PublicKey, name: &PersonName) -> Meeting {
        if let Some(at) = self.met.iter().position(|met| met.key == key) {
            let known = self.met.remove(at);
            let before = known.name.clone();
            self.met.push(known);
            if at + 1 < self.met.len() {
                self.keep();
            }
            return if before == *name {
                Meeting::Again
            } else {
                Meeting::Renamed { before }
            };
        }
        let person = Acquaintance::new(key, name.clone());
        let looks_alike = |met: &Acquaintance| {
            let mut both = met.seen.iter().zip(&person.seen);
            both.any(|(met, seen)| met == seen)
        };
        if self.met.iter().any(looks_alike) {
            return Meeting::Namesake;
        }
        if self.met.len() >= MOST {
            self.met.remove(0);
        }
        self.met.push(person);
        self.new.push_back(Instant::now());
        self.keep();
        Meeting::New
    }

    /// That as many new people as are kept were met within a day, once for each so many.
    pub fn many_new(&mut self) -> Option<ManyNew> {
        while self
            .new
            .front()
            .is_some_and(|met| met.elapsed() > MANY_WITHIN)
        {
            self.new.pop_front();
        }
        (self.new.len() >= MOST).then(|| {
            self.new.clear();
            ManyNew
        })
    }

    /// Writes down whom this side has met.
    fn keep(&self) {
        if let Some(file) = &self.file {
            let lines =
                (self.met.iter()).map(|Acquaintance { key, name, .. }| format!("{key} {name}"));
            if let Err(error) = file.write(lines) {
                let path = file.path().display();
                log::warn!("whom you have met cannot be kept in {path}: {error}");
            }
        }
    }
}

/// A line of the file.
fn read(line: &str) -> Option<Acquaintance> {
    let (key, name) = line.split_once(' ')?;
    Some(Acquaintance::new(key.parse().ok()?, name.parse().ok()?))
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
        let cyrillic = name("\u{410}da Lovelace");
        assert_eq!(
            met.meet(key(2), &cyrillic),
            Meeting::Namesake,
            "by another script"
        );
        let mut strangers = (0u64..).map(|seed| {
            let mut bytes = [9; 32];
            bytes[..8].copy_from_slice(&seed.to_le_bytes());
            let key = Identity::from_seed(&bytes).expect("a key").public();
            (key, name(&key.fingerprint()))
        });
        let mut met_by = |met: &mut Acquaintances, count: usize| {
            for (key, name) in strangers.by_ref().take(count) {
                assert_eq!(met.meet(key, &name), Meeting::New);
            }
        };
        // The friend who was met first is met again now and then.
        assert_eq!(met.many_new(), None);
        for _ in 0..3 {
            met_by(&mut met, MOST / 2);
            assert_eq!(met.meet(key(1), &ada), Meeting::Again, "not forgotten");
            assert_eq!(met.meet(key(2), &ada), Meeting::Namesake, "not forgotten");
        }
        assert_eq!(met.many_new(), Some(ManyNew));
        assert_eq!(met.many_new(), None, "once");
        let mut met = Acquaintances::open(file);
        assert_eq!(met.met.len(), MOST, "bounded");
        assert_eq!(met.meet(key(1), &ada), Meeting::Again, "kept");
        met_by(&mut met, MOST);
        assert_eq!(met.meet(key(1), &ada), Meeting::New, "least recently met");
    }
}
