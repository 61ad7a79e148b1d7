//! The motion codec against references of the tests' own: error bounds in f64, loss, damage, and bytes that must not change.

mod bounds;
mod errors;
mod golden;
mod loss;
#[path = "../motions/mod.rs"]
mod motions;
