//! Tokens that an operator has taken back: a file with the name of one in each line, which is looked at every two seconds. A token that has expired needs no
//! line any more, and may stay.

use crate::reread::{LONGEST, Reread, text_of};
use crate::{Id, ServerError};
use std::collections::HashSet;
use std::fs;
use std::io::{ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Bytes of a line: a name in hexadecimal digits and the line's end.
const LINE: usize = 33;

/// Empty lines at the file's end, into which names are written without a need for more space: a token can be revoked
/// while the disk is full, 496 of them. On file systems that write no block in place (Btrfs, ZFS) that takes a little
/// space all the same.
const RESERVE: usize = 496 * LINE;

/// Adds the token called `name` to the file `path`, which is made if there is none: of this user alone.
///
/// # Errors
/// If the file cannot be written, or is one that a server would not read: then the token would hold on, whatever was written.
pub fn revoke(path: &Path, name: Id) -> Result<(), ServerError> {
    let failed = |source| unusable(path, source);
    let mut file = open_locked(path).map_err(failed)?;
    let text = read_text(path)?;
    names(path, &text)?;
    let said = text.trim_end().len();
    let begin = if said == 0 { "" } else { "\n" };
    let line = format!("{begin}{name}\n");
    if (said + line.len()) as u64 > LONGEST {
        return Err(ServerError::RevokedFull {
            path: path.to_path_buf(),
        });
    }
    (file.seek(SeekFrom::Start(said as u64)))
        .and_then(|_| file.write_all(line.as_bytes()))
        .and_then(|()| file.sync_all())
        .map_err(failed)?;
    reserve(&mut file, said + line.len());
    Ok(())
}

/// The file, open for reading and writing, and this program's alone until it is dropped: two programs that revoke at
/// once would write over each other.
fn open_locked(path: &Path) -> std::io::Result<fs::File> {
    let mut options = fs::OpenOptions::new();
    options.read(true).write(true).create(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let file = options.open(path)?;
    #[expect(
        clippy::disallowed_methods,
        reason = "where it is an error is Android, where no server runs"
    )]
    file.lock()?;
    Ok(file)
}

/// Fills the file with empty lines after the first `said` bytes, if there are fewer than should be kept.
fn reserve(file: &mut fs::File, said: usize) {
    let most = usize::try_from(LONGEST).unwrap_or(usize::MAX);
    let wanted = (said + RESERVE).min(most);
    let filled = file.metadata().and_then(|found| {
        let there = usize::try_from(found.len()).unwrap_or(usize::MAX);
        if there >= (said + RESERVE / 2).min(most) {
            return Ok(());
        }
        file.seek(SeekFrom::Start(there as u64))?;
        file.write_all(&vec![b'\n'; wanted - there])?;
        file.sync_all()
    });
    if let Err(why) = filled {
        log::warn!("no space is kept in the list of revoked tokens: {why}");
    }
}

/// The tokens in the file, as far as it was read.
#[derive(Debug)]
pub(crate) struct Revoked(Reread<HashSet<Id>>);

impl Revoked {
    /// Those of `file`, which is made, with space for names, if it is not there; none without one.
    ///
    /// # Errors
    /// If the file cannot be read, or has something else in it: then nobody knows which tokens hold.
    pub(crate) fn open(file: Option<PathBuf>) -> Result<Self, ServerError> {
        if let Some(path) = &file {
            let said = read_text(path)?.trim_end().len();
            match open_locked(path) {
                Ok(mut file) => reserve(&mut file, said),
                Err(why) => log::warn!("no space is kept in {}: {why}", path.display()),
            }
        }
        let read = |path: &Path| names(path, &read_text(path)?);
        Ok(Self(Reread::open(file, read)?))
    }

    /// Whether any token of these names holds no longer.
    pub(crate) fn has_any(&self, of: impl IntoIterator<Item = Id>) -> bool {
        let names = self.0.says();
        of.into_iter().any(|name| names.contains(&name))
    }

    /// Waits until one of these names holds no longer.
    pub(crate) async fn until_any(&self, of: &[Id]) {
        let mut names = self.0.subscribe();
        let is_revoked = |names: &HashSet<Id>| of.iter().any(|name| names.contains(name));
        // It ends otherwise only without its sender, which is `self`.
        let _ = names.wait_for(is_revoked).await;
    }

    /// Reads the file again if it has changed; whether it has other names now. What was revoked stays so while the file
    /// cannot be read.
    pub(crate) fn look(&self) -> bool {
        let has_changed = self.0.look();
        if has_changed {
            log::info!("{} tokens are revoked", self.0.says().len());
        }
        has_changed
    }
}

fn read_text(path: &Path) -> Result<String, ServerError> {
    text_of(path).map_err(|source| match source.kind() {
        ErrorKind::FileTooLarge => ServerError::RevokedFull {
            path: path.to_path_buf(),
        },
        _ => unusable(path, source),
    })
}

fn names(path: &Path, text: &str) -> Result<HashSet<Id>, ServerError> {
    let lines = text.lines().enumerate();
    let lines = lines.filter(|(_, line)| !line.trim().is_empty());
    let names = lines.map(|(number, line)| {
        Id::parse(line.trim()).ok_or_else(|| {
            let why = format!("line {} is no token's name", number + 1);
            unusable(path, std::io::Error::new(ErrorKind::InvalidData, why))
        })
    });
    names.collect()
}

fn unusable(path: &Path, source: std::io::Error) -> ServerError {
    ServerError::RevokedFile {
        path: path.to_path_buf(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reread::written;
    use std::error::Error;
    use std::sync::PoisonError;
    use std::time::SystemTime;

    #[test]
    fn what_is_in_the_file_is_revoked_and_stays_so_while_the_file_is_wrong()
    -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let revoked = Revoked::open(Some(file.clone()))?;
        let [ada, bob] = [Id::random()?, Id::random()?];
        revoke(&file, ada)?;
        assert!(!revoked.has_any([ada]), "not looked at yet");
        revoked.look();
        assert!(revoked.has_any([ada]) && !revoked.has_any([bob]));
        fs::write(&file, "nonsense\n")?;
        revoked.look();
        assert!(revoked.has_any([ada]), "kept");
        let wrong = Revoked::open(Some(file.clone())).expect_err("no list");
        assert!(
            Error::source(&wrong).is_some_and(|why| why.to_string().contains("line 1")),
            "{wrong}"
        );
        fs::write(&file, format!("{bob}\n\n"))?;
        revoked.look();
        assert!(
            !revoked.has_any([ada]) && revoked.has_any([bob]),
            "the file's alone"
        );
        Ok(())
    }

    #[test]
    fn a_file_that_could_not_be_read_is_tried_at_each_look_and_told_of_once()
    -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let revoked = Revoked::open(Some(file.clone()))?;
        let ada = Id::random()?;
        let time = SystemTime::now();
        // As where only its owner changes: neither its time nor its length does.
        let write = |text: String| {
            fs::write(&file, text)?;
            (fs::File::options().append(true).open(&file)?).set_modified(time)
        };
        let looked = || {
            let _ = revoked.look();
            let looks = revoked
                .0
                .looks
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            (looks.read, looks.failed.clone())
        };
        write("x".repeat(32) + "\n")?;
        let found = written(&file);
        let (read, told) = looked();
        assert_ne!(read, found, "not read");
        let (of, why) = told.clone().ok_or("not told")?;
        assert!(of == found && why.contains("line 1"), "{why}");
        assert_eq!(looked(), (read, told), "no other word");
        write(format!("{ada}\n"))?;
        assert_eq!(written(&file), found, "it looks the same");
        assert_eq!(looked(), (found, None), "read");
        assert!(revoked.has_any([ada]), "tried again");
        Ok(())
    }

    #[test]
    fn nothing_is_added_to_a_file_that_no_server_would_read() -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let [ada, bob] = [Id::random()?, Id::random()?];
        let line = format!("{ada}\n");
        let most = usize::try_from(LONGEST)? / line.len();
        let full = line.repeat(most);
        fs::write(&file, &full[line.len()..])?;
        revoke(&file, bob)?;
        assert!(
            Revoked::open(Some(file.clone()))?.has_any([bob]),
            "the last one"
        );
        let refused = revoke(&file, Id::random()?).expect_err("too long");
        assert!(
            matches!(refused, ServerError::RevokedFull { .. }),
            "{refused}"
        );
        assert!(
            Revoked::open(Some(file.clone()))?.has_any([bob]),
            "and it starts"
        );
        fs::write(&file, format!("{ada}\nnonsense\n"))?;
        revoke(&file, bob).expect_err("no list");
        assert!(!fs::read_to_string(&file)?.contains(&bob.to_string()));
        // By hand, without an end of the line.
        fs::write(&file, ada.to_string())?;
        revoke(&file, bob)?;
        let revoked = Revoked::open(Some(file))?;
        assert!(
            revoked.has_any([ada]) && revoked.has_any([bob]),
            "each in its line"
        );
        Ok(())
    }

    #[tokio::test]
    async fn who_waits_for_a_name_is_woken_by_it_alone() -> Result<(), Box<dyn Error>> {
        use futures_util::FutureExt;
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let revoked = Revoked::open(Some(file.clone()))?;
        let [ada, bob] = [Id::random()?, Id::random()?];
        let awaited = [ada];
        let mut waits = std::pin::pin!(revoked.until_any(&awaited));
        for (name, is_over) in [(bob, false), (ada, true)] {
            assert_eq!((&mut waits).now_or_never(), None, "holds");
            revoke(&file, name)?;
            revoked.look();
            assert_eq!((&mut waits).now_or_never().is_some(), is_over, "{name}");
        }
        assert!(
            revoked.until_any(&[bob]).now_or_never().is_some(),
            "at once"
        );
        Ok(())
    }

    #[test]
    fn names_are_written_into_space_that_is_kept_for_them() -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let revoked = Revoked::open(Some(file.clone()))?;
        let kept = fs::metadata(&file)?.len();
        assert_eq!(kept, RESERVE as u64, "from the start");
        let mut all = Vec::new();
        for _ in 0..300 {
            let name = Id::random()?;
            revoke(&file, name)?;
            all.push(name);
            let (text, long) = (fs::read_to_string(&file)?, fs::metadata(&file)?.len());
            let said = text.trim_end().len();
            assert!(
                usize::try_from(long)? - said >= RESERVE / 2,
                "{said} of {long}"
            );
        }
        revoked.look();
        assert!(all.iter().all(|name| revoked.has_any([*name])), "each");
        assert!(!revoked.has_any([Id::random()?]));
        Ok(())
    }

    #[test]
    fn programs_that_revoke_at_once_lose_no_name() -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let all: Vec<Id> = (0..40).map(|_| Id::random()).collect::<Result<_, _>>()?;
        std::thread::scope(|scope| {
            for part in all.chunks(10) {
                let file = &file;
                scope.spawn(move || {
                    for name in part {
                        revoke(file, *name).expect("revoked");
                    }
                });
            }
        });
        let revoked = Revoked::open(Some(file))?;
        assert!(all.iter().all(|name| revoked.has_any([*name])), "each");
        Ok(())
    }
}
