//! The person's proportions: how long bones are against the avatar's.
//!
//! The network's metres are of a person of its own imagination, and a camera tells no size: the legs are taken to be as long as the avatar's, so
//! that steps and the floor fit. What bones measure against that, averaged, shapes the skeleton that is fitted; its rotations are the
//! avatar's.

use super::{
    bindings::Binding,
    chain::{Chain, Placed, Posture},
    reading::Reading,
};
use crate::landmarks::blazepose::{ANKLES, ELBOWS, HIPS, KNEES, SHOULDERS, WRISTS};
use nalgebra::Vector3;
use spmm3::Joint;

/// Memory of lengths, seconds of sight.
const MEMORY: f64 = 20.0;
/// The avatar's own proportions count as much as so long a look, seconds.
const OWN: f64 = 5.0;
/// What the landmarks' errors in depth add to the square of a length, square metres.
const NOISE: f64 = 0.005;
/// Bones are at least and at most so much of the avatar's.
const RANGE: (f64, f64) = (0.8, 1.25);
/// Legs seen for so long alone tell the size, seconds.
const LEGS_SEEN: f64 = 0.5;

/// What is measured.
pub(super) const PARTS: usize = 5;
pub(super) const THIGH: usize = 0;
pub(super) const SHANK: usize = 1;
const UPPER_ARM: usize = 2;
const FOREARM: usize = 3;
pub(super) const TORSO: usize = 4;

/// The pairs of landmarks of each limb's part, from the trunk outwards.
pub(super) const LIMBS: [(usize, [usize; 2], [usize; 2]); 4] = [
    (THIGH, HIPS, KNEES),
    (SHANK, KNEES, ANKLES),
    (UPPER_ARM, SHOULDERS, ELBOWS),
    (FOREARM, ELBOWS, WRISTS),
];

/// Mean lengths and what they are compared with.
#[derive(Debug, Clone)]
pub(super) struct Proportions {
    avatar: Chain,
    /// The avatar's lengths between landmarks, metres.
    lengths: [f64; PARTS],
    /// Seconds of sight, and mean squares of lengths in the network's metres.
    seen: [(f64, f64); PARTS],
    /// Whether they are known, and no longer follow.
    is_held: bool,
}

/// Lengths of the avatar's parts between landmarks, metres.
pub(super) fn part_lengths(placed: &Placed, bindings: &[Binding]) -> [f64; PARTS] {
    let at = |landmark: usize| {
        bindings
            .iter()
            .find(|b| b.landmark == landmark)
            .map_or(Vector3::zeros(), |b| placed.point(&b.at))
    };
    let middle = |pair: [usize; 2]| (at(pair[0]) + at(pair[1])) / 2.0;
    let mut lengths = [0.0; PARTS];
    for (part, inner, outer) in LIMBS {
        lengths[part] = (at(outer[0]) - at(inner[0])).norm();
    }
    lengths[TORSO] = (middle(SHOULDERS) - middle(HIPS)).norm();
    lengths.map(|l| l.max(0.01))
}

impl Proportions {
    pub(super) fn new(avatar: Chain, bindings: &[Binding]) -> Self {
        let lengths = part_lengths(&avatar.place(&Posture::default()), bindings);
        Self {
            avatar,
            lengths,
            seen: [(0.0, 0.0); PARTS],
            is_held: false,
        }
    }

    /// The avatar's own bones.
    pub(super) fn avatar(&self) -> &Chain {
        &self.avatar
    }

    /// Takes these lengths (the network's metres) for known, and follows no more; parts of length zero stay as they are.
    pub(super) fn hold(&mut self, lengths: &[f64; PARTS]) {
        self.is_held = true;
        for (seen, length) in self.seen.iter_mut().zip(lengths) {
            if *length > 0.0 {
                *seen = (MEMORY, length * length + NOISE);
            }
        }
    }

    /// Takes one picture's lengths.
    pub(super) fn measure(&mut self, step: f64, reading: &Reading) {
        if self.is_held {
            return;
        }
        for (part, inner, outer) in LIMBS {
            for (inner, outer) in inner.into_iter().zip(outer) {
                let [inner, outer] = [inner, outer].map(|p| &reading.points[p]);
                let sure = inner.confidence * outer.confidence;
                if sure > 0.25 {
                    let length = (outer.metres - inner.metres).norm();
                    self.take(part, step * sure / 2.0, length);
                }
            }
        }
        if reading.both(SHOULDERS, 0.5) && reading.both(HIPS, 0.5) {
            let length = (reading.middle(SHOULDERS) - reading.middle(HIPS)).norm();
            self.take(TORSO, step, length);
        }
    }

    fn take(&mut self, part: usize, weight: f64, length: f64) {
        let (seconds, mean) = &mut self.seen[part];
        *seconds = (*seconds + weight).min(MEMORY);
        *mean += (length * length - *mean) * (weight / *seconds);
    }

    /// Mean length of a part, the network's metres, without what its errors add.
    fn length(&self, part: usize) -> f64 {
        let (_, square) = self.seen[part];
        (square - NOISE).max(square / 4.0).sqrt()
    }

    /// Avatar's metres per metre of the network.
    pub(super) fn scale(&self) -> f64 {
        let legs = self.seen[THIGH].0.min(self.seen[SHANK].0) > LEGS_SEEN;
        let mut sums = [0.0; 2];
        for (part, ((seconds, _), length)) in self.seen.iter().zip(self.lengths).enumerate() {
            if !legs || part == THIGH || part == SHANK {
                let weight = if legs { 1.0 } else { *seconds };
                sums[0] += weight * length;
                sums[1] += weight * self.length(part);
            }
        }
        if sums[1] > 1e-6 {
            (sums[0] / sums[1]).clamp(0.3, 3.0)
        } else {
            1.0
        }
    }

    /// Shapes `chain`, a copy of the avatar's, as the person is.
    pub(super) fn shape(&self, chain: &mut Chain) {
        let scale = self.scale();
        let ratio = |part: usize| {
            let seconds = self.seen[part].0;
            let ratio = self.length(part) * scale / self.lengths[part];
            ((ratio * seconds + OWN) / (seconds + OWN)).clamp(RANGE.0, RANGE.1)
        };
        use Joint::*;
        let parts: [(usize, &[Joint]); PARTS] = [
            (THIGH, &[LeftKnee, RightKnee]),
            (SHANK, &[LeftAnkle, RightAnkle]),
            (UPPER_ARM, &[LeftElbow, RightElbow]),
            (FOREARM, &[LeftWrist, RightWrist]),
            (
                TORSO,
                &[Spine1, Spine2, Spine3, LeftCollar, RightCollar, Neck],
            ),
        ];
        for (part, joints) in parts {
            let ratio = ratio(part);
            for joint in joints {
                chain.offsets[joint.index()] = self.avatar.offsets[joint.index()] * ratio;
            }
        }
    }
}
