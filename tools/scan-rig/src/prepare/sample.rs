//! A scan's Gaussians as points with normals: evenly spread ones of many.

use crate::scan::Scan;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Of a scan's box, the share at each end that strays lie in.
const STRAYS: f64 = 0.01;
/// How far beyond the box of most the rest may lie, in its size.
const MARGIN: f32 = 0.1;
/// Gaussians that are less opaque say nothing.
const LEAST_OPACITY: f32 = 0.15;
/// The most area that a Gaussian counts with, in squared sizes of the box.
const MOST_AREA: f32 = 4e-4;
/// Cells along the longest side of the box, where there are 100,000 points.
const CELLS: f32 = 96.0;

/// A Gaussian as a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Its centre, in the scan's units.
    pub position: Vec3,
    /// Its thinnest axis, of unit length; zero if it is no disc.
    pub normal: Vec3,
    /// How much surface it shows: opacity times area, limited, since single Gaussians may be huge.
    pub area: f32,
}

/// Points of a scan.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The points, in the scan's order.
    pub points: Vec<Point>,
    low: Vec3,
    high: Vec3,
}

impl Sample {
    /// At most so many of a scan's Gaussians, in a box (opposite corners) if one is given, strays left out.
    #[must_use]
    pub fn of(scan: &Scan, within: Option<[Vec3; 2]>, most: usize) -> Self {
        let [least, greatest] = within.map_or([Vec3::NEG_INFINITY, Vec3::INFINITY], |[a, b]| {
            [a.min(b), a.max(b)]
        });
        let inside = |at: &usize| {
            let point = scan.positions[*at];
            point.is_finite()
                && point.cmpge(least).all()
                && point.cmple(greatest).all()
                && scan.opacities[*at] >= LEAST_OPACITY
        };
        let all: Vec<usize> = (0..scan.len()).into_par_iter().filter(inside).collect();
        let step = all.len().div_ceil(most.max(1)).max(1);
        let chosen: Vec<usize> = all.into_iter().step_by(step).collect();
        let [(low_x, high_x), (low_y, high_y), (low_z, high_z)] = [0, 1, 2].map(|axis| {
            let mut values: Vec<f32> = chosen.iter().map(|at| scan.positions[*at][axis]).collect();
            quantiles(&mut values)
        });
        let (low, high) = (
            Vec3::new(low_x, low_y, low_z),
            Vec3::new(high_x, high_y, high_z),
        );
        let margin = Vec3::splat((high - low).max_element() * MARGIN);
        let (low, high) = ((low - margin).max(least), (high + margin).min(greatest));
        let points = chosen
            .into_par_iter()
            .filter(|at| {
                let point = scan.positions[*at];
                point.cmpge(low).all() && point.cmple(high).all()
            })
            .map(|at| Point {
                position: scan.positions[at],
                normal: normal(scan, at),
                area: area(scan, at).min((high - low).max_element().powi(2) * MOST_AREA),
            })
            .collect();
        Self { points, low, high }
    }

    /// The longest side of the box of most points; nothing if there are too few points.
    #[must_use]
    pub fn size(&self) -> Option<f32> {
        let size = (self.high - self.low).max_element() / (1.0 + 2.0 * MARGIN);
        (self.points.len() >= 3 && size.is_finite() && size > 0.0).then_some(size)
    }

    /// The side of cells in which points of a surface are neighbours.
    #[must_use]
    pub fn cell(&self) -> f32 {
        #[expect(clippy::cast_precision_loss, reason = "a count, for a square root")]
        let sparse = (1e5 / self.points.len().max(1) as f32)
            .sqrt()
            .clamp(1.0, 5.0);
        self.size().unwrap_or(1.0) / CELLS * sparse
    }

    /// Whether a point is in the box that all points of the sample lie in.
    #[must_use]
    pub fn holds(&self, point: Vec3) -> bool {
        point.cmpge(self.low).all() && point.cmple(self.high).all()
    }
}

fn quantiles(values: &mut [f32]) -> (f32, f32) {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a count"
    )]
    let at = (values.len() as f64 * STRAYS) as usize;
    let last = values.len().saturating_sub(1);
    values.sort_unstable_by(f32::total_cmp);
    let get = |at: usize| values.get(at).copied().unwrap_or_default();
    (get(at), get(last - at.min(last)))
}

/// The thinnest axis of a Gaussian, if it is at most half as thick as wide.
fn normal(scan: &Scan, at: usize) -> Vec3 {
    let scales = scan.scales[at];
    let axes = Mat3::from_quat(scan.rotations[at]);
    let [x, y, z] = scales.to_array();
    let (least, axis) = if x <= y && x <= z {
        (x, axes.x_axis)
    } else if y <= z {
        (y, axes.y_axis)
    } else {
        (z, axes.z_axis)
    };
    let middle = x + y + z - least - scales.max_element();
    if least <= 0.5 * middle {
        axis
    } else {
        Vec3::ZERO
    }
}

/// Opacity times the area of the two larger axes.
fn area(scan: &Scan, at: usize) -> f32 {
    let [a, b, c] = scan.scales[at].to_array();
    scan.opacities[at] * (a * b).max(b * c).max(a * c)
}

/// At most so many of a scan's Gaussians, evenly spread and larger for it: looks the same from afar.
#[must_use]
pub fn thinned(scan: &Scan, most: usize) -> Cow<'_, Scan> {
    let step = scan.len().div_ceil(most.max(1));
    if step < 2 {
        return Cow::Borrowed(scan);
    }
    let keep: Vec<bool> = (0..scan.len()).map(|at| at % step == 0).collect();
    let mut few = scan.filtered(&keep);
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let larger = (step as f32).sqrt();
    few.scales.iter_mut().for_each(|scale| *scale *= larger);
    Cow::Owned(few)
}
