//! Gaussians that the shell adds, before they are joined to the scan's.

use super::cells::Cell;
use crate::scan::Scan;
use glam::{DVec3, Vec3};

/// Gaussians and the triangles that carry them, one entry each in both.
#[derive(Debug, Clone, Default)]
pub(crate) struct Additions {
    pub(crate) scan: Scan,
    pub(crate) triangles: Vec<u32>,
}

impl Additions {
    /// Adds a cell, moved along its normal by `lift` metres.
    pub(crate) fn push(&mut self, cell: &Cell, lift: f64, colour: DVec3, opacity: f32) {
        let point = cell.point + cell.normal * lift;
        // Before the clamp, which makes black of what is no number.
        if !point.is_finite() || !colour.is_finite() {
            debug_assert!(false, "a cell at {point} of colour {colour}");
            return;
        }
        let colour = colour.clamp(DVec3::ZERO, DVec3::ONE);
        self.scan.positions.push(point.as_vec3());
        self.scan.rotations.push(cell.rotation);
        self.scan.scales.push(cell.deviations.as_vec3());
        self.scan.opacities.push(opacity);
        self.scan.colours.push(colour.as_vec3());
        self.triangles.push(cell.triangle);
    }

    /// Appends others.
    pub(crate) fn append(&mut self, other: Self) {
        self.scan.append(other.scan);
        self.triangles.extend(other.triangles);
    }

    /// How many there are.
    #[must_use]
    pub(crate) fn len(&self) -> usize {
        self.triangles.len()
    }
}

/// The share of `value` between `low` and `high`, 0..=1, with smooth ends.
#[must_use]
pub(crate) fn smoothstep(low: f64, high: f64, value: f64) -> f64 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The mean of some colours at each channel's middle: half of the values are darker. Black if there is none.
#[must_use]
pub(crate) fn median(colours: &[Vec3]) -> DVec3 {
    let channel = |pick: fn(&Vec3) -> f32| {
        let mut values: Vec<f32> = colours.iter().map(pick).filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f32::total_cmp);
        f64::from(values.get(values.len() / 2).copied().unwrap_or_default())
    };
    DVec3::new(channel(|c| c.x), channel(|c| c.y), channel(|c| c.z))
}

/// How bright a display colour is, 0..=1 (the weights of Rec. 709).
#[must_use]
pub(crate) fn brightness(colour: DVec3) -> f64 {
    colour.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}
