//! The motion codec against references of the tests' own: error bounds in f64, loss, damage, and bytes that must not change.

mod bounds;
mod fuzz;
mod golden;
mod loss;
mod motions;
mod refusals;
