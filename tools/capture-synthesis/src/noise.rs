//! Errors put into what a capture says of itself, as calibration and tracking leave them; the pictures stay true.

use crate::lens::Lens;
use fastrand::Rng;
use glam::{DAffine3, DQuat, DVec3, Quat, Vec3};
use spmm3::{Joint, MotionParams};
use std::f64::consts::TAU;

/// How far the pelvis is put off for each degree of the joints' errors, metres.
const PELVIS_METRES_A_DEGREE: f64 = 0.003;

/// Standard deviations of the errors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Noise {
    /// Of a camera's position along each axis, millimetres, and, by its turning about each axis, of where it sees the ring's middle.
    pub calibration_mm: f64,
    /// Of a joint's rotation about each axis, degrees; the pelvis is put off by 3 mm for each degree.
    pub pose_degrees: f64,
    /// Of the random numbers.
    pub seed: u64,
}

/// Normally distributed with a standard deviation of 1 (Box and Muller, 1958), along three axes.
fn normal(rng: &mut Rng) -> DVec3 {
    let mut one = || (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos();
    DVec3::new(one(), one(), one())
}

impl Noise {
    /// A camera at `distance` (metres) from what it looks at, as a calibration with these errors has it; `number` tells cameras apart.
    #[must_use]
    pub fn camera(&self, lens: &Lens, distance: f64, number: u64) -> Lens {
        if self.calibration_mm <= 0.0 {
            return *lens;
        }
        let mut rng = self.generator(1, number);
        let deviation = self.calibration_mm * 1e-3;
        let eye = lens.eye() + normal(&mut rng) * deviation;
        let turn = DQuat::from_scaled_axis(normal(&mut rng) * (deviation / distance.max(1e-3)));
        let rotation = glam::DMat3::from_quat(turn) * lens.camera_from_world.matrix3;
        Lens {
            camera_from_world: DAffine3 {
                matrix3: rotation,
                translation: -(rotation * eye),
            },
            ..*lens
        }
    }

    /// A pose and the pelvis' place (metres) as tracking with these errors has them; `number` tells frames apart.
    #[must_use]
    pub fn pose(&self, motion: &MotionParams, pelvis: Vec3, number: u64) -> (MotionParams, Vec3) {
        let mut noisy = motion.clone();
        if self.pose_degrees <= 0.0 {
            return (noisy, pelvis);
        }
        let mut rng = self.generator(2, number);
        for joint in Joint::ALL {
            let error = normal(&mut rng) * self.pose_degrees.to_radians();
            let turned = motion.rotation(joint) * Quat::from_scaled_axis(error.as_vec3());
            noisy.set_rotation(joint, turned);
        }
        let shift = normal(&mut rng) * (self.pose_degrees * PELVIS_METRES_A_DEGREE);
        (noisy, pelvis + shift.as_vec3())
    }

    /// A generator of its own for every camera and frame, so that one more of them leaves the others as they are.
    fn generator(&self, kind: u64, number: u64) -> Rng {
        let mixed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (kind << 56) ^ number;
        Rng::with_seed(mixed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_the_size_that_was_asked_for_and_none_when_none_was() {
        let lens = Lens::look_at(
            DVec3::new(0.0, 1.0, 3.0),
            DVec3::Y,
            DVec3::Y,
            500.0,
            [64; 2],
        );
        let none = Noise::default();
        assert_eq!(none.camera(&lens, 3.0, 4), lens, "no error was asked for");
        let noise = Noise {
            calibration_mm: 5.0,
            pose_degrees: 2.0,
            seed: 3,
        };
        let (mut places, mut turns, mut joints) = (0.0, 0.0, 0.0);
        let count = 400u64;
        for number in 0..count {
            let noisy = noise.camera(&lens, 3.0, number);
            places += (noisy.eye() - lens.eye()).length_squared();
            let turned = noisy.camera_from_world.matrix3 * lens.camera_from_world.matrix3.inverse();
            let cosine = (turned.to_cols_array_2d()[0][0]
                + turned.to_cols_array_2d()[1][1]
                + turned.to_cols_array_2d()[2][2]
                - 1.0)
                / 2.0;
            turns += cosine.clamp(-1.0, 1.0).acos().powi(2);
            let (pose, _) = noise.pose(&MotionParams::default(), Vec3::ZERO, number);
            joints += f64::from(pose.axis_angle(Joint::LeftElbow).length_squared());
        }
        // Three axes each.
        let deviation = |sum: f64| (sum / (3 * count) as f64).sqrt();
        assert!(
            (deviation(places) / 5e-3 - 1.0).abs() < 0.1,
            "{}",
            deviation(places)
        );
        assert!(
            (deviation(turns) / (5e-3 / 3.0) - 1.0).abs() < 0.1,
            "{}",
            deviation(turns)
        );
        let degrees = deviation(joints).to_degrees();
        assert!((degrees / 2.0 - 1.0).abs() < 0.1, "{degrees} degrees");
    }
}
