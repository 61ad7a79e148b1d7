//! A deformed person ready to interpolate: 14 planes of numbers, activated, in world space.
//!
//! Allocated once and written over and over by [`crate::Poser`]. It knows neither time nor motion: the lane that hands states
//! on attaches those.

use bytemuck::{Pod, Zeroable};
use shaders_spirv::PackedGaussian;
use spmm3::{GaussianSet, SH_C0};
use std::ops::Range;

/// Planes of a state.
pub const STATE_PLANES: usize = 14;

/// Which plane of a [`GaussianState`] holds what.
pub mod plane {
    use std::ops::Range;
    /// World position, metres, the root translation added.
    pub const POSITION: Range<usize> = 0..3;
    /// Unit quaternion x, y, z, w.
    pub const ROTATION: Range<usize> = 3..7;
    /// Logarithm (base 2) of the standard deviations, metres.
    pub const LOG2_SCALE: Range<usize> = 7..10;
    /// Opacity 0..=1.
    pub const OPACITY: usize = 10;
    /// Display colour, red, green, blue.
    pub const COLOUR: Range<usize> = 11..14;
}

/// The widest SIMD vector of any processor, in `f32`.
pub(crate) const MOST_LANES: usize = 16;

/// A cache line, and the memory that one of the longest vectors covers.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([f32; MOST_LANES]);

/// N_g Gaussians as 14 planes of `f32`.
///
/// Every plane starts on a cache line and is followed by at least 15 unused numbers, so that vectors may read
/// past its end.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianState {
    count: usize,
    /// Numbers from one plane's start to the next's.
    stride: usize,
    lines: Vec<Line>,
}

impl GaussianState {
    /// `count` Gaussians that are not drawn: everything zero.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let lines = count.div_ceil(MOST_LANES) + 1;
        Self {
            count,
            stride: lines * MOST_LANES,
            lines: vec![Line::zeroed(); STATE_PLANES * lines],
        }
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// `[N_g]` numbers of one plane; see [`plane`].
    ///
    /// # Panics
    /// If `plane` is not below [`STATE_PLANES`].
    #[must_use]
    pub fn plane(&self, plane: usize) -> &[f32] {
        &self.padded(plane)[..self.count]
    }

    /// `[N_g]` numbers of one plane, to write.
    ///
    /// # Panics
    /// If `plane` is not below [`STATE_PLANES`].
    pub fn plane_mut(&mut self, plane: usize) -> &mut [f32] {
        let start = plane * self.stride;
        &mut bytemuck::cast_slice_mut(&mut self.lines)[start..start + self.count]
    }

    /// All of them packed for the renderer, for a still: a call's pictures are interpolated ([`crate::Blend`]).
    #[must_use]
    pub fn packed(&self) -> Vec<PackedGaussian> {
        let three = |planes: Range<usize>, i: usize| {
            std::array::from_fn(|at| self.plane(planes.start + at)[i])
        };
        let one = |i| {
            PackedGaussian::new(
                three(plane::POSITION, i),
                std::array::from_fn(|at| self.plane(plane::ROTATION.start + at)[i]),
                three(plane::LOG2_SCALE, i),
                self.plane(plane::OPACITY)[i],
                three(plane::COLOUR, i),
            )
        };
        (0..self.count).map(one).collect()
    }

    /// A plane and the numbers behind it.
    pub(crate) fn padded(&self, plane: usize) -> &[f32] {
        let start = plane * self.stride;
        &bytemuck::cast_slice(&self.lines)[start..start + self.stride]
    }

    /// Every plane with the numbers behind it.
    pub(crate) fn all_padded(&self) -> [&[f32]; STATE_PLANES] {
        std::array::from_fn(|plane| self.padded(plane))
    }

    /// Gaussians `range` of every plane, to write.
    pub(crate) fn range_mut(&mut self, range: Range<usize>) -> StateSlice<'_> {
        let mut planes = bytemuck::cast_slice_mut(&mut self.lines).chunks_exact_mut(self.stride);
        StateSlice(std::array::from_fn(|_| {
            planes
                .next()
                .map_or(&mut [][..], |plane| &mut plane[range.clone()])
        }))
    }
}

impl From<&GaussianSet> for GaussianState {
    /// The same Gaussians, activated: opacities through the sigmoid, colours evaluated.
    fn from(set: &GaussianSet) -> Self {
        let mut state = Self::new(set.len());
        for (i, position) in set.positions.iter().enumerate() {
            let colour = set.colours[i] * SH_C0 + 0.5;
            let scale = set.log_scales[i] * std::f32::consts::LOG2_E;
            let opacity = 1.0 / (1.0 + (-set.opacity_logits[i]).exp());
            let values = position
                .to_array()
                .into_iter()
                .chain(set.rotations[i].to_array())
                .chain(scale.to_array())
                .chain([opacity])
                .chain(colour.to_array());
            for (plane, value) in values.enumerate() {
                state.plane_mut(plane)[i] = value;
            }
        }
        state
    }
}

/// Some Gaussians of every plane of a state.
pub(crate) struct StateSlice<'a>(pub(crate) [&'a mut [f32]; STATE_PLANES]);

impl StateSlice<'_> {
    /// The first `at` Gaussians and the others.
    pub(crate) fn split_at_mut(&mut self, at: usize) -> (StateSlice<'_>, StateSlice<'_>) {
        let mut tails: [&mut [f32]; STATE_PLANES] = Default::default();
        let mut planes = self.0.iter_mut().zip(&mut tails);
        let heads = std::array::from_fn(|_| {
            planes.next().map_or(&mut [][..], |(plane, tail)| {
                let (head, rest) = plane.split_at_mut(at);
                *tail = rest;
                head
            })
        });
        (StateSlice(heads), StateSlice(tails))
    }
}

/// How far Gaussians went from one state to the next: the greatest of all that were compared.
///
/// A Gaussian that is not a number in one of the states counts as still: it is not drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StateChange {
    /// Distance of the positions, metres.
    pub moved: f32,
    /// Difference of log2 scales: a doubling is 1.
    pub octaves: f32,
    /// Difference of opacities, 0..=1.
    pub opacity: f32,
}

impl StateChange {
    /// The change over both.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        Self {
            moved: self.moved.max(other.moved),
            octaves: self.octaves.max(other.octaves),
            opacity: self.opacity.max(other.opacity),
        }
    }
}
