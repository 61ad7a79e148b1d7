//! The licences that go into the package: most of what the app is made of may be passed on only together with its licence's text.

use super::tools::succeed;
use anyhow::Context;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Files of the repository, each with its name in the package.
const FILES: [(&str, &str); 5] = [
    ("LICENSE-APACHE", "LICENSE-APACHE"),
    ("LICENSE-MIT", "LICENSE-MIT"),
    ("tools/mon3tr/licences.txt", "crates.txt"),
    ("android/licences.txt", "libraries.txt"),
    ("android/onnxruntime-notices.txt", "onnxruntime.txt"),
];
/// The texts that crates bring.
const NOTICES: &str = "notices.txt";

/// Names and contents.
pub(super) fn texts(repo: &Path) -> anyhow::Result<Vec<(&'static str, Vec<u8>)>> {
    let read =
        |path: &Path| fs::read(path).with_context(|| format!("could not read {}", path.display()));
    let place = tempfile::tempdir().context("could not make a temporary folder")?;
    let notices = place.path().join(NOTICES);
    let mut supply = Command::new("python3");
    supply.arg(repo.join("scripts/supply.py"));
    succeed(supply.arg("--notices").arg(&notices))
        .context("could not gather the licences of the crates")?;
    let mut texts = vec![(NOTICES, read(&notices)?)];
    for (file, name) in FILES {
        texts.push((name, read(&repo.join(file))?));
    }
    Ok(texts)
}
