//! Tokens that an operator has taken back: a file with the name of one in each line, which is looked at every two seconds. A token that has expired needs no
//! line any more, and may stay.

use crate::{Id, ServerError};
use std::collections::HashSet;
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock};
use std::time::{Duration, SystemTime};

/// Between two looks whether the file has changed.
pub(crate) const LOOK: Duration = Duration::from_secs(2);

/// Bytes of the file, at most: 30,000 tokens.
const LONGEST: u64 = 1 << 20;

/// Adds the token called `name` to the file `path`, which is made if there is none: of this user alone.
///
/// # Errors
/// If the file cannot be written.
pub fn revoke(path: &Path, name: Id) -> Result<(), ServerError> {
    let failed = |source| unusable(path, source);
    let mut options = fs::OpenOptions::new();
    options.append(true).create(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut file = options.open(path).map_err(failed)?;
    // One write: two programs that append at once do not mix their lines.
    (file.write_all(format!("{name}\n").as_bytes()))
        .and_then(|()| file.sync_all())
        .map_err(failed)
}

/// The tokens in the file, as far as it was read.
#[derive(Debug)]
pub(crate) struct Revoked {
    file: Option<PathBuf>,
    state: RwLock<State>,
}

#[derive(Debug, Default)]
struct State {
    names: HashSet<Id>,
    /// When the file was written, and how long it is.
    written: Option<(SystemTime, u64)>,
}

impl Revoked {
    /// Those of `file`, which need not be there yet; none without one.
    ///
    /// # Errors
    /// If the file cannot be read, or has something else in it: then nobody knows which tokens hold.
    pub(crate) fn open(file: Option<PathBuf>) -> Result<Self, ServerError> {
        let state = match &file {
            Some(file) => read(file)?,
            None => State::default(),
        };
        Ok(Self {
            file,
            state: RwLock::new(state),
        })
    }

    /// Whether the token of this name holds no longer.
    pub(crate) fn has(&self, name: Id) -> bool {
        let state = self.state.read().unwrap_or_else(PoisonError::into_inner);
        state.names.contains(&name)
    }

    /// Reads the file again if it has changed. What was revoked stays so while the file cannot be read.
    pub(crate) fn look(&self) {
        let Some(file) = &self.file else { return };
        let known = {
            let state = self.state.read().unwrap_or_else(PoisonError::into_inner);
            state.written
        };
        let found = written(file);
        if found == known {
            return;
        }
        let state = match read(file) {
            Ok(state) => {
                log::info!("{} tokens are revoked", state.names.len());
                state
            }
            Err(error) => {
                log::error!("{error}; those that were revoked before stay so");
                let mut state = self.state.write().unwrap_or_else(PoisonError::into_inner);
                // Said once for each state of the file.
                state.written = found;
                return;
            }
        };
        *self.state.write().unwrap_or_else(PoisonError::into_inner) = state;
    }
}

fn written(file: &Path) -> Option<(SystemTime, u64)> {
    let found = fs::metadata(file).ok()?;
    Some((found.modified().ok()?, found.len()))
}

fn read(path: &Path) -> Result<State, ServerError> {
    // Before it is read: what is written meanwhile is read again.
    let written = written(path);
    let mut text = String::new();
    match fs::File::open(path) {
        Ok(file) => {
            let read = file.take(LONGEST + 1).read_to_string(&mut text);
            read.map_err(|source| unusable(path, source))?;
        }
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(State::default()),
        Err(error) => return Err(unusable(path, error)),
    }
    let wrong = |why: String| unusable(path, std::io::Error::new(ErrorKind::InvalidData, why));
    if text.len() as u64 > LONGEST {
        return Err(wrong(format!("it is longer than {LONGEST} bytes")));
    }
    let lines = text.lines().enumerate();
    let lines = lines.filter(|(_, line)| !line.trim().is_empty());
    let names = lines.map(|(number, line)| {
        let name = Id::parse(line.trim());
        name.ok_or_else(|| wrong(format!("line {} is no token's name", number + 1)))
    });
    Ok(State {
        names: names.collect::<Result<_, _>>()?,
        written,
    })
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
    -> Result<(), Box<dyn std::error::Error>> {
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
            std::error::Error::source(&wrong).is_some_and(|why| why.to_string().contains("line 1")),
            "{wrong}"
        );
        fs::write(&file, format!("{bob}\n\n"))?;
        revoked.look();
        assert!(!revoked.has(ada) && revoked.has(bob), "the file's alone");
        Ok(())
    }
}
