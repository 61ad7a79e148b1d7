//! A file of the operator's that is read again when it has changed, while the server runs.

use crate::ServerError;
use std::error::Error;
use std::fs;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::sync::watch;

/// Between two looks whether a file has changed.
pub(crate) const LOOK: Duration = Duration::from_secs(2);

/// Bytes of such a file, at most.
pub(crate) const LONGEST: u64 = 1 << 20;

/// Two changes within the precision of a file's times look like one: so new a file is read at each look.
const NEW: Duration = Duration::from_secs(5);

/// What a file says, as far as it could be read.
#[derive(Debug)]
pub(crate) struct Reread<T> {
    file: Option<PathBuf>,
    read: fn(&Path) -> Result<T, ServerError>,
    says: watch::Sender<T>,
    pub(crate) looks: Mutex<Looks>,
}

/// A file's time and length, by which one sees that it has changed; nothing where there is none.
pub(crate) type Written = Option<(SystemTime, u64)>;

#[derive(Debug, Default)]
pub(crate) struct Looks {
    /// The file that was read.
    pub(crate) read: Written,
    /// The last one that could not be, and why: it is logged once, but tried at each look, for the cause may be gone
    /// without a change of the file.
    pub(crate) failed: Option<(Written, String)>,
}

impl<T: Default + PartialEq> Reread<T> {
    /// Reads `file`, if there is to be one, by `read`, which returns the default for a file that is not there.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn open(
        file: Option<PathBuf>,
        read: fn(&Path) -> Result<T, ServerError>,
    ) -> Result<Self, ServerError> {
        let (written, says) = match &file {
            // Looked at before it is read: what is written meanwhile is read again.
            Some(file) => (written(file), read(file)?),
            None => Default::default(),
        };
        Ok(Self {
            file,
            read,
            says: watch::Sender::new(says),
            looks: Mutex::new(Looks {
                read: written,
                failed: None,
            }),
        })
    }

    /// What the file says.
    pub(crate) fn says(&self) -> watch::Ref<'_, T> {
        self.says.borrow()
    }

    /// The same, and all that it will say.
    pub(crate) fn subscribe(&self) -> watch::Receiver<T> {
        self.says.subscribe()
    }

    /// Reads the file again if it has changed; whether it says something else now. What it said before holds while it
    /// cannot be read.
    pub(crate) fn look(&self) -> bool {
        let Some(file) = &self.file else {
            return false;
        };
        let mut looks = self.looks.lock().unwrap_or_else(PoisonError::into_inner);
        // Before it is read: what is written meanwhile is read again.
        let found = written(file);
        if found == looks.read && !is_new(found) {
            return false;
        }
        match (self.read)(file) {
            Ok(says) => {
                *looks = Looks {
                    read: found,
                    failed: None,
                };
                self.says.send_if_modified(|said| {
                    let is_other = *said != says;
                    if is_other {
                        *said = says;
                    }
                    is_other
                })
            }
            Err(error) => {
                let why = error.source().map(ToString::to_string);
                let failed = Some((found, why.unwrap_or_default()));
                if looks.failed != failed {
                    let why = failed.as_ref().map_or("", |(_, why)| why);
                    log::error!("{error}: {why}; what it said before holds");
                    looks.failed = failed;
                }
                false
            }
        }
    }
}

fn is_new(written: Written) -> bool {
    let age = written.map(|(time, _)| time.elapsed());
    // A time to come is no older.
    age.is_some_and(|age| age.map_or(true, |age| age < NEW))
}

pub(crate) fn written(file: &Path) -> Written {
    let found = fs::metadata(file).ok()?;
    Some((found.modified().ok()?, found.len()))
}

/// All of a file; nothing of one that is not there.
///
/// # Errors
/// If it cannot be read, or is longer than [`LONGEST`].
pub(crate) fn text_of(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    match fs::File::open(path) {
        Ok(file) => file.take(LONGEST + 1).read_to_string(&mut text)?,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(text),
        Err(error) => return Err(error),
    };
    if text.len() as u64 > LONGEST {
        return Err(ErrorKind::FileTooLarge.into());
    }
    Ok(text)
}
