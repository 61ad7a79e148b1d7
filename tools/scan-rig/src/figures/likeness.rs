//! How like two sets of Gaussians look.

use crate::pinhole::Pinhole;
use crate::scan::Scan;
use crate::surface::raster;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A pixel with more opacity than this in either picture is part of the person.
const PERSON: f32 = 0.5;

/// Peak signal-to-noise ratio over the person in each of some views, dB: over the pixels that either scan covers, before white.
/// Infinite where both are the same.
#[must_use]
pub fn person_psnr(a: &Scan, b: &Scan, views: &[Pinhole]) -> Vec<f64> {
    views
        .par_iter()
        .map(|view| {
            let (first, second) = (raster::draw(a, view), raster::draw(b, view));
            let (over_a, over_b) = (first.over(Vec3::ONE), second.over(Vec3::ONE));
            let mut error = 0.0;
            let mut count = 0.0;
            for at in 0..over_a.len() {
                let clear = first.transmittance[at].min(second.transmittance[at]);
                if clear < 1.0 - PERSON {
                    let display = |c: Vec3| c.clamp(Vec3::ZERO, Vec3::ONE).as_dvec3();
                    error += (display(over_a[at]) - display(over_b[at])).length_squared();
                    count += 3.0;
                }
            }
            if error > 0.0 {
                -10.0 * (error / count).log10()
            } else {
                f64::INFINITY
            }
        })
        .collect()
}

/// Six views around a person who stands at the origin and is `height` metres high, 420 by 640 pixels.
#[must_use]
pub fn six_views(height: f64) -> Vec<Pinhole> {
    let target = DVec3::new(0.0, height * 0.514, 0.0);
    (0..6)
        .map(|at| {
            let azimuth = TAU * f64::from(at) / 6.0;
            let away = 1.94 * height * DVec3::new(azimuth.sin(), 0.08, azimuth.cos());
            Pinhole::look_at(target + away, target, DVec3::Y, 1000.0, 420, 640)
        })
        .collect()
}
