//! The motion codec (`link`), built from its own sources without the rest of that crate.
//!
//! `./run test-arm` builds this for arm64 and runs it in an emulator, so that NEON is checked on every machine. Elsewhere it is
//! empty: `cargo test -p link` runs the same tests.
#![cfg(target_arch = "aarch64")]
#![allow(
    unreachable_pub,
    dead_code,
    reason = "parts of other crates, whose other parts use the rest"
)]

#[path = "../../../link/src/codec/mod.rs"]
pub mod codec;
#[path = "../../../link/src/frame.rs"]
mod frame;

pub use codec::{Codec, Decoder, Encoder, Refusal, RefusalCounts};
pub use frame::{Micros, MotionFrame};
