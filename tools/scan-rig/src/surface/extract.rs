//! Points and normals of the surface from depths, and what was seen of each Gaussian.

use super::Surface;
use super::raster::{self, Picture};
use super::views::{around, close_ups};
use crate::pinhole::Pinhole;
use crate::scan::Scan;
use glam::{DVec2, Vec3};
use rayon::prelude::*;

/// Side of the grid's cells in which points are averaged, metres.
const CELL: f32 = 0.007;
/// A pixel through which more light comes is not surface.
const CLEAR: f32 = 0.2;
/// Depths of neighbouring pixels that differ by more are an edge, metres.
const EDGE: f32 = 0.03;
/// Cosine between normal and line of sight below which a depth is too uncertain.
const GRAZING: f32 = 0.3;
/// Points that a cell needs.
const POINTS: usize = 3;
/// Length of the mean of a cell's normals below which they contradict each other.
const AGREEMENT: f32 = 0.6;

/// What views from all sides show of a scan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Survey {
    /// The surface.
    pub surface: Surface,
    /// How much of each Gaussian shows: the largest blending weight that it has in any pixel of any view, 0..=1, `[N_g]`.
    pub peak: Vec<f32>,
}

/// Looks at a scan from all sides.
#[must_use]
pub fn survey(scan: &Scan) -> Survey {
    let seen: Vec<_> = around(scan)
        .into_par_iter()
        .map(|view| {
            let (picture, peak) = raster::draw_with_peaks(scan, &view);
            (peak, oriented_points(&picture, &view))
        })
        .collect();
    let mut peak = vec![0.0_f32; scan.len()];
    let mut points = Vec::new();
    for (here, found) in seen {
        for (most, here) in peak.iter_mut().zip(here) {
            *most = most.max(here);
        }
        points.extend(found);
    }
    let (close, of_head) = close_ups(scan);
    let close: Vec<_> = close
        .par_iter()
        .map(|view| raster::draw_with_peaks(scan, view).1)
        .collect();
    for here in close {
        // Whatever else a close view shows is shown better from afar.
        for ((most, here), of_head) in peak.iter_mut().zip(here).zip(&of_head) {
            if *of_head {
                *most = most.max(here);
            }
        }
    }
    Survey {
        surface: averaged(points),
        peak,
    }
}

/// A point of the surface and its normal.
type Oriented = (Vec3, Vec3);

/// The points of a picture that are surely on the surface: opaque, away from edges, not seen at a grazing angle.
fn oriented_points(picture: &Picture, view: &Pinhole) -> Vec<Oriented> {
    let (width, height) = (picture.width, picture.height);
    let eye = view.eye.as_vec3();
    let point = |x: usize, y: usize| {
        let at = (DVec2::new(x as f64, y as f64) + 0.5 - view.centre()) / view.focal;
        let depth = f64::from(picture.depth[y * width + x]);
        (view.eye + view.world_from_camera * (at.extend(1.0) * depth)).as_vec3()
    };
    let mut found = Vec::new();
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let at = y * width + x;
            if picture.transmittance[at] >= CLEAR || !picture.depth[at].is_finite() {
                continue;
            }
            let depth = &picture.depth;
            let across = (depth[at + 1] - depth[at - 1]).abs();
            let down = (depth[at + width] - depth[at - width]).abs();
            // Not so either if one of them is infinite.
            if !(across < EDGE && down < EDGE) {
                continue;
            }
            let here = point(x, y);
            let right = point(x + 1, y) - point(x - 1, y);
            let below = point(x, y + 1) - point(x, y - 1);
            let Some(normal) = below.cross(right).try_normalize() else {
                continue;
            };
            let facing = -normal.dot((here - eye).normalize_or_zero());
            if facing.abs() > GRAZING {
                found.push((here, normal * facing.signum()));
            }
        }
    }
    found
}

/// One point for each cell of a grid in which enough points agree, in the order of the grid.
fn averaged(points: Vec<Oriented>) -> Surface {
    let mut keyed: Vec<_> = points
        .into_par_iter()
        .filter(|(point, normal)| point.is_finite() && normal.is_finite())
        .map(|(point, normal)| ((point / CELL).floor().as_ivec3().to_array(), point, normal))
        .collect();
    // Stable: points of one cell stay in the order of the views, so that their sum is the same every time.
    keyed.par_sort_by_key(|(key, ..)| *key);
    let mut surface = Surface::default();
    for cell in keyed.chunk_by(|a, b| a.0 == b.0) {
        let count = cell.len() as f32;
        let point: Vec3 = cell.iter().map(|(_, point, _)| *point).sum();
        let normal: Vec3 = cell.iter().map(|(.., normal)| *normal).sum();
        if cell.len() >= POINTS && normal.length() / count > AGREEMENT {
            surface.points.push(point / count);
            surface.normals.push(normal.normalize());
        }
    }
    surface
}
