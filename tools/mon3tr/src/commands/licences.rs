//! `mon3tr licences`: what this program is made of.

/// Written by `scripts/supply.py`, which CI compares with the lock file.
const CRATES: &str = include_str!("../../licences.txt");

/// Runs `licences`.
pub(crate) fn run() {
    println!(
        "Mon3tr {} is under the MIT licence or the Apache License 2.0, as you like. It is made of these crates as well, each under its own licence:\n\n{}",
        env!("CARGO_PKG_VERSION"),
        CRATES.trim_end()
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_crate_is_told_with_its_licence_and_where_it_is_from() {
        assert!(CRATES.lines().count() > 100);
        for line in CRATES.lines() {
            let parts: Vec<&str> = line.split(" | ").collect();
            assert!(
                matches!(parts[..], [name, licence, from] if name.contains(' ') && !licence.is_empty() && from.starts_with("http")),
                "{line}"
            );
        }
    }
}
