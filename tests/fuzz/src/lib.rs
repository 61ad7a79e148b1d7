//! What strangers may send, from the network or in a file, to each parser that reads it: one target for each. A target takes any bytes, and may not panic, take
//! memory without bound, or break what it states.
//!
//! `cargo test -p fuzz-targets` runs each a bounded number of times on inputs that are changed at random; `tests/fuzz/cargo-fuzz` has the same targets for
//! [cargo-fuzz](https://rust-fuzz.github.io/book/), which finds its way by coverage and needs a nightly compiler:
//!
//! ```sh
//! cargo +nightly fuzz run --fuzz-dir tests/fuzz/cargo-fuzz TARGET -- -max_total_time=3600
//! ```

#![forbid(unsafe_code)]

mod call;
mod files;
mod trust;

/// A parser, and inputs of which it makes sense.
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// Takes any bytes.
    pub run: fn(&[u8]),
    /// Inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// How often a test runs it: some take a thousand times as long as others.
    pub times: u32,
}

impl std::fmt::Debug for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// All of them.
pub const TARGETS: [Target; 9] = [
    Target {
        name: "messages",
        run: call::messages,
        seeds: call::message_seeds,
        times: 400_000,
    },
    Target {
        name: "frames",
        run: call::frames,
        seeds: call::frame_seeds,
        times: 40_000,
    },
    Target {
        name: "json",
        run: call::json,
        seeds: call::json_seeds,
        times: 100_000,
    },
    Target {
        name: "links",
        run: call::links,
        seeds: call::link_seeds,
        times: 100_000,
    },
    Target {
        name: "voice",
        run: call::voice,
        seeds: call::voice_seeds,
        times: 4_000,
    },
    Target {
        name: "keys",
        run: trust::keys,
        seeds: trust::key_seeds,
        times: 40_000,
    },
    Target {
        name: "package",
        run: files::package,
        seeds: files::package_seeds,
        times: 2_000,
    },
    Target {
        name: "scene",
        run: files::scene,
        seeds: files::scene_seeds,
        times: 20_000,
    },
    Target {
        name: "motion",
        run: files::motion,
        seeds: files::motion_seeds,
        times: 4_000,
    },
];

/// Bytes cut into parts: a byte says how long each is.
fn parts(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let (&length, rest) = bytes.split_first()?;
        let (part, after) = rest.split_at(rest.len().min(length.into()));
        bytes = after;
        Some(part)
    })
}

/// Runs the target of this name.
///
/// # Panics
/// If there is none, or the input shows a fault.
pub fn run(name: &str, bytes: &[u8]) {
    let target = TARGETS.iter().find(|target| target.name == name);
    (target.expect("a target of that name").run)(bytes);
}
