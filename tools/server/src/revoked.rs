//! Tokens that an operator has taken back: a file with the name of one in each line, which is looked at every two seconds. A token that has expired needs no
//! line any more, and may stay.

use crate::{Id, ServerError};
use std::collections::HashSet;
use std::error::Error;
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::sync::watch;

/// Between two looks whether the file has changed.
pub(crate) const LOOK: Duration = Duration::from_secs(2);

/// Bytes of the file, at most: 30,000 tokens.
const LONGEST: u64 = 1 << 20;

/// Adds the token called `name` to the file `path`, which is made if there is none: of this user alone.
///
/// # Errors
/// If the file cannot be written, or is one that a server would not read: then the token would hold on, whatever was written.
pub fn revoke(path: &Path, name: Id) -> Result<(), ServerError> {
    let text = read_text(path)?;
    names(path, &text)?;
    // A line that was added by hand may have no end.
    let is_whole = text.is_empty() || text.ends_with('\n');
    let begin = if is_whole { "" } else { "\n" };
    let line = format!("{begin}{name}\n");
    if (text.len() + line.len()) as u64 > LONGEST {
        return Err(ServerError::RevokedFull {
            path: path.to_path_buf(),
        });
    }
    let failed = |source| unusable(path, source);
    let mut options = fs::OpenOptions::new();
    options.append(true).create(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut file = options.open(path).map_err(failed)?;
    // One write: two programs that append at once do not mix their lines.
    (file.write_all(line.as_bytes()))
        .and_then(|()| file.sync_all())
        .map_err(failed)
}

/// The tokens in the file, as far as it was read.
#[derive(Debug)]
pub(crate) struct Revoked {
    file: Option<PathBuf>,
    names: watch::Sender<HashSet<Id>>,
    looks: Mutex<Looks>,
}

/// A file's time and length, by which one sees that it has changed; nothing where there is none.
type Written = Option<(SystemTime, u64)>;

#[derive(Debug, Default)]
struct Looks {
    /// The file that was read.
    read: Written,
    /// The last one that could not be, and why: it is told once, but tried at each look, for what is wrong may be mended without a change of the file.
    told: Option<(Written, String)>,
}

impl Revoked {
    /// Those of `file`, which need not be there yet; none without one.
    ///
    /// # Errors
    /// If the file cannot be read, or has something else in it: then nobody knows which tokens hold.
    pub(crate) fn open(file: Option<PathBuf>) -> Result<Self, ServerError> {
        let (read, names) = match &file {
            // Looked at before it is read: what is written meanwhile is read again.
            Some(file) => (written(file), names(file, &read_text(file)?)?),
            None => Default::default(),
        };
        Ok(Self {
            file,
            names: watch::Sender::new(names),
            looks: Mutex::new(Looks { read, told: None }),
        })
    }

    /// Whether the token of this name holds no longer.
    pub(crate) fn has(&self, name: Id) -> bool {
        self.names.borrow().contains(&name)
    }

    /// Waits until the token of this name holds no longer.
    pub(crate) async fn until(&self, name: Id) {
        let mut names = self.names.subscribe();
        // It ends otherwise only without its sender, which is `self`.
        let _ = names.wait_for(|names| names.contains(&name)).await;
    }

    /// Reads the file again if it has changed. What was revoked stays so while the file cannot be read.
    pub(crate) fn look(&self) {
        let Some(file) = &self.file else { return };
        let mut looks = self.looks.lock().unwrap_or_else(PoisonError::into_inner);
        // Before it is read: what is written meanwhile is read again.
        let found = written(file);
        if found == looks.read {
            return;
        }
        match read_text(file).and_then(|text| names(file, &text)) {
            Ok(names) => {
                log::info!("{} tokens are revoked", names.len());
                self.names.send_replace(names);
                *looks = Looks {
                    read: found,
                    told: None,
                };
            }
            Err(error) => {
                let why = error.source().map(ToString::to_string);
                let told = Some((found, why.unwrap_or_default()));
                if looks.told != told {
                    let why = told.as_ref().map_or("", |(_, why)| why);
                    log::error!("{error}: {why}; those that were revoked before stay so");
                    looks.told = told;
                }
            }
        }
    }
}

fn written(file: &Path) -> Written {
    let found = fs::metadata(file).ok()?;
    Some((found.modified().ok()?, found.len()))
}

/// All of the file; nothing of one that is not there.
fn read_text(path: &Path) -> Result<String, ServerError> {
    let mut text = String::new();
    match fs::File::open(path) {
        Ok(file) => {
            let read = file.take(LONGEST + 1).read_to_string(&mut text);
            read.map_err(|source| unusable(path, source))?;
        }
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(unusable(path, error)),
    }
    if text.len() as u64 > LONGEST {
        return Err(ServerError::RevokedFull {
            path: path.to_path_buf(),
        });
    }
    Ok(text)
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

    #[test]
    fn what_is_in_the_file_is_revoked_and_stays_so_while_the_file_is_wrong()
    -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let revoked = Revoked::open(Some(file.clone()))?;
        let [ada, bob] = [Id::random()?, Id::random()?];
        revoke(&file, ada)?;
        assert!(!revoked.has(ada), "not looked at yet");
        revoked.look();
        assert!(revoked.has(ada) && !revoked.has(bob));
        fs::write(&file, "nonsense\n")?;
        revoked.look();
        assert!(revoked.has(ada), "kept");
        let wrong = Revoked::open(Some(file.clone())).expect_err("no list");
        assert!(
            Error::source(&wrong).is_some_and(|why| why.to_string().contains("line 1")),
            "{wrong}"
        );
        fs::write(&file, format!("{bob}\n\n"))?;
        revoked.look();
        assert!(!revoked.has(ada) && revoked.has(bob), "the file's alone");
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
            revoked.look();
            let looks = revoked.looks.lock().unwrap_or_else(PoisonError::into_inner);
            (looks.read, looks.told.clone())
        };
        write("x".repeat(32) + "\n")?;
        let found = written(&file);
        let (read, told) = looked();
        assert_eq!(read, None, "not read");
        let (of, why) = told.clone().ok_or("not told")?;
        assert!(of == found && why.contains("line 1"), "{why}");
        assert_eq!(looked(), (None, told), "no other word");
        write(format!("{ada}\n"))?;
        assert_eq!(written(&file), found, "it looks the same");
        assert_eq!(looked(), (found, None), "read");
        assert!(revoked.has(ada), "tried again");
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
        assert!(Revoked::open(Some(file.clone()))?.has(bob), "the last one");
        let refused = revoke(&file, Id::random()?).expect_err("too long");
        assert!(
            matches!(refused, ServerError::RevokedFull { .. }),
            "{refused}"
        );
        assert!(Revoked::open(Some(file.clone()))?.has(bob), "and it starts");
        fs::write(&file, format!("{ada}\nnonsense\n"))?;
        revoke(&file, bob).expect_err("no list");
        assert!(!fs::read_to_string(&file)?.contains(&bob.to_string()));
        // By hand, without an end of the line.
        fs::write(&file, ada.to_string())?;
        revoke(&file, bob)?;
        let revoked = Revoked::open(Some(file))?;
        assert!(revoked.has(ada) && revoked.has(bob), "each in its line");
        Ok(())
    }

    #[tokio::test]
    async fn who_waits_for_a_name_is_woken_by_it_alone() -> Result<(), Box<dyn Error>> {
        use futures_util::FutureExt;
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("revoked");
        let revoked = Revoked::open(Some(file.clone()))?;
        let [ada, bob] = [Id::random()?, Id::random()?];
        let mut waits = std::pin::pin!(revoked.until(ada));
        for (name, is_over) in [(bob, false), (ada, true)] {
            assert_eq!((&mut waits).now_or_never(), None, "holds");
            revoke(&file, name)?;
            revoked.look();
            assert_eq!((&mut waits).now_or_never().is_some(), is_over, "{name}");
        }
        assert!(revoked.until(bob).now_or_never().is_some(), "at once");
        Ok(())
    }
}
