//! What a scan shows besides the person.

use crate::scan::Scan;
use glam::{Quat, Vec3};

/// What stands around a person in a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Surroundings {
    /// Nothing.
    #[default]
    None,
    /// A floor, a box, a pole, and what trainings leave in the air.
    Room,
}

impl Surroundings {
    /// Adds them to a scan of one person at the origin, metres.
    pub fn add(self, scan: &mut Scan, seed: u64) {
        if self == Self::None {
            return;
        }
        let mut rng = fastrand::Rng::with_seed(seed ^ 0x5bd1_e995);
        let mut put = |at: Vec3, scales: Vec3, opacity: f32, colour: Vec3| {
            scan.positions.push(at);
            scan.rotations.push(Quat::IDENTITY);
            scan.scales.push(scales);
            scan.opacities.push(opacity);
            scan.colours.push(colour);
        };
        // A floor disc of 1.4 m.
        for k in 0..6000u16 {
            let share = (f32::from(k) + 0.5) / 6000.0;
            let (radius, angle) = (1.4 * share.sqrt(), f32::from(k) * 2.399_963);
            let at = Vec3::new(radius * angle.cos(), -0.004, radius * angle.sin());
            let grey = 0.45 + 0.1 * rng.f32();
            put(at, Vec3::new(0.014, 0.003, 0.014), 0.95, Vec3::splat(grey));
        }
        // A box beside the person, and a pole behind.
        for _ in 0..2500 {
            let mut at = Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5);
            let face = rng.usize(0..3);
            at[face] = if rng.bool() { 0.5 } else { -0.5 };
            let at = Vec3::new(1.15, 0.25, -0.6) + at * Vec3::new(0.4, 0.5, 0.4);
            put(at, Vec3::splat(0.012), 0.9, Vec3::new(0.5, 0.35, 0.2));
        }
        for _ in 0..1200 {
            let angle = rng.f32() * std::f32::consts::TAU;
            let at = Vec3::new(
                -0.9 + 0.03 * angle.cos(),
                2.0 * rng.f32(),
                -0.9 + 0.03 * angle.sin(),
            );
            put(at, Vec3::splat(0.01), 0.9, Vec3::splat(0.15));
        }
        // Floaters, large and thin.
        for _ in 0..150 {
            let at = Vec3::new(
                3.0 * (rng.f32() - 0.5),
                2.6 * rng.f32(),
                3.0 * (rng.f32() - 0.5),
            );
            let size = 0.02 + 0.1 * rng.f32() * rng.f32();
            let colour = Vec3::splat(0.3 + 0.5 * rng.f32());
            put(at, Vec3::splat(size), 0.03 + 0.1 * rng.f32(), colour);
        }
    }
}
