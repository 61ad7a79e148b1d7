//! Another body's motion on this body.
//!
//! A BVH's rest frames are all aligned with the file's axes, as SMPL-X's are, but its rest pose differs: an A-pose, a
//! T-pose with straddled legs. For each target joint a constant `C` turns our T-pose into the file's rest pose, and the
//! joint's world rotation is the source's world rotation times `C`. Limbs get `C` by aligning each bone after its
//! parent's (no twist of their own), and each frame a last swing puts the bone along the line between the source's
//! joints, so that chains of many bones arrive whole. Torso, head, collars and face take `C` = identity: their joints
//! sit at other places in every rig, but both rest poses stand upright and look ahead.

use super::{
    LoadOptions, MotionClip, MotionError,
    bvh::Bvh,
    ground::{self, Height},
    names::{Parts, summarise},
};
use crate::{JOINTS, Joint, MotionParams, Skeleton};
use glam::{Mat3, Quat, Vec3};

/// Metres per unit that files use, with their names.
const UNITS: [(f32, &str); 6] = [
    (1.0, "metres"),
    (0.1, "decimetres"),
    (0.01, "centimetres"),
    (0.001, "millimetres"),
    (0.0254, "inches"),
    (0.3048, "feet"),
];
/// Curl of each finger joint, radians, when the file says nothing about fingers: a hand at ease.
const RELAXED_CURL: f32 = 0.30;
/// Beyond this lean of a shank at rest nobody's sole stays flat: the ankle is at ease and the sole leans with it.
const STRADDLE: f32 = 0.17;

/// One limb segment: from the first joint to the second, of this body.
const LIMBS: [(Joint, Joint); 8] = [
    (Joint::LeftHip, Joint::LeftKnee),
    (Joint::LeftKnee, Joint::LeftAnkle),
    (Joint::RightHip, Joint::RightKnee),
    (Joint::RightKnee, Joint::RightAnkle),
    (Joint::LeftShoulder, Joint::LeftElbow),
    (Joint::LeftElbow, Joint::LeftWrist),
    (Joint::RightShoulder, Joint::RightElbow),
    (Joint::RightElbow, Joint::RightWrist),
];

/// Fingers of a hand as (first joint, second, third), left then right.
pub(super) const FINGERS: [[Joint; 3]; 10] = {
    use Joint::*;
    [
        [LeftIndex1, LeftIndex2, LeftIndex3],
        [LeftMiddle1, LeftMiddle2, LeftMiddle3],
        [LeftPinky1, LeftPinky2, LeftPinky3],
        [LeftRing1, LeftRing2, LeftRing3],
        [LeftThumb1, LeftThumb2, LeftThumb3],
        [RightIndex1, RightIndex2, RightIndex3],
        [RightMiddle1, RightMiddle2, RightMiddle3],
        [RightPinky1, RightPinky2, RightPinky3],
        [RightRing1, RightRing2, RightRing3],
        [RightThumb1, RightThumb2, RightThumb3],
    ]
};

/// Retargets a whole file.
pub(super) fn retarget(
    bvh: &Bvh,
    skeleton: &Skeleton,
    options: &LoadOptions,
) -> Result<MotionClip, MotionError> {
    let parts = Parts::find(&bvh.joints)?;
    let source = Source::new(bvh, &parts)?;
    let plan = Plan::new(&source, &parts, skeleton);
    let mut notes = Vec::new();
    let travel = source.travel(skeleton, options, &mut notes)?;
    notes.push(source.axes_note.clone());
    plan.describe(&parts, &mut notes);
    let mut frames: Vec<MotionParams> = (0..bvh.frames())
        .map(|frame| plan.frame(&source.pose(frame), &parts, skeleton, travel))
        .collect();
    let height = if bvh.travels() || bvh.frames() == 1 {
        Height::Travels
    } else {
        notes.push(
            "the root never moves: each frame is stood on its lowest sole, on the spot".to_owned(),
        );
        Height::Unknown
    };
    ground::stand(&mut frames, bvh.frame_seconds, skeleton, height);
    if let Some(at) = frames.iter().position(|frame| !frame.is_finite()) {
        return Err(MotionError::bvh(
            0,
            format!(
                "frame {at} gives numbers that are not finite; its values are far out of range"
            ),
        ));
    }
    Ok(MotionClip {
        name: String::new(),
        frames,
        frame_seconds: bvh.frame_seconds,
        notes,
    })
}

/// Joint frames of the source body in our axes (person's left +x, up +y, forward +z), still in file units.
struct Pose {
    positions: Vec<Vec3>,
    rotations: Vec<Quat>,
}

impl Pose {
    fn along(&self, from: usize, to: usize) -> Option<Vec3> {
        (self.positions[to] - self.positions[from]).try_normalize()
    }
}

/// The source body at rest, and its frames.
struct Source<'a> {
    bvh: &'a Bvh,
    our_from_file: Quat,
    rest: Pose,
    leg: f32,
    axes_note: String,
}

impl<'a> Source<'a> {
    fn new(bvh: &'a Bvh, parts: &Parts) -> Result<Self, MotionError> {
        let lost = |what: &str| MotionError::Skeleton {
            missing: what.to_owned(),
            found: "joints that lie on each other".to_owned(),
        };
        let need = |joint: Joint| parts.named(joint).ok_or_else(|| lost(joint.name()));
        let hips = [need(Joint::LeftHip)?, need(Joint::RightHip)?];
        let knees = [need(Joint::LeftKnee)?, need(Joint::RightKnee)?];
        let ankles = [need(Joint::LeftAnkle)?, need(Joint::RightAnkle)?];
        let head = need(Joint::Head)?;
        let mut source = Self {
            bvh,
            our_from_file: Quat::IDENTITY,
            rest: Pose {
                positions: Vec::new(),
                rotations: Vec::new(),
            },
            leg: 0.0,
            axes_note: String::new(),
        };
        let file = source.at_rest();
        let at = |joint: usize| file.positions[joint];
        let feet = (at(ankles[0]) + at(ankles[1])) * 0.5;
        let up = nearest_axis(at(head) - feet, None).ok_or_else(|| lost("upright rest pose"))?;
        let left = nearest_axis(at(hips[0]) - at(hips[1]), Some(up))
            .ok_or_else(|| lost("distance between the hips"))?;
        let forward = left.cross(up);
        let file_from_our = Mat3::from_cols(left, up, forward);
        source.our_from_file = Quat::from_mat3(&file_from_our).conjugate();
        source.axes_note = format!(
            "axes: up is {}, the rest pose faces {}; turned to y up, facing z",
            axis_name(up),
            axis_name(forward)
        );
        source.rest = source.at_rest();
        let length = |side: usize| {
            let at = |joint: usize| source.rest.positions[joint];
            at(hips[side]).distance(at(knees[side])) + at(knees[side]).distance(at(ankles[side]))
        };
        source.leg = (length(0) + length(1)) * 0.5;
        if source.leg.is_finite() && source.leg > 1e-6 {
            Ok(source)
        } else {
            Err(lost("leg of any length"))
        }
    }

    fn at_rest(&self) -> Pose {
        self.chain(|joint| (self.bvh.joints[joint].offset, Quat::IDENTITY))
    }

    fn pose(&self, frame: usize) -> Pose {
        self.chain(|joint| self.bvh.local(frame, joint))
    }

    /// Forward kinematics of the file's tree, turned into our axes.
    fn chain(&self, local: impl Fn(usize) -> (Vec3, Quat)) -> Pose {
        let turn = self.our_from_file;
        let count = self.bvh.joints.len();
        let mut pose = Pose {
            positions: Vec::with_capacity(count),
            rotations: Vec::with_capacity(count),
        };
        for (index, joint) in self.bvh.joints.iter().enumerate() {
            let (translation, rotation) = local(index);
            let translation = turn * translation;
            let rotation = turn * rotation * turn.conjugate();
            let (position, rotation) = match joint.parent {
                Some(parent) => {
                    let above = pose.rotations[parent];
                    (
                        pose.positions[parent] + above * translation,
                        (above * rotation).normalize(),
                    )
                }
                None => (translation, rotation),
            };
            pose.positions.push(position);
            pose.rotations.push(rotation);
        }
        pose
    }

    /// The one axis about which joint `lower` turns against `upper` in all frames, if there is one; positive is the way
    /// it turns.
    fn hinge(&self, upper: usize, lower: usize) -> Option<Vec3> {
        let step = (self.bvh.frames() / 100).max(1);
        let turns: Vec<Vec3> = (0..self.bvh.frames())
            .step_by(step)
            .map(|frame| {
                let pose = self.pose(frame);
                let turn = pose.rotations[upper].conjugate() * pose.rotations[lower];
                if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis()
            })
            .collect();
        let most = turns
            .iter()
            .max_by(|a, b| a.length().total_cmp(&b.length()))
            .filter(|turn| turn.length() > 0.35)?;
        let axis = most.normalize();
        turns
            .iter()
            .all(|turn| turn.reject_from_normalized(axis).length() < 0.03)
            .then_some(axis)
    }

    /// Metres of our body per file unit of travel, sideways (x, z) and up (y).
    fn travel(
        &self,
        skeleton: &Skeleton,
        options: &LoadOptions,
        notes: &mut Vec<String>,
    ) -> Result<Vec3, MotionError> {
        let ours = leg_length(skeleton);
        let fitted = ours / self.leg;
        if let Some(scale) = options.bvh_scale {
            if !(scale.is_finite() && scale > 0.0) {
                return Err(MotionError::Request(format!(
                    "a BVH scale of {scale} makes no sense; give metres per file unit, for example 0.01 for centimetres"
                )));
            }
            notes.push(format!(
                "units: {scale} m as asked, legs of {:.2} m; travel over the floor is not fitted",
                self.leg * scale
            ));
            return Ok(Vec3::new(scale, fitted, scale));
        }
        let error = |unit: f32| (self.leg * unit / ours).ln().abs();
        let (unit, name) = UNITS
            .into_iter()
            .min_by(|a, b| error(a.0).total_cmp(&error(b.0)))
            .unwrap_or(UNITS[0]);
        notes.push(format!(
            "units: {name}, legs of {:.2} m; travel is scaled by {:.3} to this avatar's {ours:.2} m",
            self.leg * unit,
            fitted / unit
        ));
        Ok(Vec3::splat(fitted))
    }
}

/// What to do for each target joint, worked out once from the two rest poses.
struct Plan {
    /// `C`: our T-pose to the source's rest pose, per target joint.
    rest_from_t: [Quat; JOINTS],
    /// The source joint whose world rotation a target joint takes.
    follows: [Option<usize>; JOINTS],
    /// Source joints whose connecting line a limb takes.
    spans: [Option<[usize; 2]>; JOINTS],
    relaxed: [bool; 2],
    /// How far the upper arms were turned about themselves for the elbow's hinge, left and right.
    hinge_twist: [Quat; 2],
    /// From the source's line from hips to neck, at rest, to ours.
    our_from_their_torso: Quat,
}

impl Plan {
    fn new(source: &Source<'_>, parts: &Parts, skeleton: &Skeleton) -> Self {
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
        let ours = palm(skeleton, side);
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

    fn describe(&self, parts: &Parts, notes: &mut Vec<String>) {
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
        if !parts.unmapped.is_empty() {
            notes.push(format!(
                "{} joints without a counterpart: {}",
                parts.unmapped.len(),
                summarise(&parts.unmapped)
            ));
        }
    }

    /// One frame.
    fn frame(&self, pose: &Pose, parts: &Parts, skeleton: &Skeleton, travel: Vec3) -> MotionParams {
        let mut world: [Option<Quat>; JOINTS] = [None; JOINTS];
        for joint in Joint::ALL {
            let j = joint.index();
            if let Some(follows) = self.follows[j] {
                world[j] = Some(pose.rotations[follows] * self.rest_from_t[j]);
            }
        }
        // The chest turns as the source's last spine bone; the joints below it share the way there.
        let spine = [Joint::Spine1, Joint::Spine2, Joint::Spine3];
        for (k, joint) in (1u8..).zip(spine) {
            world[joint.index()] = Some(along_chain(
                pose,
                parts.pelvis,
                &parts.spine,
                f32::from(k) / 3.0,
            ));
        }
        self.straighten_torso(&mut world, pose, parts, skeleton);
        let chest = parts.spine.last().copied().unwrap_or(parts.pelvis);
        world[Joint::Neck.index()] = match parts.neck.as_slice() {
            [] => parts
                .named(Joint::Head)
                .map(|head| pose.rotations[chest].slerp(pose.rotations[head], 0.5)),
            [only] => Some(pose.rotations[*only]),
            [first, .., last] => Some(pose.rotations[*first].slerp(pose.rotations[*last], 0.5)),
        };
        for (from, to) in LIMBS {
            let line = self.spans[from.index()].and_then(|[a, b]| pose.along(a, b));
            let ours = skeleton.rest_offset(to).try_normalize();
            if let (Some(world), Some(line), Some(ours)) = (&mut world[from.index()], line, ours) {
                *world = Quat::from_rotation_arc((*world * ours).normalize(), line) * *world;
            }
        }
        // A forearm turns along its whole length: the elbow takes half of what the wrist turns about it.
        for (elbow, wrist) in [
            (Joint::LeftElbow, Joint::LeftWrist),
            (Joint::RightElbow, Joint::RightWrist),
        ] {
            if let (Some(lower), Some(hand)) = (world[elbow.index()], world[wrist.index()]) {
                let axis = skeleton.rest_offset(wrist).normalize_or_zero();
                let half = twist(lower.conjugate() * hand, axis) * 0.5;
                world[elbow.index()] = Some(lower * Quat::from_scaled_axis(axis * half));
            }
        }
        let mut motion = MotionParams::default();
        let mut resolved = [Quat::IDENTITY; JOINTS];
        for joint in Joint::ALL {
            let j = joint.index();
            let parent = joint
                .parent()
                .map_or(Quat::IDENTITY, |p| resolved[p.index()]);
            resolved[j] = world[j].unwrap_or(parent).normalize();
            motion.set_rotation(joint, parent.conjugate() * resolved[j]);
        }
        for side in [0, 1] {
            if self.relaxed[side] {
                relax(&mut motion, skeleton, side);
            }
        }
        // The middle of the hip joints travels, which every rig places alike; the pelvis joint is anywhere.
        let hips = self.hip_middle(pose, parts) * travel;
        let rest = skeleton.rest_positions();
        let pelvis = rest[Joint::Pelvis.index()];
        let ours = (rest[Joint::LeftHip.index()] + rest[Joint::RightHip.index()]) * 0.5 - pelvis;
        motion.root_translation = hips - (pelvis + resolved[Joint::Pelvis.index()] * ours);
        motion
    }

    /// Rigs bend their backs at other heights than ours: turned alike, bone for bone, a deep bow would end elsewhere.
    /// Turns the three spine joints together until hips and neck lie as the source's do, apart from what already
    /// differs at rest.
    fn straighten_torso(
        &self,
        world: &mut [Option<Quat>; JOINTS],
        pose: &Pose,
        parts: &Parts,
        skeleton: &Skeleton,
    ) {
        let spine = [Joint::Spine1, Joint::Spine2, Joint::Spine3];
        let above = [Joint::Spine2, Joint::Spine3, Joint::Neck];
        let (Some(theirs), Some(pelvis)) = (torso(pose, parts), world[Joint::Pelvis.index()])
        else {
            return;
        };
        let chest = parts.spine.last().copied().unwrap_or(parts.pelvis);
        let middle = pelvis.slerp(pose.rotations[chest], 0.5);
        let wanted = middle * self.our_from_their_torso * middle.conjugate() * theirs;
        let rest = skeleton.rest_positions();
        let hips = (rest[Joint::LeftHip.index()] + rest[Joint::RightHip.index()]) * 0.5;
        for _ in 0..3 {
            let base = pelvis * (rest[Joint::Spine1.index()] - hips);
            let back: Vec3 = spine
                .iter()
                .zip(above)
                .filter_map(|(joint, next)| {
                    Some(world[joint.index()]? * skeleton.rest_offset(next))
                })
                .sum();
            // The foot of the back stays with the pelvis: aim the rest of the line.
            let length = (base + back).length();
            let (Some(now), Some(aim)) = (
                back.try_normalize(),
                (wanted * length - base).try_normalize(),
            ) else {
                return;
            };
            let swing = Quat::from_rotation_arc(now, aim);
            for joint in spine {
                if let Some(turn) = &mut world[joint.index()] {
                    *turn = (swing * *turn).normalize();
                }
            }
        }
    }

    fn hip_middle(&self, pose: &Pose, parts: &Parts) -> Vec3 {
        let at = |joint: Joint| parts.named(joint).map_or(Vec3::ZERO, |j| pose.positions[j]);
        (at(Joint::LeftHip) + at(Joint::RightHip)) * 0.5
    }
}

/// Direction from the middle of the hips to the lowest neck bone, or to the head of a rig without neck.
fn torso(pose: &Pose, parts: &Parts) -> Option<Vec3> {
    let at = |joint: usize| pose.positions[joint];
    let hips = (at(parts.named(Joint::LeftHip)?) + at(parts.named(Joint::RightHip)?)) * 0.5;
    let neck = parts.neck.first().copied().or(parts.named(Joint::Head))?;
    (at(neck) - hips).try_normalize()
}

/// Rotation at a share (0..=1) of the way up a chain of bones: of a bone of the chain where there are at least three,
/// between two of them where there are fewer.
fn along_chain(pose: &Pose, base: usize, chain: &[usize], share: f32) -> Quat {
    let at = |k: usize| {
        let joint = k.checked_sub(1).and_then(|k| chain.get(k)).unwrap_or(&base);
        pose.rotations[*joint]
    };
    let place = share * chain.len() as f32;
    if chain.len() >= 3 {
        // Nearest bone, counted in thirds so that the last share is the last bone.
        let nearest = (0..=chain.len()).min_by(|a, b| {
            (*a as f32 - place)
                .abs()
                .total_cmp(&(*b as f32 - place).abs())
        });
        return at(nearest.unwrap_or(0));
    }
    let below = (0..=chain.len()).rfind(|k| *k as f32 <= place).unwrap_or(0);
    let above = (below + 1).min(chain.len());
    at(below).slerp(at(above), place - below as f32)
}

/// Angle of a rotation about an axis, radians, -pi..=pi.
fn twist(rotation: Quat, axis: Vec3) -> f32 {
    let along = rotation.xyz().dot(axis);
    let angle = 2.0 * along.atan2(rotation.w);
    if angle > std::f32::consts::PI {
        angle - std::f32::consts::TAU
    } else if angle < -std::f32::consts::PI {
        angle + std::f32::consts::TAU
    } else {
        angle
    }
}

/// Columns: along, across (made square to it), and their normal.
fn frame(along: Vec3, across: Vec3) -> Option<Mat3> {
    let along = along.try_normalize()?;
    let across = across.reject_from_normalized(along).try_normalize()?;
    Some(Mat3::from_cols(along, across, along.cross(across)))
}

/// Our palm in T-pose: from the wrist to the knuckles, and from the little finger to the index.
pub(super) fn palm(skeleton: &Skeleton, side: usize) -> Option<Mat3> {
    let at = |finger: usize| skeleton.rest_positions()[FINGERS[side * 5 + finger][0].index()];
    let wrist = [Joint::LeftWrist, Joint::RightWrist][side];
    let knuckles = (at(0) + at(1) + at(2) + at(3)) * 0.25;
    frame(
        knuckles - skeleton.rest_positions()[wrist.index()],
        at(0) - at(2),
    )
}

/// Axis about which the fingers of a hand curl into the palm, for positive angles, in T-pose.
pub(super) fn curl_axis(skeleton: &Skeleton, side: usize) -> Vec3 {
    let across = palm(skeleton, side).map_or(Vec3::Z, |palm| palm.y_axis);
    if side == 0 { -across } else { across }
}

fn relax(motion: &mut MotionParams, skeleton: &Skeleton, side: usize) {
    let axis = curl_axis(skeleton, side);
    for finger in &FINGERS[side * 5..side * 5 + 4] {
        for joint in finger {
            motion.set_axis_angle(*joint, axis * RELAXED_CURL);
        }
    }
}

/// Mean length of thigh and shank together, metres.
fn leg_length(skeleton: &Skeleton) -> f32 {
    [
        Joint::LeftKnee,
        Joint::LeftAnkle,
        Joint::RightKnee,
        Joint::RightAnkle,
    ]
    .into_iter()
    .map(|joint| skeleton.rest_offset(joint).length())
    .sum::<f32>()
        * 0.5
}

/// The coordinate axis nearest to a direction, but square to `square_to`.
fn nearest_axis(direction: Vec3, square_to: Option<Vec3>) -> Option<Vec3> {
    let candidates = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    let best = candidates
        .filter(|axis| square_to.is_none_or(|other| axis.dot(other).abs() < 0.5))
        .max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)))?;
    (best.dot(direction) > 1e-6).then_some(best)
}

fn axis_name(axis: Vec3) -> String {
    let letter = ["x", "y", "z"]
        .into_iter()
        .zip(axis.to_array())
        .find(|(_, v)| v.abs() > 0.5);
    letter.map_or_else(String::new, |(name, v)| {
        format!("{}{name}", if v < 0.0 { "-" } else { "" })
    })
}
