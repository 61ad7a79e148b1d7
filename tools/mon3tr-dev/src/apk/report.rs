//! What was packaged, for people and for programs.

use super::gather::Gathered;
use super::key_store::Key;
use super::{APPLICATION, Options};
use android_native::native::Route;
use anyhow::Context;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// Everything `apk` prints.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    file: PathBuf,
    bytes: u64,
    package: String,
    /// With what the library was built.
    route: String,
    profile: &'static str,
    certificate_sha256: String,
    /// Whose key signed.
    key: String,
    symbols: PathBuf,
    libraries: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Row {
    file: String,
    version: String,
    bytes: usize,
    sha256: String,
    from: String,
    /// What was checked, all of it good: one that was not is not packaged.
    checked: String,
}

impl Report {
    pub(super) fn new(
        options: &Options,
        route: &Route,
        gathered: &Gathered,
        key: &Key,
        bytes: u64,
        symbols: &Path,
    ) -> Self {
        let libraries = gathered
            .members
            .iter()
            .map(|member| Row {
                file: member.part.file.clone(),
                version: member.part.version.clone(),
                bytes: member.part.data.len(),
                sha256: member.part.sha256.clone(),
                from: member.part.from.clone(),
                checked: match &member.elf {
                    None => "for the NPU: not checked".to_owned(),
                    Some(elf) => format!(
                        "loads: {} symbols of {}",
                        elf.undefined.iter().filter(|symbol| !symbol.weak).count(),
                        elf.needed.join(" ")
                    ),
                },
            })
            .collect();
        Self {
            file: options.out.clone(),
            bytes,
            package: APPLICATION.to_owned(),
            route: route.describe(),
            profile: if options.release { "release" } else { "debug" },
            certificate_sha256: key.certificate_sha256.clone(),
            key: match &options.keystore {
                Some(store) => store.display().to_string(),
                None => "the debug key of this machine: stores take none of it".to_owned(),
            },
            symbols: symbols.to_owned(),
            libraries,
        }
    }

    pub(super) fn write_json(&self, path: Option<&Path>) -> anyhow::Result<()> {
        let Some(path) = path else {
            return Ok(());
        };
        let text = serde_json::to_string_pretty(self).context("the report is no JSON")?;
        std::fs::write(path, text).with_context(|| format!("could not write {}", path.display()))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |of: fn(&Row) -> usize| self.libraries.iter().map(of).max().unwrap_or(0);
        let (file, version) = (width(|row| row.file.len()), width(|row| row.version.len()));
        writeln!(
            f,
            "{}: {}, {} build, {:.1} MB",
            self.file.display(),
            self.package,
            self.profile,
            megabytes(self.bytes)
        )?;
        writeln!(f, "  built   {}", self.route)?;
        for row in &self.libraries {
            writeln!(
                f,
                "  {:file$}  {:version$}  {:>5.1} MB  {}  {}",
                row.file,
                row.version,
                megabytes(row.bytes as u64),
                // Enough to tell files apart; the JSON has all of it.
                row.sha256.get(..16).unwrap_or(&row.sha256),
                row.checked
            )?;
            writeln!(f, "  {:file$}  from {}", "", row.from)?;
        }
        writeln!(f, "  signed  {}", self.certificate_sha256)?;
        writeln!(f, "          by {}", self.key)?;
        writeln!(f, "  symbols {}", self.symbols.display())
    }
}

#[expect(
    clippy::cast_precision_loss,
    reason = "a size in megabytes, to one decimal"
)]
fn megabytes(bytes: u64) -> f64 {
    bytes as f64 / 1e6
}
