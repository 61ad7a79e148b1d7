//! How each target joint is computed, found once from the two rest poses: the source joint it follows, and the constant `C`
//! (`rest_from_t`) that turns our T-pose into the source's rest pose.

use super::{
    hands::{self, FINGERS, frame},
    names::Parts,
    source::{Pose, Source},
};
use crate::{JOINTS, Joint, Skeleton};
use glam::{Quat, Vec3};

/// With a shank that leans more than this at rest no sole is flat: the ankle is relaxed and the sole leans with the shank.
const STRADDLE: f32 = 0.17;

/// One limb segment: from the first joint to the second, of this body.
pub(super) const LIMBS: [(Joint, Joint); 8] = [
    (Joint::LeftHip, Joint::LeftKnee),
    (Joint::LeftKnee, Joint::LeftAnkle),
    (Joint::RightHip, Joint::RightKnee),
    (Joint::RightKnee, Joint::RightAnkle),
    (Joint::LeftShoulder, Joint::LeftElbow),
    (Joint::LeftElbow, Joint::LeftWrist),
    (Joint::RightShoulder, Joint::RightElbow),
    (Joint::RightElbow, Joint::RightWrist),
];
/// How each target joint is computed, found once from the two rest poses.
pub(super) struct Plan {
    /// `C`: our T-pose to the source's rest pose, per target joint.
    pub(super) rest_from_t: [Quat; JOINTS],
    /// The source joint whose world rotation a target joint takes.
    pub(super) follows: [Option<usize>; JOINTS],
    /// Source joints whose connecting line a limb takes.
    pub(super) spans: [Option<[usize; 2]>; JOINTS],
    pub(super) relaxed: [bool; 2],
    /// How far the upper arms were turned about themselves for the elbow's hinge, left and right.
    hinge_twist: [Quat; 2],
    /// From the source's line from hips to neck, at rest, to ours.
    pub(super) our_from_their_torso: Quat,
}

impl Plan {
    pub(super) fn new(source: &Source<'_>, parts: &Parts, skeleton: &Skeleton) -> Self {
        let mut plan = Self {
            rest_from_t: [Quat::IDENTITY; JOINTS],
            follows: [None; JOINTS],
            spans: [None; JOINTS],
            relaxed: [false; 2],
            hinge_twist: [Quat::IDENTITY; 2],
            our_from_their_torso: Quat::IDENTITY,
        };
        let rest = skeleton.rest_positions();
        let hips = (rest[Joint::LeftHip.index()] + rest[Joint::RightHip.index()]) * 0.5;
        if let (Some(theirs), Some(ours)) = (
            torso(&source.rest, parts),
            (rest[Joint::Neck.index()] - hips).try_normalize(),
        ) {
            plan.our_from_their_torso = Quat::from_rotation_arc(theirs, ours);
        }
        plan.follows[Joint::Pelvis.index()] = Some(parts.pelvis);
        plan.follows[Joint::LeftCollar.index()] = parts.collars[0];
        plan.follows[Joint::RightCollar.index()] = parts.collars[1];
        for joint in Joint::ALL {
            if let Some(named) = parts.named(joint) {
                plan.follows[joint.index()] = Some(named);
            }
        }
        for (from, to) in LIMBS {
            if let (Some(a), Some(b)) = (parts.named(from), parts.named(to)) {
                plan.spans[from.index()] = Some([a, b]);
                // A thigh or an upper arm of two bones: the second carries the twist that the hinge below it needs.
                if matches!(
                    from,
                    Joint::LeftHip | Joint::RightHip | Joint::LeftShoulder | Joint::RightShoulder
                ) {
                    plan.follows[from.index()] = source.bvh.joints[b].parent;
                }
                plan.align(skeleton, from, to, source.rest.along(a, b));
                plan.align_hinge(source, parts, skeleton, from, to);
            }
        }
        for (ankle, foot) in [
            (Joint::LeftAnkle, Joint::LeftFoot),
            (Joint::RightAnkle, Joint::RightFoot),
        ] {
            plan.align_foot(source, parts, skeleton, ankle, foot);
        }
        for (side, wrist) in [(0, Joint::LeftWrist), (1, Joint::RightWrist)] {
            plan.align_hand(source, parts, skeleton, side, wrist);
        }
        plan
    }

    fn set(&mut self, joint: Joint, rest_from_t: Quat) {
        self.rest_from_t[joint.index()] = rest_from_t.normalize();
    }

    /// `C` of a bone: its parent's, and the smallest swing that lays it along the source's bone.
    fn align(
        &mut self,
        skeleton: &Skeleton,
        from: Joint,
        to: Joint,
        source_direction: Option<Vec3>,
    ) {
        let parent = from
            .parent()
            .map_or(Quat::IDENTITY, |p| self.rest_from_t[p.index()]);
        let ours = skeleton.rest_offset(to).try_normalize();
        let swing = match (ours, source_direction) {
            (Some(ours), Some(theirs)) => Quat::from_rotation_arc(parent * ours, theirs),
            _ => Quat::IDENTITY,
        };
        self.set(from, swing * parent);
    }

    /// A mocap skeleton's elbow is often a pure hinge, askew to the rest pose's axes (CMU's by 30 degrees): there the
    /// upper arm is turned about itself so that the hinge becomes ours, the vertical of a palm-down T-pose.
    fn align_hinge(
        &mut self,
        source: &Source<'_>,
        parts: &Parts,
        skeleton: &Skeleton,
        shoulder: Joint,
        elbow: Joint,
    ) {
        let (side, wrist, ours) = match shoulder {
            Joint::LeftShoulder => (0, Joint::LeftWrist, Vec3::NEG_Y),
            Joint::RightShoulder => (1, Joint::RightWrist, Vec3::Y),
            _ => return,
        };
        let (Some(upper), Some(lower), Some(hand)) = (
            self.follows[shoulder.index()],
            parts.named(elbow),
            parts.named(wrist),
        ) else {
            return;
        };
        let along = |a, b| source.rest.along(a, b).unwrap_or(Vec3::ZERO);
        let Some([start, _]) = self.spans[shoulder.index()] else {
            return;
        };
        let (arm, forearm) = (along(start, lower), along(lower, hand));
        let straight = arm.dot(forearm) > 0.985;
        let Some(hinge) = source.hinge(upper, lower).filter(|_| straight) else {
            return;
        };
        let bone = skeleton.rest_offset(elbow);
        let swung = self.rest_from_t[shoulder.index()] * ours;
        if let (Some(theirs), Some(ours)) = (frame(arm, hinge), frame(bone, ours))
            && swung.dot(hinge) > 0.5
        {
            let before = self.rest_from_t[shoulder.index()];
            self.set(shoulder, Quat::from_mat3(&(theirs * ours.transpose())));
            self.hinge_twist[side] = self.rest_from_t[shoulder.index()] * before.conjugate();
        }
    }

    /// Feet stand flat in both rest poses, so only their heading is aligned; the slope from ankle to toe is a matter of
    /// where a rig puts its joints. In a straddle the sole leans with the shank (CMU's rest pose).
    fn align_foot(
        &mut self,
        source: &Source<'_>,
        parts: &Parts,
        skeleton: &Skeleton,
        ankle: Joint,
        foot: Joint,
    ) {
        let knee = ankle.parent().unwrap_or(ankle);
        let lean = {
            let shank = self.spans[knee.index()].and_then(|[a, b]| source.rest.along(a, b));
            let shank = shank.unwrap_or(Vec3::NEG_Y);
            shank.x.atan2(-shank.y)
        };
        let roll = if lean.abs() > STRADDLE {
            Quat::from_rotation_z(lean)
        } else {
            Quat::IDENTITY
        };
        let theirs = self.follows[ankle.index()].and_then(|from| {
            let to = parts.named(foot)?;
            Some(roll.conjugate() * (source.rest.positions[to] - source.rest.positions[from]))
        });
        let heading = |v: Vec3| (v.x.hypot(v.z) > 1e-6).then(|| v.x.atan2(v.z));
        let ours = heading(skeleton.rest_offset(foot));
        // More than a half turn away is a rig whose toes are no guide.
        let yaw = match (ours, theirs.and_then(heading)) {
            (Some(ours), Some(theirs)) if (theirs - ours).abs() < 1.0 => theirs - ours,
            _ => 0.0,
        };
        let rest_from_t = roll * Quat::from_rotation_y(yaw);
        self.set(ankle, rest_from_t);
        self.set(foot, rest_from_t);
    }

    /// Palm by two directions where both hands have fingers; a hand without goes on from the forearm, on the assumption
    /// that both T-poses hold their palms alike.
    fn align_hand(
        &mut self,
        source: &Source<'_>,
        parts: &Parts,
        skeleton: &Skeleton,
        side: usize,
        wrist: Joint,
    ) {
        let fingers = &FINGERS[side * 5..side * 5 + 5];
        let [index, middle, pinky, ring, _] = [0, 1, 2, 3, 4].map(|f| fingers[f][0]);
        let Some(source_wrist) = parts.named(wrist) else {
            self.relaxed[side] = true;
            return;
        };
        let ours = hands::palm(skeleton, side);
        let at = |joint: Joint| parts.named(joint).map(|j| source.rest.positions[j]);
        let theirs = match (at(index), at(middle), at(pinky), at(ring)) {
            (Some(i), Some(m), Some(p), Some(r)) => {
                let palm = (i + m + p + r) * 0.25 - source.rest.positions[source_wrist];
                frame(palm, i - p)
            }
            _ => {
                self.relaxed[side] = true;
                None
            }
        };
        if let (Some(ours), Some(theirs)) = (ours, theirs) {
            self.set(wrist, Quat::from_mat3(&(theirs * ours.transpose())));
        } else {
            let elbow = wrist.parent().unwrap_or(wrist);
            let unswung = self.hinge_twist[side].conjugate() * self.rest_from_t[elbow.index()];
            let ours = ours.map_or(Vec3::ZERO, |palm| unswung * palm.x_axis);
            let theirs = (0..source.bvh.joints.len())
                .find(|j| source.bvh.joints[*j].parent == Some(source_wrist))
                .and_then(|child| source.rest.along(source_wrist, child))
                // A stub of an end bone may point anywhere.
                .filter(|theirs| theirs.dot(ours) > 0.7);
            let swing = theirs.map_or(Quat::IDENTITY, |theirs| {
                Quat::from_rotation_arc(ours, theirs)
            });
            self.set(wrist, swing * unswung);
        }
        for finger in fingers {
            for (k, joint) in finger.iter().enumerate() {
                let direction = parts.named(*joint).and_then(|from| {
                    let to = parts.named(*finger.get(k + 1)?)?;
                    source.rest.along(from, to)
                });
                let child = finger.get(k + 1).copied().unwrap_or(*joint);
                self.align(skeleton, *joint, child, direction);
            }
        }
    }

    pub(super) fn describe(&self, parts: &Parts, notes: &mut Vec<String>) {
        let absent: Vec<_> = LIMBS
            .iter()
            .filter(|(from, _)| self.spans[from.index()].is_none())
            .map(|(from, _)| from.name())
            .collect();
        if !absent.is_empty() {
            notes.push(format!(
                "not in the file, left at rest: {}",
                absent.join(", ")
            ));
        }
        if self.relaxed.contains(&true) {
            notes.push(if parts.mitten_hands {
                "the hands are mittens without finger data: the fingers are at ease".to_owned()
            } else {
                "no finger data: the fingers are at ease".to_owned()
            });
        }
    }
}

/// Direction from the middle of the hips to the lowest neck bone, or to the head of a rig without neck.
pub(super) fn torso(pose: &Pose, parts: &Parts) -> Option<Vec3> {
    let at = |joint: usize| pose.positions[joint];
    let hips = (at(parts.named(Joint::LeftHip)?) + at(parts.named(Joint::RightHip)?)) * 0.5;
    let neck = parts.neck.first().copied().or(parts.named(Joint::Head))?;
    (at(neck) - hips).try_normalize()
}
