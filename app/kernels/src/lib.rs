//! What the CPU computes for every Gaussian: F_attr's tail, F_m2g, skinning, interpolation and packing.
//!
//! Planar data, vectors chosen at run time (AVX-512, AVX2, SSE or NEON), rayon's current pool for long ranges, no
//! allocation and no `unsafe`. `spmm3` has plain versions of the same formulas, and the tests have references in f64.

#![forbid(unsafe_code)]

mod bind;
mod detail;
mod error;
mod frame;
mod interpolate;
mod poser;
mod skin;
mod slerp;
pub mod state;
mod tail;
#[cfg(test)]
mod tests;

pub use detail::Detail;
pub use error::KernelError;
pub use interpolate::{Blend, MOST_ALPHA};
pub use poser::{Attributes, PoseInputs, Poser};
pub use skin::Skinner;

use spmm3::PersonError;
use std::ops::Range;

/// Gaussians or vertices that one thread takes at a time: large enough to hide the hand-over, small enough that a few
/// threads finish together.
const GRAIN: usize = 4096;

/// Gaussians (or vertices) whose tables lie together, so that a kernel reads memory from front to back.
const BLOCK: usize = 16;

/// One number of every Gaussian of a block.
type Sixteen = [f32; BLOCK];

/// Runs `work` on `range` and the matching elements of `out`, split in halves that run in parallel, down to [`GRAIN`].
fn in_halves<T: Send>(
    range: Range<usize>,
    out: &mut [T],
    work: &(impl Fn(Range<usize>, &mut [T]) + Sync),
) {
    if range.len() <= GRAIN {
        return work(range, out);
    }
    let half = (range.len() / 2).next_multiple_of(BLOCK);
    let middle = range.start + half;
    let (first, second) = out.split_at_mut(half);
    rayon::join(
        || in_halves(range.start..middle, first, work),
        || in_halves(middle..range.end, second, work),
    );
}

/// Refuses an array whose length is not `expected`.
fn check_count(what: &'static str, got: usize, expected: usize) -> Result<(), KernelError> {
    if got == expected {
        return Ok(());
    }
    Err(PersonError::Count {
        what,
        got,
        expected,
    }
    .into())
}

/// Refuses a range that ends past the Gaussians.
fn check_range(range: &Range<usize>, count: usize) -> Result<(), KernelError> {
    if range.start <= range.end && range.end <= count {
        return Ok(());
    }
    Err(PersonError::Index {
        what: "end of the range of Gaussians",
        at: 0,
        index: range.end,
        bound: count + 1,
    }
    .into())
}
