//! What a performer has decided at the door of a room, in a file, a line for each: for when the room is entered again.

use crate::keys;
use anyhow::{Context, bail};
use identity::LineFile;
use link_call::Who;
use link_call::door::DoorRules;
use link_protocol::Name;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// Bytes of the file: four lists of 256, of at most 400 bytes each.
const LONGEST: u64 = 512 << 10;

/// A room's links end before that.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(40 * 86_400);

/// The file of one room or call.
pub(super) struct Book(LineFile);

impl Book {
    /// That of this room or call, in the folder of all of them. Files of rooms that are long over are removed.
    pub(super) fn of(room: &Name) -> anyhow::Result<Self> {
        let folder = keys::rooms()?;
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        forget_old(&folder);
        Ok(Self::at(&folder.join(room.as_str())))
    }

    fn at(file: &Path) -> Self {
        Self(LineFile::new(file.to_owned(), LONGEST))
    }

    pub(super) fn write(&self, rules: &DoorRules) -> anyhow::Result<()> {
        let flags = [
            (rules.ask, "ask"),
            (rules.guests_only, "guests"),
            (rules.locked, "locked"),
            (rules.known_only, "known"),
        ];
        let flags = flags.into_iter().filter(|(holds, _)| *holds);
        let mut lines: Vec<String> = flags.map(|(_, word)| word.to_owned()).collect();
        for (word, all) in [
            ("admitted", &rules.admitted),
            ("entered", &rules.entered),
            ("removed", &rules.removed),
        ] {
            lines.extend(all.iter().map(|who| match who {
                Who::Guest(guest) => format!("{word} guest {guest}"),
                Who::Key(key) => format!("{word} key {key}"),
            }));
        }
        let invited = rules.invited.iter();
        lines.extend(invited.map(|guest| format!("invited {guest}")));
        let written = self.0.write(lines);
        written.with_context(|| format!("cannot write {}", self.0.path().display()))
    }

    pub(super) fn read(&self) -> anyhow::Result<DoorRules> {
        let path = self.0.path().display();
        let lines = self.0.read();
        let lines = lines.with_context(|| format!("cannot read {path}"))?;
        let mut rules = DoorRules::default();
        for (number, line) in lines.iter().enumerate() {
            if take(&mut rules, line).is_none() {
                bail!(
                    "line {} of {path} says nothing about the room's door: remove the file, and nobody is kept out of the room any more",
                    number + 1
                );
            }
        }
        Ok(rules)
    }
}

fn take(rules: &mut DoorRules, line: &str) -> Option<()> {
    let words: Vec<&str> = line.split(' ').collect();
    let who = |kind: &str, text: &str| match kind {
        "guest" => text.parse().ok().map(Who::Guest),
        "key" => text.parse().ok().map(Who::Key),
        _ => None,
    };
    match words.as_slice() {
        ["ask"] => rules.ask = true,
        ["guests"] => rules.guests_only = true,
        ["locked"] => rules.locked = true,
        ["known"] => rules.known_only = true,
        ["admitted", kind, text] => rules.admitted.push(who(kind, text)?),
        ["entered", kind, text] => rules.entered.push(who(kind, text)?),
        ["removed", kind, text] => rules.removed.push(who(kind, text)?),
        ["invited", guest] => rules.invited.push(guest.parse().ok()?),
        _ => return None,
    }
    Some(())
}

fn forget_old(folder: &Path) {
    let Ok(files) = std::fs::read_dir(folder) else {
        return;
    };
    for file in files.flatten() {
        let written = file.metadata().and_then(|metadata| metadata.modified());
        let age = written.map(|written| SystemTime::now().duration_since(written));
        if matches!(age, Ok(Ok(age)) if age > FORGOTTEN_AFTER)
            && let Err(error) = std::fs::remove_file(file.path())
        {
            log::debug!("{} stays: {error}", file.path().display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use identity::Identity;
    use link_protocol::{Guest, Rights};

    #[test]
    fn what_was_decided_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let book = Book::at(&folder.path().join("room"));
        let nothing = book.read().expect("no file yet");
        assert_eq!(nothing, DoorRules::default());
        let key = Identity::from_seed(&[3; 32]).expect("a key").public();
        let bob = Guest {
            name: "Bob the second".parse().expect("a name"),
            expires: 1_900_000_000,
            rights: Rights::ALL,
            token: "t1".parse().expect("a name"),
        };
        let rules = DoorRules {
            ask: true,
            guests_only: true,
            locked: true,
            known_only: true,
            admitted: vec![Who::Key(key)],
            entered: vec![Who::Guest(bob.clone()), Who::Key(key)],
            removed: vec![Who::Guest(bob.clone())],
            invited: vec![bob],
        };
        book.write(&rules).expect("written");
        assert_eq!(book.read().expect("read"), rules);
        std::fs::write(folder.path().join("room"), "removed nobody x\n").expect("written");
        let wrong = book.read().expect_err("nonsense");
        assert!(wrong.to_string().contains("line 1"), "{wrong}");
    }
}
