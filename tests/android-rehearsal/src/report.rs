//! The results of the cases, for people and as JSON.

use crate::cases::Figures;
use anyhow::Context;
use serde::Serialize;
use std::path::Path;

/// The result of one case.
#[derive(Debug, Serialize)]
pub(crate) struct Performed {
    pub(crate) name: &'static str,
    pub(crate) shows: &'static str,
    pub(crate) passed: bool,
    /// Why it failed.
    pub(crate) failure: Option<String>,
    pub(crate) seconds: f64,
    pub(crate) figures: Figures,
}

/// The results of all cases.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// Until the app's library was there, seconds.
    pub(crate) build_seconds: f64,
    pub(crate) cases: Vec<Performed>,
}

impl Report {
    pub(crate) fn failed(&self) -> usize {
        self.cases.iter().filter(|case| !case.passed).count()
    }

    pub(crate) fn write(&self, file: &Path) -> anyhow::Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        std::fs::write(file, text + "\n")
            .with_context(|| format!("cannot write {}", file.display()))
    }
}

impl Performed {
    /// As one line, and where it failed why.
    pub(crate) fn print(&self) {
        let word = if self.passed { "ok" } else { "FAILED" };
        let figures: Vec<String> = (self.figures.iter())
            .filter(|(_, value)| value.is_number() || value.is_string())
            .map(|(name, value)| match value.as_f64() {
                Some(number) if value.is_f64() => format!("{name} {number:.1}"),
                _ => format!("{name} {}", value.to_string().trim_matches('"')),
            })
            .collect();
        println!(
            "{:<20} {word:<6} {:5.1} s  {}",
            self.name,
            self.seconds,
            figures.join(", ")
        );
        if let Some(failure) = &self.failure {
            println!("    {}", failure.replace('\n', "\n    "));
        }
    }
}
