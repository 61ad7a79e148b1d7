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

/// `skeleton` with limbs, torso, hips and shoulders as long as the person's: by the medians over all frames of the distances between landmarks against
/// the same landmarks' on the skeleton, which `own` has for each frame, in about the same pose. Head, hands and feet are scaled as torso and limbs are.
#[must_use]
pub(super) fn as_long_as(skeleton: &Skeleton, frames: &[LocatedBody], own: &[Places]) -> Skeleton {
    use Joint::*;
    let rest = skeleton.rest_positions();
    let located: Vec<Places> = (frames.iter())
        .map(|frame| frame.map(|located| located.map(|located| located.place)))
        .collect();
    let share = |length: &dyn Fn(&Places) -> Option<f64>| {
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
        Some(middle.clamp(RANGE.0, RANGE.1))
    };
    let between = |a: [usize; 2], b: [usize; 2]| {
        share(&|places| {
            let side = |side: usize| Some((places[a[side]]? - places[b[side]]?).norm());
            match (side(0), side(1)) {
                (Some(left), Some(right)) => Some((left + right) / 2.0),
                (one, other) => one.or(other),
            }
        })
    };
    let apart =
        |pair: [usize; 2]| share(&|places| Some((places[pair[0]]? - places[pair[1]]?).norm()));
    let torso = share(&|places| {
        let middle = |pair: [usize; 2]| Some((places[pair[0]]? + places[pair[1]]?) / 2.0);
        Some((middle(SHOULDERS)? - middle(HIPS)?).norm())
    });
    let (thigh, shank) = (between(HIPS, KNEES), between(KNEES, ANKLES));
    let (upper_arm, forearm) = (between(SHOULDERS, ELBOWS), between(ELBOWS, WRISTS));
    let (hips, shoulders) = (apart(HIPS), apart(SHOULDERS));
    let whole = torso.or(thigh).unwrap_or(1.0);
    let mut positions = *rest;
    for joint in Joint::ALL {
        let Some(parent) = joint.parent() else {
            continue;
        };
        let mut offset = wide(skeleton.rest_offset(joint));
        match joint {
            LeftHip | RightHip => offset *= hips.unwrap_or(whole),
            LeftKnee | RightKnee => offset *= thigh.unwrap_or(whole),
            LeftAnkle | RightAnkle | LeftFoot | RightFoot => offset *= shank.unwrap_or(whole),
            LeftElbow | RightElbow => offset *= upper_arm.unwrap_or(whole),
            LeftWrist | RightWrist => offset *= forearm.unwrap_or(whole),
            LeftCollar | RightCollar | LeftShoulder | RightShoulder => {
                offset.x *= shoulders.unwrap_or(whole);
                offset.y *= whole;
                offset.z *= whole;
            }
            _ if matches!(Joint::ALL[body_index(joint)], LeftWrist | RightWrist) => {
                offset *= forearm.unwrap_or(whole);
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

#[expect(clippy::cast_possible_truncation, reason = "skeletons are f32")]
fn narrow(v: &Vector3<f64>) -> glam::Vec3 {
    glam::Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}
