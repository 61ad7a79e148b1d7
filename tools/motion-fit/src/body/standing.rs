//! The avatar's body as it stands, for a person's lengths and the floor to be compared with.

use super::{
    bindings,
    chain::{Chain, Posture},
    proportions::{LIMBS, PARTS, SHANK, THIGH, TORSO, part_lengths},
    soles::soles,
};
use crate::landmarks::blazepose::{ANKLES, HIPS, SHOULDERS};
use nalgebra::Vector3;
use spmm3::Skeleton;

/// A camera and a person.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Up, in the camera's axes with y up and z towards the camera; of length 1.
    pub up: Vector3<f64>,
    /// Height of the camera above the floor, metres of the avatar's size.
    pub height_metres: f64,
    /// Lengths of the body's parts, in the network's metres: thigh, shank, upper arm, forearm, torso; zero for one that was not seen.
    pub lengths: [f64; 5],
}

impl Calibration {
    /// How far the camera looks down, radians.
    #[must_use]
    pub fn pitch_radians(&self) -> f64 {
        self.up.z.clamp(-1.0, 1.0).asin()
    }

    /// How far the camera is rolled, radians, clockwise as seen from behind it.
    #[must_use]
    pub fn roll_radians(&self) -> f64 {
        (-self.up.x).atan2(self.up.y)
    }
}

/// Lengths of the avatar, and how far below its ankles its soles are.
#[derive(Debug, Clone)]
pub(crate) struct StandingBody {
    lengths: [f64; PARTS],
    /// From the ankles' landmarks down to the soles, metres.
    ankles: f64,
}

impl StandingBody {
    pub(crate) fn of(skeleton: &Skeleton) -> Self {
        let bindings = bindings::bind(skeleton);
        let placed = Chain::new(skeleton).place(&Posture::default());
        let lowest = (soles(skeleton).iter())
            .map(|sole| placed.point(sole).y)
            .fold(f64::INFINITY, f64::min);
        let ankles: Vec<f64> = (bindings.iter())
            .filter(|binding| ANKLES.contains(&binding.landmark))
            .map(|binding| placed.point(&binding.at).y)
            .collect();
        let mean = ankles.iter().sum::<f64>() / ankles.len().max(1) as f64;
        Self {
            lengths: part_lengths(&placed, &bindings),
            ankles: if lowest.is_finite() {
                mean - lowest
            } else {
                0.0
            },
        }
    }

    /// A person's lengths, of which each landmark is at `metres`; zero where one is missing.
    pub(crate) fn lengths(&self, metres: impl Fn(usize) -> Option<Vector3<f64>>) -> [f64; PARTS] {
        let mut lengths = [0.0; PARTS];
        for (part, inner, outer) in LIMBS {
            let sides =
                [0, 1].map(|side| Some((metres(outer[side])? - metres(inner[side])?).norm()));
            let seen: Vec<f64> = sides.into_iter().flatten().collect();
            lengths[part] = seen.iter().sum::<f64>() / seen.len().max(1) as f64;
        }
        let middle = |pair: [usize; 2]| Some((metres(pair[0])? + metres(pair[1])?) / 2.0);
        if let (Some(shoulders), Some(hips)) = (middle(SHOULDERS), middle(HIPS)) {
            lengths[TORSO] = (shoulders - hips).norm();
        }
        lengths
    }

    /// Avatar's metres per metre of the network, by the legs.
    pub(crate) fn scale(&self, lengths: &[f64; PARTS]) -> Option<f64> {
        let legs = lengths[THIGH] + lengths[SHANK];
        let scale = (self.lengths[THIGH] + self.lengths[SHANK]) / legs;
        (0.3..3.0).contains(&scale).then_some(scale)
    }

    /// How high the soles are along `up`, from where the landmarks' metres begin; avatar's metres, `scale` of them per metre.
    pub(crate) fn soles(
        &self,
        scale: f64,
        metres: impl Fn(usize) -> Option<Vector3<f64>>,
        up: &Vector3<f64>,
    ) -> Option<f64> {
        let [left, right] = ANKLES.map(metres);
        Some(scale * (left? + right?).dot(up) / 2.0 - self.ankles)
    }
}
