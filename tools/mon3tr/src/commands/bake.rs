//! `mon3tr bake`: builds the demo person's avatar package from MakeHuman's data.

use crate::report::write_json;
use crate::surroundings::{Surroundings, cache, make_folder, makehuman};
use anyhow::Context;
const BAKE_VERSION: u32 = 1;
use std::path::{Path, PathBuf};

/// Options of `bake`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    choices: BakeChoices,
    /// The package to write
    #[arg(long, value_name = "FILE", default_value = "out/demo.m3a")]
    out: PathBuf,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What a bake may differ in; `demo` takes it too.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct BakeChoices {
    /// Gaussians of the demo avatar, 20k to 400k
    #[arg(long, value_name = "COUNT", default_value = "60k", value_parser = parse_count)]
    gaussians: usize,
}

/// Runs `bake`.
pub(crate) fn run(options: &Options, surroundings: &Surroundings) -> anyhow::Result<()> {
    let report = bake(&options.choices, &options.out, surroundings)?;
    println!("{}", options.out.display());
    options
        .json
        .as_ref()
        .map_or(Ok(()), |file| write_json(file, &report))
}

/// The demo avatar's package from the cache; baked first if there is none of this kind yet.
pub(crate) fn baked_demo_avatar(
    choices: &BakeChoices,
    surroundings: &Surroundings,
) -> anyhow::Result<PathBuf> {
    let folder = cache()?.join("avatars");
    let package = folder.join(format!("demo-{}-v{BAKE_VERSION}.m3a", choices.gaussians));
    if !package.is_file() {
        make_folder(&folder)?;
        println!(
            "baking the demo avatar once ({} Gaussians, some minutes)",
            choices.gaussians
        );
        bake(choices, &package, surroundings)?;
    }
    Ok(package)
}

fn bake(choices: &BakeChoices, out: &Path, _s: &Surroundings) -> anyhow::Result<serde_json::Value> {
    let _ = (choices, out, makehuman()?);
    anyhow::bail!("not yet")
}

fn parse_count(text: &str) -> Result<usize, String> {
    let (digits, unit) = text
        .strip_suffix('k')
        .map_or((text, 1), |digits| (digits, 1000));
    let count = digits
        .parse::<usize>()
        .ok()
        .and_then(|n| n.checked_mul(unit));
    count
        .filter(|n| (20_000..=400_000).contains(n))
        .ok_or_else(|| format!("{text} is not a count from 20k to 400k"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_may_be_written_in_thousands() {
        assert_eq!(parse_count("60k"), Ok(60_000));
        assert_eq!(parse_count("123456"), Ok(123_456));
        for mistake in ["7", "1000k", "many", "99999999999999999999k"] {
            assert!(parse_count(mistake).is_err(), "{mistake}");
        }
    }
}
