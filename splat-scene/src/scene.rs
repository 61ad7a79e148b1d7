//! A static Gaussian scene as a structure of arrays.

use crate::axes::Axes;
use crate::{Bounds, Dropped, Format, rest_coefficients};

/// The arrays of a scene, one entry for each Gaussian; `sh_rest` has `3 * rest_coefficients` for each.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Arrays {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) rotations: Vec<[f32; 4]>,
    pub(crate) log_scales: Vec<[f32; 3]>,
    pub(crate) opacities: Vec<f32>,
    pub(crate) colours: Vec<[f32; 3]>,
    pub(crate) sh_rest: Vec<f32>,
}

/// A static scene of up to [`crate::MAX_GAUSSIANS`] Gaussians. All arrays have one length and every value is finite and in
/// its range: a user of a scene need not check again.
///
/// Made by [`Scene::load`], [`Scene::read`] or a [`crate::SceneBuilder`].
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    pub(crate) arrays: Arrays,
    sh_degree: u8,
    dropped: Dropped,
    format: Format,
    antialiased: bool,
    /// How the file's axes lie in OpenXR's.
    pub(crate) axes: Axes,
    /// Whether the file says so.
    pub(crate) axes_stated: bool,
}

impl Scene {
    /// Only the builder calls this, with values it has checked.
    pub(crate) fn checked(
        arrays: Arrays,
        sh_degree: u8,
        dropped: Dropped,
        format: Format,
        antialiased: bool,
    ) -> Self {
        Self {
            arrays,
            sh_degree,
            dropped,
            format,
            antialiased,
            axes: format.axes(),
            axes_stated: false,
        }
    }

    /// The number of Gaussians.
    pub fn len(&self) -> usize {
        self.arrays.positions.len()
    }

    /// Whether there is no Gaussian at all.
    pub fn is_empty(&self) -> bool {
        self.arrays.positions.is_empty()
    }

    /// Centres, in the scene's units, x right, y up, z back.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.arrays.positions
    }

    /// Unit quaternions x, y, z, w that turn a Gaussian's own axes into the scene's.
    pub fn rotations(&self) -> &[[f32; 4]] {
        &self.arrays.rotations
    }

    /// Natural logarithms of the standard deviations along the own axes, within ±[`crate::MAX_LOG_SCALE`].
    pub fn log_scales(&self) -> &[[f32; 3]] {
        &self.arrays.log_scales
    }

    /// Opacities at the centres, activated: 0 to 1.
    pub fn opacities(&self) -> &[f32] {
        &self.arrays.opacities
    }

    /// SH coefficients of degree 0 for red, green and blue: `rgb = 0.5 + SH_C0 * colour` plus the degrees above.
    pub fn colours(&self) -> &[[f32; 3]] {
        &self.arrays.colours
    }

    /// SH coefficients above degree 0, `[len][rest_coefficients][rgb]`, in the order and with the signs of
    /// [`crate::sh_basis`]; the direction is from the eye to the Gaussian in the scene's frame.
    pub fn sh_rest(&self) -> &[f32] {
        &self.arrays.sh_rest
    }

    /// The degree of the spherical harmonics: 0, 1, 2 or 3.
    pub fn sh_degree(&self) -> u8 {
        self.sh_degree
    }

    /// SH coefficients of one Gaussian above degree 0: 0, 3, 8 or 15, each red, green and blue.
    pub fn rest_coefficients(&self) -> usize {
        rest_coefficients(self.sh_degree)
    }

    /// The Gaussians of the file that were left out.
    pub fn dropped(&self) -> Dropped {
        self.dropped
    }

    /// What the scene was read from.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Whether the file says that the scene was trained with an anti-aliasing filter (Mip-Splatting). Only `.spz` and
    /// SOG say.
    pub fn antialiased(&self) -> bool {
        self.antialiased
    }

    /// The box around all centres; nothing for an empty scene. A captured scene has strays far away: to frame a picture,
    /// take [`Self::robust_bounds`].
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::around(self.positions())
    }

    /// The box from the 1st to the 99th percentile of the centres on each axis; nothing for an empty scene.
    pub fn robust_bounds(&self) -> Option<Bounds> {
        Bounds::around_most(self.positions(), 0.01)
    }
}
