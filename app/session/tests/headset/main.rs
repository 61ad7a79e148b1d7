//! The app's loop in a headset, on a real runtime: Monado, started by each test for itself.
//!
//! A runtime is found by the environment, and memory is counted for a process: the loop runs in one of its own, which is this same
//! test program, started again for its one ignored test ([`program`]).

mod memory;
mod phase;
mod program;
mod run;

use test_support::allocations::Counting;

#[global_allocator]
static COUNTING: Counting = Counting;
