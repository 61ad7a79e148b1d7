//! The 22 joints of the body without hands and face, and their forward kinematics in f64.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use spmm3::{Joint, Skeleton};

/// Joints of the body in SMPL-X's order: pelvis to wrists. The jaw, the eyes and the fingers come after them.
pub const BODY_JOINTS: usize = 22;

/// A point that a joint carries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attachment {
    /// Below [`BODY_JOINTS`].
    pub(super) joint: usize,
    /// Where the point is relative to the joint at rest, metres.
    pub offset: Vector3<f64>,
}

impl Attachment {
    /// `joint` itself.
    #[must_use]
    pub fn centre(joint: Joint) -> Self {
        Self::new(joint, Vector3::zeros())
    }

    /// A point at `offset` from `joint`. A joint of the face or the fingers stands for the head or the wrist that carries it.
    #[must_use]
    pub fn new(joint: Joint, offset: Vector3<f64>) -> Self {
        Self {
            joint: body_index(joint),
            offset,
        }
    }
}

/// The index of a joint of the body; of others, whose turns the body does not know, the index of the nearest body joint above them.
pub(super) fn body_index(joint: Joint) -> usize {
    let mut joint = joint;
    while let (true, Some(parent)) = (joint.index() >= BODY_JOINTS, joint.parent()) {
        joint = parent;
    }
    joint.index()
}

/// The skeleton's bones.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Each joint's parent; the pelvis is its own.
    pub(super) parents: [usize; BODY_JOINTS],
    /// Each joint relative to its parent at rest, metres; the pelvis' is zero.
    pub(super) offsets: [Vector3<f64>; BODY_JOINTS],
    /// The joints that move each joint, itself among them, as bits.
    pub(super) movers: [u32; BODY_JOINTS],
}

/// Where a skeleton is and how it is bent: the solver's unknowns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posture {
    /// The pelvis in the world, metres.
    pub position: Vector3<f64>,
    /// Each joint relative to its parent, the pelvis relative to the world.
    pub rotations: [UnitQuaternion<f64>; BODY_JOINTS],
}

impl Default for Posture {
    fn default() -> Self {
        Self {
            position: Vector3::zeros(),
            rotations: [UnitQuaternion::identity(); BODY_JOINTS],
        }
    }
}

impl Posture {
    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position.iter().all(|v| v.is_finite())
            && self
                .rotations
                .iter()
                .all(|q| q.coords.iter().all(|v| v.is_finite()))
    }
}

/// The joints of a [`Posture`] in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// `world_from_joint` of each joint.
    pub rotations: [Matrix3<f64>; BODY_JOINTS],
    /// Each joint in the world, metres.
    pub positions: [Vector3<f64>; BODY_JOINTS],
}

impl Default for Placed {
    fn default() -> Self {
        Self {
            rotations: [Matrix3::identity(); BODY_JOINTS],
            positions: [Vector3::zeros(); BODY_JOINTS],
        }
    }
}

impl Placed {
    /// A carried point in the world, metres.
    #[must_use]
    pub fn point(&self, at: &Attachment) -> Vector3<f64> {
        self.positions[at.joint] + self.rotations[at.joint] * at.offset
    }
}

impl Chain {
    /// The bones of `skeleton`.
    #[must_use]
    pub fn new(skeleton: &Skeleton) -> Self {
        let mut chain = Self {
            parents: [0; BODY_JOINTS],
            offsets: [Vector3::zeros(); BODY_JOINTS],
            movers: [1; BODY_JOINTS],
        };
        for joint in Joint::ALL.into_iter().take(BODY_JOINTS) {
            let (index, Some(parent)) = (joint.index(), joint.parent()) else {
                continue;
            };
            chain.parents[index] = parent.index();
            chain.offsets[index] = wide(skeleton.rest_offset(joint));
            chain.movers[index] = chain.movers[parent.index()] | 1 << index;
        }
        chain
    }

    /// Forward kinematics.
    #[must_use]
    pub fn place(&self, posture: &Posture) -> Placed {
        let mut placed = Placed::default();
        placed.positions[0] = posture.position;
        placed.rotations[0] = posture.rotations[0].to_rotation_matrix().into_inner();
        for joint in 1..BODY_JOINTS {
            let parent = self.parents[joint];
            let turn = posture.rotations[joint].to_rotation_matrix();
            placed.rotations[joint] = placed.rotations[parent] * turn.matrix();
            placed.positions[joint] =
                placed.positions[parent] + placed.rotations[parent] * self.offsets[joint];
        }
        placed
    }
}

/// A vector in f64.
#[must_use]
pub(super) fn wide(v: glam::Vec3) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}
