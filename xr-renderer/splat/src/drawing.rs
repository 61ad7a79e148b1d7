//! The input of a picture.

use glam::Affine3A;

use crate::camera::Camera;
use crate::posing::StateId;
use crate::slot::ForegroundSlot;

/// A part of the foreground: Gaussians, and where they stand.
#[derive(Debug, Clone, Copy)]
pub struct Part<'a> {
    /// What is drawn.
    pub gaussians: Foreground<'a>,
    /// From the space the Gaussians are given in to the world's, metres. Rigid.
    pub world_from_part: Affine3A,
}

impl<'a> Part<'a> {
    /// Gaussians that are in world space.
    #[must_use]
    pub const fn here(gaussians: Foreground<'a>) -> Self {
        Self {
            gaussians,
            world_from_part: Affine3A::IDENTITY,
        }
    }
}

/// Which Gaussians a part shows.
#[derive(Debug, Clone, Copy)]
pub enum Foreground<'a> {
    /// What [`crate::renderer::SplatRenderer::set_foreground`] took last; at first there is none.
    Set,
    /// What a slot holds.
    Slot(&'a ForegroundSlot),
    /// The Gaussians of [`crate::options::RendererOptions::mesh`], on the device from end to end: rotations along the shortest arc
    /// from one state to another, the rest in a line. At most one part shows them.
    Posed {
        /// The earlier state.
        from: StateId,
        /// The later one, or the same.
        to: StateId,
        /// How far from one to the other: 0 to 1 between them, up to 2 as far beyond. Held within 0..=2; the later state
        /// where it is no number.
        share: f32,
        /// Which of the mesh's levels of detail ([`crate::posing::BoundMesh::with_levels`]): 0 for all Gaussians, the last one where
        /// there are not as many.
        level: usize,
    },
}

/// The input of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// One for each view.
    pub cameras: &'a [Camera],
    /// The parts of the foreground, at most [`MOST_PARTS`](crate::limits::MOST_PARTS) of them; they may overlap in depth, for all
    /// Gaussians are sorted together. All slots' Gaussians, and what was set, together are at most
    /// [`crate::options::RendererOptions::max_foreground`].
    pub foreground: &'a [Part<'a>],
    /// Whether the last order is kept even where the head or the foreground moved too far for it, to save the sort: depth
    /// is wrong where Gaussians passed one another, and what came into the picture since is missing. Where the last order
    /// is of other Gaussians, or there is none, they are sorted all the same.
    pub keep_order: bool,
}

impl<'a> Drawing<'a> {
    /// A picture that sorts only where it must.
    #[must_use]
    pub const fn new(cameras: &'a [Camera], foreground: &'a [Part<'a>]) -> Self {
        Self {
            cameras,
            foreground,
            keep_order: false,
        }
    }
}
