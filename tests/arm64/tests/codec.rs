//! `link`'s tests of the motion codec (`link/tests/codec/`), golden bytes among them; not its fuzzing, which takes an emulator eight
//! minutes and looks for panics, which no processor changes.
#![cfg(target_arch = "aarch64")]

extern crate arm64_tests as link;

#[path = "../../../link/tests/codec/bounds.rs"]
mod bounds;
#[path = "../../../link/tests/codec/golden.rs"]
mod golden;
#[path = "../../../link/tests/codec/loss.rs"]
mod loss;
#[path = "../../../link/tests/codec/motions.rs"]
#[expect(dead_code, reason = "the fuzzing uses the rest")]
mod motions;
#[path = "../../../link/tests/codec/refusals.rs"]
mod refusals;
