//! The settings and folders of one launch of the app.

use crate::settings::{Origin, Problem, Settings, Sources, Task};
use crate::storage::Folders;
use crate::succession::Aim;
use log::LevelFilter;
use std::path::Path;

/// One launch of the app.
#[derive(Debug, Clone)]
pub struct Launch {
    /// The settings, or every problem with them.
    pub settings: Result<Settings, Vec<Problem>>,
    /// The app's folders.
    pub folders: Folders,
    /// The log level.
    pub log_level: LevelFilter,
}

impl Launch {
    /// Reads the settings from the intent's extras, the link that it may have as its data, and the file in the app's folder.
    /// `unreadable` is why the intent could not be read to its end, if it could not.
    #[must_use]
    pub fn new<'a>(
        extras: impl IntoIterator<Item = (&'a str, &'a str)>,
        link: Option<&str>,
        unreadable: Option<String>,
        folders: Folders,
    ) -> Self {
        let (file, trouble) = match read_file(&folders.settings_file()) {
            Ok(file) => (file, None),
            Err(why) => (None, Some((Origin::File, why))),
        };
        let mut sources = Sources::read(extras, link, file.as_deref());
        let troubles = unreadable.map(|why| (Origin::Intent, why));
        for (origin, why) in troubles.into_iter().chain(trouble) {
            sources = sources.with_problem(Problem::Unreadable { origin, why });
        }
        Self {
            settings: sources.settings(),
            log_level: sources.log_level(),
            folders,
        }
    }

    /// Where its intent leads. What any app may ask for is not worth leaving a call: who is to be asked about a new server must have left the call before.
    #[must_use]
    pub fn aim(&self) -> Aim {
        let Ok(settings) = &self.settings else {
            return Aim::Nowhere;
        };
        let known = self.folders.servers();
        let (origin, is_known) = match &settings.task {
            Task::Call(rooms) => {
                let mut rooms_of = rooms.value.iter();
                (
                    rooms.origin,
                    rooms_of.all(|room| known.has(room.server(), None)),
                )
            }
            Task::Member(call) => {
                let name = Some(call.value.call());
                (call.origin, known.has(call.value.server(), name))
            }
            Task::Profile(time) => (time.origin, false),
        };
        match origin {
            Origin::Default | Origin::File => Aim::Nowhere,
            Origin::Link | Origin::Intent if is_known => Aim::Known,
            Origin::Link | Origin::Intent => Aim::New,
        }
    }
}

/// The file's text; nothing if there is no file.
fn read_file(path: &Path) -> Result<Option<String>, String> {
    use std::io::{ErrorKind, Read};
    let limit = crate::settings::LONGEST_FILE as u64 + 1;
    let file = match std::fs::File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.to_string()),
    };
    let mut text = String::new();
    file.take(limit)
        .read_to_string(&mut text)
        .map_err(|error| error.to_string())?;
    Ok(Some(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn launch(folder: &Path) -> Launch {
        let extras = [("log", "debug")];
        Launch::new(extras, None, None, Folders::new(folder, folder))
    }

    #[test]
    fn the_file_in_the_apps_folder_is_read_and_may_be_missing() {
        let folder = tempfile::tempdir().expect("a folder");
        let without = launch(folder.path());
        assert_eq!(
            without.settings.expect_err("no room"),
            [Problem::Missing(crate::settings::Key::Room)],
            "only the room is missing"
        );
        assert_eq!(without.log_level, LevelFilter::Debug, "the extra counts");
        let path = folder.path().join("mon3tr.toml");
        fs::write(&path, "room = \"https://h/rooms/R#secret\"\n").expect("written");
        assert!(launch(folder.path()).settings.is_ok(), "the file's room");
        fs::write(&path, [0xff, 0xfe]).expect("written");
        let problems = launch(folder.path()).settings.expect_err("no text");
        assert!(
            matches!(
                problems.as_slice(),
                [
                    Problem::Unreadable {
                        origin: Origin::File,
                        ..
                    },
                    ..
                ]
            ),
            "{problems:?}"
        );
    }

    #[test]
    fn an_intent_leads_somewhere_new_until_the_wearer_has_agreed() {
        let folder = tempfile::tempdir().expect("a folder");
        let folders = Folders::new(folder.path(), folder.path());
        let opened = |extras: &[(&'static str, &'static str)], link| {
            Launch::new(extras.iter().copied(), link, None, folders.clone()).aim()
        };
        let link = Some("mon3tr://room/https/meet.example/rooms/r1#token");
        assert_eq!(opened(&[], link), Aim::New, "a server that is new here");
        let server = "https://meet.example".parse().expect("an address");
        folders.servers().add(&server, None).expect("a file");
        assert_eq!(opened(&[], link), Aim::Known);
        assert_eq!(opened(&[], None), Aim::Nowhere, "the launcher");
        let profile = [("profile", "60")];
        assert_eq!(opened(&profile, None), Aim::New, "any app can ask for that");
        let nonsense = Some("mon3tr://room/nonsense");
        assert_eq!(opened(&[], nonsense), Aim::Nowhere);
        let call = Some("mon3tr://call/https/meet.example/calls/c1#token");
        assert_eq!(opened(&[], call), Aim::New, "a call is agreed to by itself");
        let room = "room = \"https://meet.example/rooms/r1#token\"";
        fs::write(folders.settings_file(), room).expect("a file");
        assert_eq!(
            opened(&[], None),
            Aim::Nowhere,
            "the file's, as each launch's"
        );
    }
}
