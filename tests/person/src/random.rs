//! Numbers that look random and are the same on every machine.

use glam::Vec3;
use spmm3::{Joint, MotionParams};

/// A seeded source of numbers (splitmix64), the same on every machine.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// Starts the sequence of `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A whole number below `bound`, which must not be 0.
    pub fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.bits() >> 1).unwrap_or(0) % bound
    }

    /// A number in 0..1.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// A number in -1..1.
    pub fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    /// A roughly normal number with standard deviation 1.
    pub fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.unit()).sum::<f32>() - 6.0
    }

    /// A vector in the cube -1..1.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    /// Motion with every joint bent by up to `reach` radians about each axis, and every expression in play.
    pub fn motion(&mut self, reach: f32) -> MotionParams {
        let mut motion = MotionParams::default();
        for joint in Joint::ALL {
            motion.set_axis_angle(joint, self.vector() * reach);
        }
        for coefficient in motion.expression_mut() {
            *coefficient = self.signed();
        }
        motion.root_translation = self.vector();
        motion
    }
}
