//! Posing in double precision: a chain of joints, the maps that carry flesh, linear blend skinning and its inverse, the T-pose.
//!
//! The only skinning of this crate: what is tried while an avatar is made moves as the avatar does.

use super::Registered;
use super::model::{BodyModel, SkinRow};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use rayon::prelude::*;
use spmm3::{INFLUENCES, JOINTS, Joint, MotionParams, Skeleton, SkinWeights, SkinningTransforms};

/// How far the straight legs of the T-pose spread, radians: as in the demo person.
const LEG_SPREAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// A blended map with a smaller determinant has nearly collapsed (joints turned against each other), and its inverse would throw
/// vertices far away.
const COLLAPSED: f64 = 0.15;

/// Where every joint is and how it is turned.
#[derive(Debug, Clone, PartialEq)]
pub struct JointPose {
    /// World rotations relative to the body model's rest pose.
    pub rotations: [DMat3; JOINTS],
    /// Positions, metres.
    pub joints: [DVec3; JOINTS],
}

impl JointPose {
    /// The pose that a body was registered in.
    #[must_use]
    pub fn of_scan(registered: &Registered) -> Self {
        Self {
            rotations: registered.rotations,
            joints: registered.joints,
        }
    }

    /// The T-pose of a registered body, the pelvis at the origin.
    #[must_use]
    pub fn t_pose(model: &BodyModel, registered: &Registered) -> Self {
        let (_, rest) = model.shaped(&registered.shape);
        Self::chained(&t_pose(&rest), &rest, registered.scale)
    }

    /// Joints turned so, the pelvis at the origin; `rest` are the body's joints in the rest pose.
    #[must_use]
    pub fn chained(rotations: &[DMat3; JOINTS], rest: &[DVec3; JOINTS], scale: f64) -> Self {
        Self {
            rotations: *rotations,
            joints: chain(rotations, DVec3::ZERO, scale, rest),
        }
    }

    /// For each joint the rigid map that takes a point from pose `from`, of the same scale, to this one.
    #[must_use]
    pub fn maps_from(&self, from: &Self) -> [DAffine3; JOINTS] {
        std::array::from_fn(|joint| {
            let matrix3 = self.rotations[joint] * from.rotations[joint].transpose();
            DAffine3 {
                matrix3,
                translation: self.joints[joint] - matrix3 * from.joints[joint],
            }
        })
    }

    /// The same pose, everything moved by `offset`, metres.
    fn moved(mut self, offset: DVec3) -> Self {
        self.joints.iter_mut().for_each(|j| *j += offset);
        self
    }
}

/// A mesh that stands in the scan's pose, brought to the T-pose: the inverse of skinning it to the scan's pose. It stands on its soles, those
/// of the first `body_vertices`, its hips above the origin. Also the T-pose as it is there.
#[must_use]
pub fn brought_to_t_pose(
    vertices: &[DVec3],
    weights: &[SkinRow],
    body_vertices: usize,
    scan_pose: &JointPose,
    t_pose: &JointPose,
) -> (Vec<DVec3>, JointPose) {
    let mut vertices = unskinned(weights, &scan_pose.maps_from(t_pose), vertices);
    let body = vertices.get(..body_vertices).unwrap_or(&vertices);
    let soles = body.iter().map(|v| v.y).fold(f64::INFINITY, f64::min);
    let hips = [Joint::LeftHip, Joint::RightHip].map(|j| t_pose.joints[j.index()]);
    let middle = 0.5 * (hips[0] + hips[1]);
    let to_floor = -DVec3::new(middle.x, soles, middle.z);
    vertices.iter_mut().for_each(|v| *v += to_floor);
    (vertices, t_pose.clone().moved(to_floor))
}

/// Where the joints are: `rotations` are the joints' world rotations relative to the rest pose, `root` is where the pelvis is, `scale` is of the
/// whole body, `rest` the joints in the rest pose.
#[must_use]
pub fn chain(
    rotations: &[DMat3; JOINTS],
    root: DVec3,
    scale: f64,
    rest: &[DVec3; JOINTS],
) -> [DVec3; JOINTS] {
    let mut posed = [root; JOINTS];
    for joint in Joint::ALL {
        if let Some(parent) = joint.parent() {
            let (at, from) = (joint.index(), parent.index());
            posed[at] = posed[from] + scale * (rotations[from] * (rest[at] - rest[from]));
        }
    }
    posed
}

/// The map of each joint's flesh from the rest pose to a pose: `posed` is what [`chain`] made of `rest`.
#[must_use]
pub fn posed_from_rest(
    rotations: &[DMat3; JOINTS],
    posed: &[DVec3; JOINTS],
    scale: f64,
    rest: &[DVec3; JOINTS],
) -> [DAffine3; JOINTS] {
    std::array::from_fn(|joint| {
        let matrix3 = rotations[joint] * scale;
        DAffine3 {
            matrix3,
            translation: posed[joint] - matrix3 * rest[joint],
        }
    })
}

/// The map of each joint's flesh from the T-pose to a motion's pose, the root's translation left out.
#[must_use]
pub fn posed_by_motion(skeleton: &Skeleton, motion: &MotionParams) -> [DAffine3; JOINTS] {
    let mut transforms = SkinningTransforms::default();
    skeleton.skinning(&skeleton.pose(motion), &mut transforms);
    Joint::ALL.map(|joint| transforms.posed_from_rest(joint).as_daffine3())
}

/// The joints' maps blended by a row of weights.
#[must_use]
pub fn blended(row: &SkinRow, maps: &[DAffine3; JOINTS]) -> DAffine3 {
    let mut sum = DAffine3 {
        matrix3: DMat3::ZERO,
        translation: DVec3::ZERO,
    };
    for (weight, map) in row.iter().zip(maps) {
        if *weight != 0.0 {
            let weight = f64::from(*weight);
            sum.matrix3 += map.matrix3 * weight;
            sum.translation += map.translation * weight;
        }
    }
    sum
}

/// Linear blend skinning: `[N_v]` vertices moved by their joints' maps. `weights` has a row a vertex, each sums to 1.
#[must_use]
pub fn skinned(weights: &[SkinRow], maps: &[DAffine3; JOINTS], vertices: &[DVec3]) -> Vec<DVec3> {
    (weights.par_iter().zip(vertices))
        .map(|(row, vertex)| blended(row, maps).transform_point3(*vertex))
        .collect()
}

/// The vertices that [`skinned`] would move to `vertices`. Where the blended map has nearly collapsed, the strongest joint's map is inverted
/// instead.
#[must_use]
pub fn unskinned(weights: &[SkinRow], maps: &[DAffine3; JOINTS], vertices: &[DVec3]) -> Vec<DVec3> {
    (weights.par_iter().zip(vertices))
        .map(|(row, vertex)| {
            let mut map = blended(row, maps);
            if map.matrix3.determinant() < COLLAPSED {
                map = maps[strongest(row)];
            }
            map.inverse().transform_point3(*vertex)
        })
        .collect()
}

/// The joint with the largest weight in a row.
#[must_use]
pub fn strongest(row: &SkinRow) -> usize {
    (0..JOINTS)
        .max_by(|a, b| row[*a].total_cmp(&row[*b]).then(b.cmp(a)))
        .unwrap_or(0)
}

/// The strongest joints of a row, as an avatar keeps them: their weights sum to 1.
#[must_use]
pub fn kept(row: &SkinRow) -> SkinWeights {
    let mut order: [u8; JOINTS] = Joint::ALL.map(|j| j as u8);
    order.sort_by(|a, b| row[usize::from(*b)].total_cmp(&row[usize::from(*a)]));
    let mut skin = SkinWeights::default();
    let strongest = order.iter().take(INFLUENCES);
    let sum: f32 = strongest
        .clone()
        .map(|j| row[usize::from(*j)].max(0.0))
        .sum();
    if sum.is_nan() || sum <= 0.0 {
        // A vertex that no joint holds stays with the root.
        skin.weights = std::array::from_fn(|k| if k == 0 { 1.0 } else { 0.0 });
        return skin;
    }
    for ((slot, weight), joint) in (skin.joints.iter_mut().zip(&mut skin.weights)).zip(strongest) {
        let share = row[usize::from(*joint)].max(0.0);
        if share > 0.0 {
            (*slot, *weight) = (*joint, share / sum);
        }
    }
    skin
}

/// World rotations that bring the rest pose with these joints to the T-pose: arms along +-x with elbows that bend forward and palms down,
/// legs straight down and 2 degrees apart, feet flat, fingers as they are on the hand. Facing +z.
#[must_use]
pub fn t_pose(rest: &[DVec3; JOINTS]) -> [DMat3; JOINTS] {
    let mut rotations = [DQuat::IDENTITY; JOINTS];
    for side in [Side::LEFT, Side::RIGHT] {
        let out = side.outward;
        let down = DVec3::new(out.x * LEG_SPREAD.sin(), -LEG_SPREAD.cos(), 0.0);
        let bone = |from: Joint, to: Joint| rest[to.index()] - rest[from.index()];
        let upper = bone(side.shoulder, side.elbow);
        let fore = bone(side.elbow, side.wrist);
        let straight = align(DQuat::IDENTITY, upper, out);
        // The elbow's hinge stands upright, so that it bends forward.
        let hinge = roll(straight * upper.cross(fore), out.cross(DVec3::Z), out);
        let shoulder = DQuat::from_axis_angle(out, hinge) * straight;
        let elbow = align(shoulder, fore, out);
        let wrist = align(elbow, bone(side.wrist, side.middle), out);
        // Index finger in front of the little one; the forearm takes half of the twist.
        let palm = roll(wrist * bone(side.pinky, side.index), DVec3::Z, out);
        let elbow = DQuat::from_axis_angle(out, 0.5 * palm) * elbow;
        let wrist = DQuat::from_axis_angle(out, palm) * wrist;
        let hip = align(DQuat::IDENTITY, bone(side.hip, side.knee), down);
        let knee = align(hip, bone(side.knee, side.ankle), down);
        for (joint, turn) in [
            (side.shoulder, shoulder),
            (side.elbow, elbow),
            (side.wrist, wrist),
            (side.hip, hip),
            (side.knee, knee),
        ] {
            rotations[joint.index()] = turn;
        }
        for joint in Joint::ALL {
            if joint.index() >= Joint::LeftIndex1.index() && root_of(joint) == side.wrist {
                rotations[joint.index()] = wrist;
            }
        }
    }
    rotations.map(DMat3::from_quat)
}

/// The wrist above a finger's joint.
fn root_of(finger: Joint) -> Joint {
    let mut joint = finger;
    while joint.index() >= Joint::LeftIndex1.index() {
        match joint.parent() {
            Some(parent) => joint = parent,
            None => break,
        }
    }
    joint
}

/// `turn`, followed by the shortest turn that brings `direction` along the unit vector `to`.
fn align(turn: DQuat, direction: DVec3, to: DVec3) -> DQuat {
    let from = (turn * direction).normalize_or(to);
    DQuat::from_rotation_arc(from, to) * turn
}

/// Angle about the unit vector `axis` from `from` to `to`; zero where one of them lies along it.
fn roll(from: DVec3, to: DVec3, axis: DVec3) -> f64 {
    let (from, to) = (from.reject_from(axis), to.reject_from(axis));
    if from.length_squared() < 1e-16 || to.length_squared() < 1e-16 {
        return 0.0;
    }
    from.cross(to).dot(axis).atan2(from.dot(to))
}

/// The joints of one side that the T-pose needs.
struct Side {
    outward: DVec3,
    shoulder: Joint,
    elbow: Joint,
    wrist: Joint,
    middle: Joint,
    pinky: Joint,
    index: Joint,
    hip: Joint,
    knee: Joint,
    ankle: Joint,
}

impl Side {
    const LEFT: Self = Self {
        outward: DVec3::X,
        shoulder: Joint::LeftShoulder,
        elbow: Joint::LeftElbow,
        wrist: Joint::LeftWrist,
        middle: Joint::LeftMiddle1,
        pinky: Joint::LeftPinky1,
        index: Joint::LeftIndex1,
        hip: Joint::LeftHip,
        knee: Joint::LeftKnee,
        ankle: Joint::LeftAnkle,
    };
    const RIGHT: Self = Self {
        outward: DVec3::NEG_X,
        shoulder: Joint::RightShoulder,
        elbow: Joint::RightElbow,
        wrist: Joint::RightWrist,
        middle: Joint::RightMiddle1,
        pinky: Joint::RightPinky1,
        index: Joint::RightIndex1,
        hip: Joint::RightHip,
        knee: Joint::RightKnee,
        ankle: Joint::RightAnkle,
    };
}
