//! Another body's motion on this body.
//!
//! A BVH's rest frames are all aligned with the file's axes, as SMPL-X's are, but its rest pose differs: an A-pose, a
//! T-pose with straddled legs. For each target joint a constant `C` turns our T-pose into the file's rest pose, and the
//! joint's world rotation is the source's world rotation times `C`. Limbs get `C` by aligning each bone after its
//! parent's (no twist of their own), and each frame a last swing puts the bone along the line between the source's
//! joints, so that chains of many bones keep their end points. Torso, head, collars and face take `C` = identity: their joints
//! sit at other places in every rig, but both rest poses stand upright and look ahead.

use super::{
    LoadOptions, MotionClip, MotionError,
    bvh::Bvh,
    ground::{self, Height},
    hands,
    names::Parts,
    plan::{LIMBS, Plan, torso},
    range,
    source::{Pose, Source},
};
use crate::{JOINTS, Joint, MotionParams, Skeleton};
use glam::{Quat, Vec3};

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
    range::check(&frames)?;
    ground::stand(&mut frames, bvh.frame_seconds, skeleton, height);
    range::check(&frames)?;
    Ok(MotionClip {
        name: String::new(),
        frames,
        frame_seconds: bvh.frame_seconds,
        expression_basis: None,
        notes,
        unmapped: parts.unmapped,
    })
}

impl Plan {
    /// One frame.
    fn frame(&self, pose: &Pose, parts: &Parts, skeleton: &Skeleton, travel: Vec3) -> MotionParams {
        let mut world: [Option<Quat>; JOINTS] = [None; JOINTS];
        for joint in Joint::ALL {
            let j = joint.index();
            if let Some(follows) = self.follows[j] {
                world[j] = Some(pose.rotations[follows] * self.rest_from_t[j]);
            }
        }
        // The chest turns as the source's last spine bone; the joints below it share the rotation.
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
        // A forearm turns along its whole length: the elbow takes half of the wrist's turn about the forearm.
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
                hands::relax(&mut motion, skeleton, side);
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

    /// Rigs bend their backs at other heights than ours: with the same turn for each bone a deep bow would end elsewhere.
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
            // The lowest spine bone stays with the pelvis: aim the rest of the line.
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
/// Rotation at a share (0..=1) of the way up a chain of bones: that of one bone in a chain of at least three,
/// interpolated between two in a shorter one.
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
