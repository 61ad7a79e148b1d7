//! The CPU's kernels (`app`), built from their own sources without the rest of that crate: `app` whole is 300 crates and C, and what is
//! checked here touches neither network nor GPU nor NPU.
//!
//! `./run test-arm` builds this for arm64 and runs it in an emulator, so that NEON is checked on every machine. Elsewhere it is
//! empty: `cargo test -p app` runs the same tests.
#![cfg(target_arch = "aarch64")]
#![allow(
    unreachable_pub,
    dead_code,
    reason = "parts of other crates, whose other parts use the rest"
)]

mod error;
#[path = "../../../app/src/kernels/mod.rs"]
pub mod kernels;
#[cfg(test)]
#[path = "../../src/person_reference.rs"]
pub mod person_reference;
#[path = "../../../app/src/state.rs"]
pub mod state;
#[cfg(test)]
#[path = "../../src/synthetic/mod.rs"]
pub mod synthetic;

// The names that these sources know one another by.
#[cfg(test)]
extern crate self as mon3tr_tests;

pub use error::ReceiverError;
pub use kernels::{Blend, Poser};
