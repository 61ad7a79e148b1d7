//! Whether the Gaussians cover the body, all of it and nothing else, in any pose.

use super::grown::grown;
use crate::mesh_depth::depths;
use crate::pinhole::Pinhole;
use crate::scan::Scan;
use crate::surface::raster;
use glam::DVec3;
use serde::Serialize;
use std::f64::consts::TAU;

/// How far beside the body's silhouette Gaussians may show, metres.
const BESIDE: f64 = 0.03;
/// How far inside the silhouette a pixel has to be opaque, metres.
const INSIDE: f64 = 0.012;
/// Distance of the views' cameras from a body of up to [`USUAL`] metres, metres, and their focal length, pixels.
const DISTANCE: f64 = 3.4;
const USUAL: f64 = 2.0;
const FOCAL: f64 = 700.0;

/// Shares of the body's silhouette.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Coverage {
    /// Opacity beside the body, as a share of its pixels.
    pub spill: f64,
    /// The body's pixels through which more than half of the light comes, as a share of all.
    pub holes: f64,
}

/// Views around a body, all of it in the picture.
#[must_use]
pub fn views(vertices: &[DVec3], azimuths: usize) -> Vec<Pinhole> {
    let low = vertices.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = vertices.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    if !(low.is_finite() && high.is_finite()) {
        return Vec::new();
    }
    let target = (low + high) / 2.0;
    let distance = DISTANCE * ((high - low).max_element() / USUAL).max(1.0);
    (0..azimuths)
        .map(|at| {
            let azimuth = TAU * at as f64 / azimuths as f64;
            let eye = target + distance * DVec3::new(azimuth.sin(), 0.08, azimuth.cos());
            Pinhole::look_at(eye, target, DVec3::Y, FOCAL, 440, 480)
        })
        .collect()
}

impl Coverage {
    /// The mean of some.
    pub(crate) fn mean(all: &[Self]) -> Self {
        let count = all.len().max(1) as f64;
        Self {
            spill: all.iter().map(|one| one.spill).sum::<f64>() / count,
            holes: all.iter().map(|one| one.holes).sum::<f64>() / count,
        }
    }
}

/// How a scan covers a body in the same pose, the mean over views.
#[must_use]
pub fn coverage(
    scan: &Scan,
    vertices: &[DVec3],
    faces: &[[u32; 3]],
    views: &[Pinhole],
) -> Coverage {
    let of_views: Vec<Coverage> = (views.iter())
        .map(|view| in_view(scan, vertices, faces, view))
        .collect();
    Coverage::mean(&of_views)
}

fn in_view(scan: &Scan, vertices: &[DVec3], faces: &[[u32; 3]], view: &Pinhole) -> Coverage {
    let width = view.width as usize;
    let picture = raster::draw(scan, view);
    let body: Vec<bool> = (depths(vertices, faces, view).iter())
        .map(|depth| depth.is_finite())
        .collect();
    let metre = view.focal / DISTANCE;
    let near = grown(&body, width, BESIDE * metre);
    let outside: Vec<bool> = body.iter().map(|b| !b).collect();
    let rim = grown(&outside, width, INSIDE * metre);
    let mut pixels = 0.0;
    let mut coverage = Coverage::default();
    for (at, clear) in picture.transmittance.iter().enumerate() {
        if body[at] {
            pixels += 1.0;
        }
        if !near[at] {
            coverage.spill += 1.0 - f64::from(*clear);
        }
        if !rim[at] && *clear > 0.5 {
            coverage.holes += 1.0;
        }
    }
    if pixels > 0.0 {
        coverage.spill /= pixels;
        coverage.holes /= pixels;
    }
    coverage
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};

    /// A board of 0.4 m by 1 m, and Gaussians on its left part and beside it.
    #[test]
    fn half_a_board_bare_is_holes_and_what_stands_beside_it_is_spill() {
        let vertices =
            [(-0.2, 0.0), (0.2, 0.0), (0.2, 1.0), (-0.2, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
        let faces = [[0, 1, 2], [0, 2, 3]];
        let mut scan = Scan::default();
        let mut dot = |x: f32, y: f32| {
            scan.positions.push(Vec3::new(x, y, 0.0));
            scan.rotations.push(Quat::IDENTITY);
            scan.scales.push(Vec3::new(0.006, 0.006, 0.001));
            scan.opacities.push(0.99);
            scan.colours.push(Vec3::ONE);
        };
        for y in 0..100 {
            for x in 0..20 {
                dot(x as f32 / 100.0 - 0.195, y as f32 / 100.0 + 0.005);
            }
        }
        let view = &views(&vertices, 1)[..1];
        let half = coverage(&scan, &vertices, &faces, view);
        assert!((half.holes - 0.5).abs() < 0.05, "{half:?}");
        assert!(half.spill < 1e-3, "{half:?}");
        let mut dot = |x: f32, y: f32| {
            scan.positions.push(Vec3::new(x, y, 0.0));
            scan.rotations.push(Quat::IDENTITY);
            scan.scales.push(Vec3::new(0.006, 0.006, 0.001));
            scan.opacities.push(0.99);
            scan.colours.push(Vec3::ONE);
        };
        for y in 0..20 {
            for x in 0..20 {
                dot(x as f32 / 100.0 + 0.3, y as f32 / 100.0);
            }
        }
        let beside = coverage(&scan, &vertices, &faces, view);
        assert!((beside.spill - 0.1).abs() < 0.02, "{beside:?}");
    }
}
