//! A skeleton with the lengths of a person whose landmarks are known in the room.

use super::chain::{body_index, wide};
use super::triangulate::LocatedBody;
use crate::landmarks::BODY_LANDMARKS;
use crate::landmarks::blazepose::{ANKLES, ELBOWS, HIPS, KNEES, SHOULDERS, WRISTS};
use nalgebra::Vector3;
use spmm3::{Joint, Skeleton};

/// Lengths that are measured in fewer frames stay the skeleton's own.
const LEAST_FRAMES: usize = 3;
/// Bones are at least and at most so much of the skeleton's.
const RANGE: (f64, f64) = (0.6, 1.6);

/// Places of landmarks, metres.
pub(super) type Places = [Option<Vector3<f64>>; BODY_LANDMARKS];

/// How long a person's bones are against a skeleton's; `None` of what was not measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Lengths {
    torso: Option<f64>,
    hips: Option<f64>,
    shoulders: Option<f64>,
    thigh: Option<f64>,
    shank: Option<f64>,
    upper_arm: Option<f64>,
    forearm: Option<f64>,
}

impl Lengths {
    /// Measured once more: by the medians over all frames of the distances between landmarks against the same landmarks' on the skeleton as [`Self::shape`]
    /// has it, which `own` has for each frame, in about the same pose.
    pub(super) fn measured(&self, frames: &[LocatedBody], own: &[Places]) -> Self {
        let located: Vec<Places> = (frames.iter())
            .map(|frame| frame.map(|located| located.map(|located| located.place)))
            .collect();
        let whole = self.whole();
        let share = |known: Option<f64>, length: &dyn Fn(&Places) -> Option<f64>| {
            let mut shares: Vec<f64> = (located.iter().zip(own))
                .filter_map(|(located, own)| {
                    let own = length(own).filter(|own| *own > 0.01)?;
                    Some(length(located)? / own)
                })
                .collect();
            shares.sort_by(f64::total_cmp);
            let middle = shares
                .get(shares.len() / 2)
                .filter(|_| shares.len() >= LEAST_FRAMES)?;
            // Of the first skeleton, however often it is measured.
            Some((known.unwrap_or(whole) * middle).clamp(RANGE.0, RANGE.1))
        };
        let between = |known, a: [usize; 2], b: [usize; 2]| {
            share(known, &|places| {
                let side = |side: usize| Some((places[a[side]]? - places[b[side]]?).norm());
                match (side(0), side(1)) {
                    (Some(left), Some(right)) => Some((left + right) / 2.0),
                    (one, other) => one.or(other),
                }
            })
        };
        let apart = |known, pair: [usize; 2]| {
            share(known, &|places| {
                Some((places[pair[0]]? - places[pair[1]]?).norm())
            })
        };
        Self {
            torso: share(self.torso, &|places| {
                let middle = |pair: [usize; 2]| Some((places[pair[0]]? + places[pair[1]]?) / 2.0);
                Some((middle(SHOULDERS)? - middle(HIPS)?).norm())
            }),
            hips: apart(self.hips, HIPS),
            shoulders: apart(self.shoulders, SHOULDERS),
            thigh: between(self.thigh, HIPS, KNEES),
            shank: between(self.shank, KNEES, ANKLES),
            upper_arm: between(self.upper_arm, SHOULDERS, ELBOWS),
            forearm: between(self.forearm, ELBOWS, WRISTS),
        }
    }

    /// What is not measured is as long as the torso, or else the thighs.
    fn whole(&self) -> f64 {
        self.torso.or(self.thigh).unwrap_or(1.0)
    }

    /// `skeleton` with limbs, torso, hips and shoulders of these lengths. Head, hands and feet are scaled as torso and limbs are.
    #[must_use]
    pub(super) fn shape(&self, skeleton: &Skeleton) -> Skeleton {
        use Joint::*;
        let rest = skeleton.rest_positions();
        let whole = self.whole();
        let [hips, shoulders, thigh, shank, upper_arm, forearm] = [
            self.hips,
            self.shoulders,
            self.thigh,
            self.shank,
            self.upper_arm,
            self.forearm,
        ]
        .map(|share| share.unwrap_or(whole));
        let mut positions = *rest;
        for joint in Joint::ALL {
            let Some(parent) = joint.parent() else {
                continue;
            };
            let mut offset = wide(skeleton.rest_offset(joint));
            match joint {
                LeftHip | RightHip => offset *= hips,
                LeftKnee | RightKnee => offset *= thigh,
                LeftAnkle | RightAnkle | LeftFoot | RightFoot => offset *= shank,
                LeftElbow | RightElbow => offset *= upper_arm,
                LeftWrist | RightWrist => offset *= forearm,
                LeftCollar | RightCollar | LeftShoulder | RightShoulder => {
                    offset.x *= shoulders;
                    offset.y *= whole;
                    offset.z *= whole;
                }
                _ if matches!(Joint::ALL[body_index(joint)], LeftWrist | RightWrist) => {
                    offset *= forearm;
                }
                _ => offset *= whole,
            }
            positions[joint.index()] = positions[parent.index()] + narrow(&offset);
        }
        // The legs' length decides how high the pelvis is over the floor.
        let lift = rest[LeftAnkle.index()].y - positions[LeftAnkle.index()].y;
        for position in &mut positions {
            position.y += lift;
        }
        // Shares in range of a skeleton that is one.
        Skeleton::new(positions).unwrap_or_else(|_| skeleton.clone())
    }
}

#[expect(clippy::cast_possible_truncation, reason = "skeletons are f32")]
fn narrow(v: &Vector3<f64>) -> glam::Vec3 {
    glam::Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}
