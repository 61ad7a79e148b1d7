//! The 55-joint skeleton and its forward kinematics (the CPU lane's preprocessing).

use crate::{JOINTS, Joint, MotionParams, PersonError};
use glam::{Affine3A, Quat, Vec3, Vec3A};

/// Rest positions of the 55 joints in T-pose. All rest frames are axis-aligned with the template's space, as in SMPL-X.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    rest_positions: [Vec3; JOINTS],
}

/// Each joint's frame in the person's space, root translation left out.
///
/// `person_from_joint[j]` maps a point given relative to joint j into the person's space (metres).
#[derive(Debug, Clone, PartialEq)]
pub struct JointTransforms {
    /// One rigid transform per joint, in SMPL-X's order.
    pub person_from_joint: [Affine3A; JOINTS],
}

/// The deform graph's second input: `posed_from_rest` of every joint as a planar [12, 55] matrix.
///
/// Row `3 * column + row` holds that element of the 3x4 matrices, so that the four columns are four contiguous [3, 55]
/// slices. The root translation is left out: numbers near zero survive FP16 on the NPU.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinningTransforms(pub [f32; 12 * JOINTS]);

impl Default for SkinningTransforms {
    /// Every joint at rest.
    fn default() -> Self {
        let mut transforms = Self([0.0; 12 * JOINTS]);
        for joint in 0..JOINTS {
            transforms.set(joint, &Affine3A::IDENTITY);
        }
        transforms
    }
}

impl SkinningTransforms {
    /// The 3x4 matrix of `joint` as an affine map from rest to posed space.
    #[must_use]
    pub fn posed_from_rest(&self, joint: Joint) -> Affine3A {
        let at = |row: usize| self.0[row * JOINTS + joint.index()];
        let column = |c: usize| Vec3A::new(at(3 * c), at(3 * c + 1), at(3 * c + 2));
        Affine3A {
            matrix3: glam::Mat3A::from_cols(column(0), column(1), column(2)),
            translation: column(3),
        }
    }

    fn set(&mut self, joint: usize, posed_from_rest: &Affine3A) {
        for (row, value) in posed_from_rest.to_cols_array().into_iter().enumerate() {
            self.0[row * JOINTS + joint] = value;
        }
    }
}

impl Skeleton {
    /// Takes the joints' T-pose positions in metres.
    ///
    /// # Errors
    /// If a coordinate is not finite or further than 100 m from the origin.
    pub fn new(rest_positions: [Vec3; JOINTS]) -> Result<Self, PersonError> {
        let flat: &[f32] = bytemuck::cast_slice(&rest_positions);
        PersonError::check_range("joint coordinate", flat, -100.0, 100.0, "-100..100 m")?;
        Ok(Self { rest_positions })
    }

    /// T-pose positions in metres, in SMPL-X's order.
    #[must_use]
    pub fn rest_positions(&self) -> &[Vec3; JOINTS] {
        &self.rest_positions
    }

    /// T-pose position of `joint` relative to its parent's (the pelvis': to the origin), metres.
    #[must_use]
    pub fn rest_offset(&self, joint: Joint) -> Vec3 {
        let parent = joint
            .parent()
            .map_or(Vec3::ZERO, |p| self.rest_positions[p.index()]);
        self.rest_positions[joint.index()] - parent
    }

    /// Forward kinematics (SMPL's equation 3): rotations about each joint, down the chain from the pelvis, which stays
    /// at its rest position because the root translation is left out.
    #[must_use]
    pub fn pose(&self, motion: &MotionParams) -> JointTransforms {
        self.pose_rotations(|joint| motion.rotation(joint))
    }

    /// As [`Self::pose`], with each joint's rotation relative to its parent given directly.
    #[must_use]
    pub fn pose_rotations(&self, rotation: impl Fn(Joint) -> Quat) -> JointTransforms {
        let mut person_from_joint = [Affine3A::IDENTITY; JOINTS];
        for joint in Joint::ALL {
            let parent_from_joint =
                Affine3A::from_rotation_translation(rotation(joint), self.rest_offset(joint));
            person_from_joint[joint.index()] = match joint.parent() {
                Some(parent) => person_from_joint[parent.index()] * parent_from_joint,
                None => parent_from_joint,
            };
        }
        JointTransforms { person_from_joint }
    }

    /// Turns posed joints into the deform graph's input: `posed_from_rest = person_from_joint * translate(-rest)`.
    pub fn skinning(&self, joints: &JointTransforms, out: &mut SkinningTransforms) {
        for (joint, (person_from_joint, rest)) in joints
            .person_from_joint
            .iter()
            .zip(&self.rest_positions)
            .enumerate()
        {
            let posed_from_rest = *person_from_joint * Affine3A::from_translation(-*rest);
            out.set(joint, &posed_from_rest);
        }
    }
}

impl JointTransforms {
    /// Position of `joint` in the person's space, metres, root translation left out.
    #[must_use]
    pub fn position(&self, joint: Joint) -> Vec3 {
        self.person_from_joint[joint.index()].translation.into()
    }
}
