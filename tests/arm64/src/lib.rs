//! The CPU's kernels (`app`) and the motion codec (`link`), built from their own sources without the rest of those crates: `app`
//! and `link` whole are 300 crates and C, and what is checked here touches neither network nor GPU nor NPU.
//!
//! `./run test-arm` builds this for arm64 and runs it in an emulator, so that NEON is checked on every machine. Elsewhere it is
//! empty: `cargo test -p app -p link` runs the same tests.
#![cfg(target_arch = "aarch64")]
#![allow(
    unreachable_pub,
    dead_code,
    reason = "parts of other crates, whose other parts use the rest"
)]

#[path = "../../../link/src/codec/mod.rs"]
pub mod codec;
mod error;
#[path = "../../../link/src/frame.rs"]
mod frame;
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

pub use codec::{Codec, Decoder, Encoder, Refusal, RefusalCounts};
pub use error::ReceiverError;
pub use frame::{Micros, MotionFrame};
pub use kernels::{Blend, Poser};
