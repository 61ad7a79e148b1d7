//! Covers the template with flat Gaussians: a regular grid of cells on every quad, so that neither holes nor clumps
//! appear (random points need three times as many for the same look).

use super::surface::Surface;
use super::{Part, Person};
use crate::Light;
use glam::Vec3;
use rayon::prelude::*;
use spmm3::{GaussianSet, SH_C0};

/// Gaussians on a person's template, in the template's space, and the surface they lie on.
#[derive(Debug, Clone, PartialEq)]
pub struct ColouredGaussians {
    /// The Gaussians; their colours are lit as the T-pose is.
    pub gaussians: GaussianSet,
    /// `[N_g]` unlit colour, sRGB 0..=1.
    pub albedo: Vec<Vec3>,
    /// `[N_g]` triangle of the template each one lies on.
    pub triangles: Vec<u32>,
    /// `[N_g]` barycentric weights of that triangle's second and third corner.
    pub barycentrics: Vec<[f32; 2]>,
    /// `[N_g]` part of the person.
    pub parts: Vec<Part>,
}

impl ColouredGaussians {
    /// Number of Gaussians N_g.
    #[must_use]
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// `[N_g]` colours (spherical harmonics of degree 0) under `factors`, one light factor a vertex of `person`'s
    /// template as [`Light::factors`] gives them.
    #[must_use]
    pub fn lit_colours(&self, person: &Person, factors: &[Vec3]) -> Vec<Vec3> {
        let faces = person.template().faces();
        self.triangles
            .par_iter()
            .zip(&self.barycentrics)
            .zip(&self.albedo)
            .map(|((triangle, [v, w]), albedo)| {
                let [a, b, c] = faces[*triangle as usize].map(|i| factors[i as usize]);
                shaded_colour(*albedo, a * (1.0 - v - w) + b * *v + c * *w)
            })
            .collect()
    }
}

/// Colour coefficient (spherical harmonics of degree 0) of a surface of `albedo` (sRGB 0..=1) under a light `factor`.
#[must_use]
pub fn shaded_colour(albedo: Vec3, factor: Vec3) -> Vec3 {
    ((albedo * factor).clamp(Vec3::ZERO, Vec3::ONE) - 0.5) / SH_C0
}

/// Covers `person` with about `target_count` Gaussians (within 1 % from 20,000 up to 400,000), densest on the face.
///
/// The result depends on its arguments only.
#[must_use]
pub fn build_gaussians(person: &Person, target_count: usize) -> ColouredGaussians {
    let surface = Surface::new(person);
    // The count falls as the spacing grows: bisect its logarithm.
    let (mut fine, mut coarse) = (2e-4f32.ln(), 0.5f32.ln());
    let mut spacing = 0.5 * (fine + coarse);
    for _ in 0..24 {
        let count = surface.count(spacing.exp());
        if count.abs_diff(target_count) * 400 <= target_count {
            break;
        }
        if count > target_count {
            fine = spacing;
        } else {
            coarse = spacing;
        }
        spacing = 0.5 * (fine + coarse);
    }
    let cells = surface.cells(spacing.exp());
    let mut out = ColouredGaussians {
        gaussians: GaussianSet::zeroed(cells.len()),
        albedo: cells.iter().map(|c| c.albedo).collect(),
        triangles: cells.iter().map(|c| c.triangle).collect(),
        barycentrics: cells.iter().map(|c| c.barycentric).collect(),
        parts: cells.iter().map(|c| c.part).collect(),
    };
    for (i, cell) in cells.iter().enumerate() {
        out.gaussians.positions[i] = cell.position;
        out.gaussians.rotations[i] = cell.rotation;
        out.gaussians.log_scales[i] = cell.scales.map(f32::ln);
        out.gaussians.opacity_logits[i] = (cell.opacity / (1.0 - cell.opacity)).ln();
    }
    let factors = Light::new(person.template(), person.parts(), &person.vertex_parts())
        .factors(person.template().vertices());
    out.gaussians.colours = out.lit_colours(person, &factors);
    out
}
