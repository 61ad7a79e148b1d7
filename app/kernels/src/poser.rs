//! The deform graph's results -> a state: F_attr's tail where the graph leaves it out, and F_m2g, in one pass.

use super::bind::{Bound, Mesh};
use super::tail::{Residuals, Tail};
use super::{BLOCK, GRAIN, check_count, check_range};
use crate::KernelError;
use crate::state::{GaussianState, STATE_PLANES, StateChange, StateSlice};
use fearless_simd::{Level, dispatch, prelude::*};
use glam::Vec3;
use spmm3::{ATTRIBUTES, Avatar};
use std::ops::Range;

/// What the deform graph computes of F_attr.
#[derive(Debug, Clone, Copy)]
pub enum Attributes<'a> {
    /// Residuals, row-major [14, N_g]: the graph computed F_attr whole.
    Residuals(&'a [f32]),
    /// Controllers' potentials, row-major [C, B]: the tail is still to be computed.
    Potentials(&'a [f32]),
}

/// What one frame's state is made of.
#[derive(Debug, Clone, Copy)]
pub struct PoseInputs<'a> {
    /// Posed vertices, row-major [3, N_v], metres, root translation left out.
    pub vertices: &'a [f32],
    /// F_attr's result.
    pub attributes: Attributes<'a>,
    /// Root translation, metres.
    pub root: Vec3,
}

/// An avatar's Gaussians laid out for posing. Allocates at construction only.
#[derive(Debug, Clone)]
pub struct Poser {
    gaussians: usize,
    vertices: usize,
    bound: Vec<Bound>,
    tail: Option<Tail>,
    level: Level,
}

/// One frame's inputs, checked.
#[derive(Clone, Copy)]
struct Frame<'a> {
    mesh: Mesh<'a>,
    source: Source<'a>,
    previous: Option<[&'a [f32]; STATE_PLANES]>,
}

#[derive(Clone, Copy)]
enum Source<'a> {
    Residuals(&'a [f32]),
    Potentials(&'a Tail, &'a [f32]),
}

impl Poser {
    /// A poser for graphs that compute F_attr whole: it takes residuals only.
    #[must_use]
    pub fn new(avatar: &Avatar) -> Self {
        Self {
            gaussians: avatar.gaussians.len(),
            vertices: avatar.template.vertices().len(),
            bound: Bound::blocks(&avatar.gaussians),
            tail: None,
            level: Level::new(),
        }
    }

    /// A poser that also computes F_attr's tail; it holds the bases, 15 MB for 60,000 Gaussians.
    ///
    /// # Errors
    /// If the avatar's graph does not hold F_attr in our form, which [`Avatar::load`] makes sure of.
    pub fn with_tail(avatar: &Avatar) -> Result<Self, KernelError> {
        let network = avatar.attribute_network()?;
        Ok(Self {
            tail: Some(Tail::new(&network, &avatar.controllers)),
            ..Self::new(avatar)
        })
    }

    /// The same on another SIMD level.
    #[cfg(test)]
    pub(super) fn at_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        self.gaussians
    }

    /// Bytes of its own that posing all Gaussians reads: of the binding, and of the tail.
    #[must_use]
    pub fn table_bytes(&self) -> (usize, usize) {
        let tail = self.tail.as_ref().map_or(0, Tail::bytes);
        (size_of_val(&self.bound[..]), tail)
    }

    /// Poses Gaussians `range` into the same ones of `out`, and says how far they went since `previous`.
    ///
    /// Any ranges that together cover everything give the same state; multiples of 16 cost least. Runs on rayon's current
    /// pool, ranges of up to 4,096 on this thread alone, and allocates nothing there.
    ///
    /// # Errors
    /// If `inputs`, `previous` or `out` are not of the avatar's sizes, `range` is not within it, or potentials come
    /// without [`Self::with_tail`].
    pub fn pose(
        &self,
        inputs: &PoseInputs<'_>,
        range: Range<usize>,
        previous: Option<&GaussianState>,
        out: &mut GaussianState,
    ) -> Result<StateChange, KernelError> {
        check_range(&range, self.gaussians)?;
        check_count("Gaussians of the state", out.len(), self.gaussians)?;
        if let Some(previous) = previous {
            check_count(
                "Gaussians of the state before",
                previous.len(),
                self.gaussians,
            )?;
        }
        let frame = Frame {
            mesh: self.mesh(inputs)?,
            source: self.source(inputs.attributes)?,
            previous: previous.map(GaussianState::all_padded),
        };
        Ok(self.in_halves(&frame, range.clone(), out.range_mut(range)))
    }

    /// F_attr's residuals of all Gaussians, row-major [14, N_g], from potentials: an intermediate result of [`Self::pose`],
    /// for tests and tools.
    ///
    /// # Errors
    /// As [`Self::pose`].
    pub fn residuals(&self, potentials: &[f32], out: &mut [f32]) -> Result<(), KernelError> {
        check_count("residuals", out.len(), ATTRIBUTES * self.gaussians)?;
        let Source::Potentials(tail, potentials) =
            self.source(Attributes::Potentials(potentials))?
        else {
            return Ok(());
        };
        let mut planes = out.chunks_exact_mut(self.gaussians.max(1));
        let planes = StateSlice(std::array::from_fn(|_| planes.next().unwrap_or_default()));
        tail_in_halves(tail, potentials, self.level, 0..self.gaussians, planes);
        Ok(())
    }

    fn mesh<'a>(&self, inputs: &PoseInputs<'a>) -> Result<Mesh<'a>, KernelError> {
        let (planes, count) = (inputs.vertices, self.vertices);
        check_count("posed vertex coordinates", planes.len(), 3 * count)?;
        let (x, rest) = planes.split_at(count);
        let (y, z) = rest.split_at(count);
        Ok(Mesh {
            planes: [x, y, z],
            root: inputs.root,
        })
    }

    fn source<'a>(&'a self, attributes: Attributes<'a>) -> Result<Source<'a>, KernelError> {
        match attributes {
            Attributes::Residuals(residuals) => {
                check_count("residuals", residuals.len(), ATTRIBUTES * self.gaussians)?;
                Ok(Source::Residuals(residuals))
            }
            Attributes::Potentials(potentials) => {
                let tail = self.tail.as_ref().ok_or(KernelError::NoTail)?;
                check_count("potentials", potentials.len(), tail.potentials())?;
                Ok(Source::Potentials(tail, potentials))
            }
        }
    }

    fn in_halves(
        &self,
        frame: &Frame<'_>,
        range: Range<usize>,
        mut out: StateSlice<'_>,
    ) -> StateChange {
        let Some(middle) = middle(&range) else {
            return dispatch!(self.level, simd => self.pose_run(simd, frame, range, out));
        };
        let (first, second) = out.split_at_mut(middle - range.start);
        let (first, second) = rayon::join(
            || self.in_halves(frame, range.start..middle, first),
            || self.in_halves(frame, middle..range.end, second),
        );
        first.join(second)
    }

    /// One thread's part.
    #[inline(always)]
    fn pose_run<S: Simd>(
        &self,
        simd: S,
        frame: &Frame<'_>,
        range: Range<usize>,
        mut out: StateSlice<'_>,
    ) -> StateChange {
        let mut change = StateChange::default();
        let mut residuals: Residuals = [[0.0; BLOCK]; ATTRIBUTES];
        for (block, lanes) in blocks(range.clone()) {
            match frame.source {
                Source::Potentials(tail, potentials) => {
                    tail.residuals(simd, potentials, block, &mut residuals);
                }
                Source::Residuals(planes) => self.copy_residuals(planes, block, &mut residuals),
            }
            let at = block * BLOCK + lanes.start;
            let end = block * BLOCK + lanes.end;
            let previous = frame
                .previous
                .map(|planes| planes.map(|plane| &plane[at..end]));
            let mut out = StateSlice(
                out.0
                    .each_mut()
                    .map(|plane| &mut plane[at - range.start..end - range.start]),
            );
            let moved = self.bound[block].pose(
                simd,
                &frame.mesh,
                &residuals,
                lanes,
                previous.as_ref(),
                &mut out,
            );
            change = change.join(moved);
        }
        change
    }

    #[inline(always)]
    fn copy_residuals(&self, planes: &[f32], block: usize, out: &mut Residuals) {
        let from = block * BLOCK;
        let count = BLOCK.min(self.gaussians - from);
        for (out, plane) in out.iter_mut().zip(planes.chunks_exact(self.gaussians)) {
            out[..count].copy_from_slice(&plane[from..from + count]);
        }
    }
}

/// Where to cut a range that is too long for one thread: at a block's border.
fn middle(range: &Range<usize>) -> Option<usize> {
    (range.len() > GRAIN).then(|| usize::midpoint(range.start, range.end).next_multiple_of(BLOCK))
}

/// The blocks that a range touches, and which of their Gaussians are in it.
fn blocks(range: Range<usize>) -> impl Iterator<Item = (usize, Range<usize>)> {
    (range.start / BLOCK..range.end.div_ceil(BLOCK)).map(move |block| {
        let start = block * BLOCK;
        let lanes = range.start.max(start) - start..range.end.min(start + BLOCK) - start;
        (block, lanes)
    })
}

fn tail_in_halves(
    tail: &Tail,
    potentials: &[f32],
    level: Level,
    range: Range<usize>,
    mut out: StateSlice<'_>,
) {
    if let Some(middle) = middle(&range) {
        let (first, second) = out.split_at_mut(middle - range.start);
        rayon::join(
            || tail_in_halves(tail, potentials, level, range.start..middle, first),
            || tail_in_halves(tail, potentials, level, middle..range.end, second),
        );
        return;
    }
    dispatch!(level, simd => {
        let mut residuals: Residuals = [[0.0; BLOCK]; ATTRIBUTES];
        for (block, lanes) in blocks(range.clone()) {
            tail.residuals(simd, potentials, block, &mut residuals);
            let at = block * BLOCK + lanes.start - range.start;
            for (out, residuals) in out.0.iter_mut().zip(&residuals) {
                out[at..at + lanes.len()].copy_from_slice(&residuals[lanes.clone()]);
            }
        }
    });
}
