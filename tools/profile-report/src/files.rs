//! The files of a profile.

use crate::{Report, page, trace};
use app_pipeline::profile::{Recording, Terms};
use serde_json::json;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// The file that appears in a profile's folder when the profile is over.
pub const FINISHED: &str = "finished";

/// What the file [`FINISHED`] says of a profile that succeeded.
const SUCCEEDED: &str = "ok";

/// A file of a profile could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", file.display())]
pub struct WriteError {
    /// Which one.
    pub file: PathBuf,
    /// Why not.
    #[source]
    pub source: io::Error,
}

/// The paths of the three files; their folders exist.
#[derive(Debug, Clone)]
pub struct Files {
    /// Every figure.
    pub json: PathBuf,
    /// The trace, for ui.perfetto.dev.
    pub trace: PathBuf,
    /// The timeline and distributions, for any browser.
    pub page: PathBuf,
}

impl Files {
    /// Writes all three.
    ///
    /// # Errors
    /// If one cannot be written.
    pub fn write(
        &self,
        report: &Report,
        recording: &Recording,
        terms: &Terms,
    ) -> Result<(), WriteError> {
        written(&self.json, || {
            let text = serde_json::to_string_pretty(report)?;
            std::fs::write(&self.json, text + "\n")
        })?;
        written(&self.page, || {
            std::fs::write(&self.page, page::page(report, recording, terms)?)
        })?;
        written(&self.trace, || {
            let about = json!({ "avatar": report.avatar.name, "conditions": report.conditions });
            let mut out = BufWriter::new(File::create(&self.trace)?);
            trace::write(&mut out, recording, terms, &report.machine, &about)?;
            out.flush()
        })
    }
}

/// A folder for one profile, which `android/profile.sh` waits for and fetches: `profile.json`, `trace.json`,
/// `profile.html` and the table `profile.txt`, and at last [`FINISHED`].
#[derive(Debug, Clone)]
pub struct Folder(PathBuf);

impl Folder {
    /// Makes an empty one: files of an earlier profile under these names are removed.
    ///
    /// # Errors
    /// If the folder cannot be made, or an old file not be removed.
    pub fn begin(folder: &Path) -> Result<Self, WriteError> {
        written(folder, || std::fs::create_dir_all(folder))?;
        let new = Self(folder.to_owned());
        let Files { json, trace, page } = new.files();
        for file in [new.file(FINISHED), json, trace, page, new.table()] {
            written(&file, || match std::fs::remove_file(&file) {
                Err(why) if why.kind() == io::ErrorKind::NotFound => Ok(()),
                other => other,
            })?;
        }
        Ok(new)
    }

    /// Writes everything, then that it is finished.
    ///
    /// # Errors
    /// If a file cannot be written; [`Self::failed`] may still report that.
    pub fn write(
        &self,
        report: &Report,
        recording: &Recording,
        terms: &Terms,
    ) -> Result<(), WriteError> {
        self.files().write(report, recording, terms)?;
        let table = self.table();
        written(&table, || std::fs::write(&table, report.table()))?;
        self.finish(SUCCEEDED)
    }

    /// Reports that there is no profile, and why.
    ///
    /// # Errors
    /// If that cannot be written.
    pub fn failed(&self, why: &str) -> Result<(), WriteError> {
        self.finish(&format!("failed: {why}"))
    }

    /// Under a temporary name first, so that the script does not read half a line.
    fn finish(&self, how: &str) -> Result<(), WriteError> {
        let (part, file) = (self.file("finished.part"), self.file(FINISHED));
        written(&file, || {
            std::fs::write(&part, format!("{how}\n"))?;
            std::fs::rename(&part, &file)
        })
    }

    fn files(&self) -> Files {
        Files {
            json: self.file("profile.json"),
            trace: self.file("trace.json"),
            page: self.file("profile.html"),
        }
    }

    fn table(&self) -> PathBuf {
        self.file("profile.txt")
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

fn written(file: &Path, write: impl FnOnce() -> io::Result<()>) -> Result<(), WriteError> {
    write().map_err(|source| WriteError {
        file: file.to_owned(),
        source,
    })
}
