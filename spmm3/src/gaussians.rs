//! A set of 3D Gaussians in the person's space, as the renderer draws them.

use glam::{Quat, Vec3};

/// Attribute planes of one Gaussian: position 3, rotation 4, log-scale 3, opacity 1, colour 3 (paper, section III-C).
pub const ATTRIBUTES: usize = 14;

/// Spherical harmonic of degree 0: rgb = 0.5 + `SH_C0` * coefficient (3DGS).
pub const SH_C0: f32 = 0.282_094_79;

/// Which of the 14 attribute planes holds what.
pub mod attribute {
    use std::ops::Range;
    /// Offset in the triangle's frame, metres.
    pub const OFFSET: Range<usize> = 0..3;
    /// Quaternion x, y, z, w in the triangle's frame.
    pub const ROTATION: Range<usize> = 3..7;
    /// Natural logarithm of the standard deviations in metres.
    pub const LOG_SCALE: Range<usize> = 7..10;
    /// Opacity before the sigmoid.
    pub const OPACITY: usize = 10;
    /// Colour as spherical harmonics of degree 0.
    pub const COLOUR: Range<usize> = 11..14;
}

/// Gaussians as a structure of arrays, all of one length N_g. Space: metres, the person's (or the world's).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GaussianSet {
    /// Centres, metres.
    pub positions: Vec<Vec3>,
    /// Unit quaternions: columns of the rotation are the principal axes.
    pub rotations: Vec<Quat>,
    /// Natural logarithms of the standard deviations along the principal axes, metres.
    pub log_scales: Vec<Vec3>,
    /// Opacities before the sigmoid.
    pub opacity_logits: Vec<f32>,
    /// Colours as spherical harmonics of degree 0.
    pub colours: Vec<Vec3>,
}

impl GaussianSet {
    /// N_g zeroed Gaussians, to be written by [`crate::BoundGaussians::pose`].
    #[must_use]
    pub fn zeroed(count: usize) -> Self {
        Self {
            positions: vec![Vec3::ZERO; count],
            rotations: vec![Quat::IDENTITY; count],
            log_scales: vec![Vec3::ZERO; count],
            opacity_logits: vec![0.0; count],
            colours: vec![Vec3::ZERO; count],
        }
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}
