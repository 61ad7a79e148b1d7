//! Inverse kinematics of the legs; planted legs carry a moved pelvis while the soles stay where they are at rest.

use crate::{Joint, MotionParams, Skeleton};
use glam::{Mat3, Quat, Vec3};

/// The joints of the left leg and of the right, from the hip down.
pub const LEGS: [[Joint; 3]; 2] = [
    [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle],
    [Joint::RightHip, Joint::RightKnee, Joint::RightAnkle],
];

/// The share of a leg's length that stays unused, so that a planted leg is never straight.
const SLACK: f32 = 0.006;

/// Puts the pelvis at its rest position plus `shift` (metres) turned by `turn`, and bends hips, knees and ankles so that
/// both feet stay as they are in T-pose. Lowers the pelvis as far as the longer-reaching leg needs.
pub(super) fn plant(motion: &mut MotionParams, skeleton: &Skeleton, shift: Vec3, turn: Quat) {
    let rest = skeleton.rest_positions();
    let pelvis = rest[Joint::Pelvis.index()];
    let mut shift = shift;
    for [hip, knee, ankle] in LEGS {
        let hip_at = pelvis + shift + turn * skeleton.rest_offset(hip);
        let reach = (skeleton.rest_offset(knee).length() + skeleton.rest_offset(ankle).length())
            * (1.0 - SLACK);
        let foot = rest[ankle.index()];
        let side = Vec3::new(foot.x - hip_at.x, 0.0, foot.z - hip_at.z).length();
        let highest = foot.y + (reach * reach - side * side).max(0.0).sqrt();
        shift.y -= (hip_at.y - highest).max(0.0);
    }
    motion.set_rotation(Joint::Pelvis, turn);
    motion.root_translation = shift;
    for leg in LEGS {
        let ankle = rest[leg[2].index()];
        // The knee points between the pelvis and the foot.
        let knees = Quat::IDENTITY.slerp(turn, 0.5) * Vec3::Z;
        bend_leg(
            motion,
            skeleton,
            leg,
            (pelvis + shift, turn),
            (ankle, Quat::IDENTITY),
            knees,
        );
    }
}

/// Bends hip, knee and ankle of `leg`, one of [`LEGS`], so that it leads from a pelvis to an ankle, each given by position
/// (metres) and rotation from rest, both in one space. The knee points towards `knee` as far as the leg allows. For an ankle
/// out of reach the leg is stretched towards it.
pub fn bend_leg(
    motion: &mut MotionParams,
    skeleton: &Skeleton,
    [hip, knee, ankle]: [Joint; 3],
    (pelvis_at, pelvis_turn): (Vec3, Quat),
    (ankle_at, ankle_turn): (Vec3, Quat),
    towards: Vec3,
) {
    let hip_at = pelvis_at + pelvis_turn * skeleton.rest_offset(hip);
    let (thigh, shank) = (skeleton.rest_offset(knee), skeleton.rest_offset(ankle));
    let (l1, l2) = (thigh.length(), shank.length());
    let to_foot = ankle_at - hip_at;
    // No reach at all where a leg has no length.
    let nearest = (l1 - l2).abs() + 1e-4;
    let distance = to_foot
        .length()
        .clamp(nearest, (l1 + l2 - 1e-5).max(nearest));
    let along = to_foot.normalize_or(Vec3::NEG_Y);
    let ahead = towards.reject_from_normalized(along).normalize_or(Vec3::Z);
    let down = (distance * distance + l1 * l1 - l2 * l2) / (2.0 * distance);
    let out = (l1 * l1 - down * down).max(0.0).sqrt();
    let knee_at = along * down + ahead * out;
    let hinge = along.cross(ahead).normalize_or(Vec3::NEG_X);
    let world_hip = aligned(thigh, knee_at, hinge);
    let world_knee = aligned(shank, along * distance - knee_at, hinge);
    motion.set_rotation(hip, pelvis_turn.conjugate() * world_hip);
    motion.set_rotation(knee, world_hip.conjugate() * world_knee);
    motion.set_rotation(ankle, world_knee.conjugate() * ankle_turn);
}

/// Rotation that lays the rest direction `bone` along `line` and the knee's rest hinge, the person's right, along `hinge`.
fn aligned(bone: Vec3, line: Vec3, hinge: Vec3) -> Quat {
    let frame = |along: Vec3, across: Vec3| {
        let along = along.normalize_or(Vec3::NEG_Y);
        let across = across
            .reject_from_normalized(along)
            .normalize_or(Vec3::NEG_X);
        Mat3::from_cols(along, across, along.cross(across))
    };
    Quat::from_mat3(&(frame(line, hinge) * frame(bone, Vec3::NEG_X).transpose()))
}
