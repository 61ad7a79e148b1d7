//! Views from all sides of a person, and the depths in them.

use super::raster::Picture;
use crate::pinhole::Pinhole;
use crate::scan::Scan;
use glam::{DVec3, Vec3};
use std::f64::consts::TAU;

/// Rows of views: their elevations, radians, and by how much of a step their azimuths are turned.
const ELEVATIONS: [(f64, f64); 3] = [(-0.35, 0.5), (0.05, 0.0), (0.45, 0.5)];
/// Views at one elevation.
const AROUND: usize = 10;
/// Distance from the person, as a share of the person's height.
const DISTANCE: f64 = 1.83;
/// Pixels for a person's height, and the share of the picture that it takes.
const PERSON: f64 = 492.0;
/// Share of the height that the head has, distance of its views as a share of the height, and pixels for it.
const HEADS_SHARE: f64 = 0.15;
const HEAD_DISTANCE: f64 = 0.7;
const HEAD_PIXELS: f64 = 260.0;
/// The most that a picture is wide or high, pixels.
const MOST: f64 = 1200.0;

/// A view of the scan and the depths that were seen in it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DepthView {
    /// The view.
    view: Pinhole,
    /// Distance along the camera's axis at which half of the light is gone, metres, row by row from the top; infinite where more than
    /// half comes through.
    depth: Vec<f32>,
}

impl DepthView {
    /// Takes the depths of a picture.
    #[must_use]
    pub(crate) fn new(view: Pinhole, picture: Picture) -> Self {
        Self {
            view,
            depth: picture.depth,
        }
    }

    /// The depth in the pixel in which a point is, metres, infinite where the view shows nothing; and the point's own depth. Nothing if
    /// the point is not in the picture.
    #[must_use]
    pub(crate) fn depth_at(&self, point: DVec3) -> Option<(f32, f32)> {
        let pixel = self.view.pixel(point)?;
        #[expect(clippy::cast_possible_truncation, reason = "metres")]
        let own = self.view.camera_point(point).z as f32;
        Some((*self.depth.get(pixel)?, own))
    }
}

/// Thirty views at three elevations that show all of a scan in some 500 pixels of height.
#[must_use]
pub(crate) fn around(scan: &Scan) -> Vec<Pinhole> {
    let (low, high) = robust_box(scan);
    let height = (high.y - low.y).max(0.1);
    let target = DVec3::new(
        (low.x + high.x) / 2.0,
        low.y + height * 0.514,
        (low.z + high.z) / 2.0,
    );
    let distance = DISTANCE * height;
    let focal = PERSON / height * distance;
    // Whatever the azimuth, both the height and the farthest sideways fit, with a margin for what is nearer than the axis.
    let radius = (high.x - low.x).hypot(high.z - low.z) / 2.0;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between the bounds"
    )]
    let pixels = |metres: f64, least: f64| (metres * PERSON / height).clamp(least, MOST) as u32;
    let width = pixels(2.0 * radius * 1.3 + 0.06 * height, 200.0);
    let tall = pixels(height * 1.22, 200.0);
    let mut views = Vec::with_capacity(ELEVATIONS.len() * AROUND);
    for (elevation, shift) in ELEVATIONS {
        for at in 0..AROUND {
            let azimuth = TAU * (at as f64 + shift) / AROUND as f64;
            let (sin, cos) = elevation.sin_cos();
            let eye = target + distance * DVec3::new(azimuth.sin() * cos, sin, azimuth.cos() * cos);
            views.push(Pinhole::look_at(eye, target, DVec3::Y, focal, width, tall));
        }
    }
    views
}

/// Closer views of a standing person's head, where Gaussians are small, and for each Gaussian whether it is there.
#[must_use]
pub(super) fn close_ups(scan: &Scan) -> (Vec<Pinhole>, Vec<bool>) {
    let (low, high) = robust_box(scan);
    let height = (high.y - low.y).max(0.1);
    let from = high.y - HEADS_SHARE * height;
    let of_head: Vec<bool> = scan
        .positions
        .iter()
        .map(|p| p.is_finite() && f64::from(p.y) > from)
        .collect();
    let top = scan.positions.iter().zip(&of_head).filter(|(_, of)| **of);
    let (sum, count) = top.fold((DVec3::ZERO, 0.0), |(sum, count), (p, _)| {
        (sum + p.as_dvec3(), count + 1.0)
    });
    if count == 0.0 {
        return (Vec::new(), of_head);
    }
    let target = DVec3::new(
        sum.x / count,
        high.y - HEADS_SHARE / 2.0 * height,
        sum.z / count,
    );
    let distance = HEAD_DISTANCE * height;
    let focal = HEAD_PIXELS / (HEADS_SHARE * height) * distance;
    let views = (0..AROUND).map(|at| {
        let azimuth = TAU * at as f64 / AROUND as f64;
        // Level and from above in turns.
        let elevation: f64 = if at % 2 == 0 { 0.0 } else { 0.4 };
        let (sin, cos) = elevation.sin_cos();
        let eye = target + distance * DVec3::new(azimuth.sin() * cos, sin, azimuth.cos() * cos);
        Pinhole::look_at(eye, target, DVec3::Y, focal, 320, 320)
    });
    (views.collect(), of_head)
}

/// The box of all but the outermost thousandth of the Gaussians on each side.
fn robust_box(scan: &Scan) -> (DVec3, DVec3) {
    let side = |axis: usize| {
        let mut values: Vec<f32> = scan
            .positions
            .iter()
            .map(|p| p[axis])
            .filter(|v| v.is_finite())
            .collect();
        values.sort_unstable_by(f32::total_cmp);
        let skip = values.len() / 1000;
        let low = values.get(skip).copied().unwrap_or(0.0);
        let high = values
            .len()
            .checked_sub(skip + 1)
            .map_or(0.0, |at| values[at]);
        (low, high)
    };
    let (x, y, z) = (side(0), side(1), side(2));
    (
        Vec3::new(x.0, y.0, z.0).as_dvec3(),
        Vec3::new(x.1, y.1, z.1).as_dvec3(),
    )
}
