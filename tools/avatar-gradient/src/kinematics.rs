//! Joint transforms of a pose, and the derivatives of a loss by every joint's axis-angle vector.

use crate::skinning::ByJoints;
use glam::{Affine3A, DMat3, DVec3};
use spmm3::{JOINTS, Joint, MotionParams, PARAMS, Skeleton};

/// Angles below this are taken as 0 in the Jacobian's factors, whose series then begin with 1/2 and 1/6.
const SMALL_ANGLE: f64 = 1e-4;

/// What the chain of joints computed on the way.
#[derive(Debug, Clone)]
pub(crate) struct JointPass {
    /// Each joint's motion from T-pose, root translation left out.
    pub(crate) posed_from_rest: [Affine3A; JOINTS],
    /// Each joint's own frame in the person's space.
    person_from_joint: [Affine3A; JOINTS],
}

impl Default for JointPass {
    fn default() -> Self {
        Self {
            posed_from_rest: [Affine3A::IDENTITY; JOINTS],
            person_from_joint: [Affine3A::IDENTITY; JOINTS],
        }
    }
}

impl JointPass {
    /// SMPL's equation 3, by the very function that the receiver uses.
    pub(crate) fn forward(&mut self, skeleton: &Skeleton, motion: &MotionParams) {
        self.person_from_joint = skeleton.pose(motion).person_from_joint;
        let rests = skeleton.rest_positions();
        for ((posed_from_rest, joint), rest) in self
            .posed_from_rest
            .iter_mut()
            .zip(&self.person_from_joint)
            .zip(rests)
        {
            *posed_from_rest = *joint * Affine3A::from_translation(-*rest);
        }
    }

    /// Adds the derivatives by the axis-angle vectors in P, of those by `posed_from_rest`, to `by_p`.
    ///
    /// With R_j and t_j a joint's frame, p its parent, o_j its rest offset and Q_j = exp(r_j): R_j = R_p Q_j, t_j = t_p + R_p o_j, and
    /// skinning uses [R_j | t_j - R_j rest_j]. So a joint's derivatives go to its parent, and what turns it is the axial part of G Q^T.
    pub(crate) fn backward(
        &self,
        skeleton: &Skeleton,
        motion: &MotionParams,
        by_joints: &ByJoints,
        by_p: &mut [f32; PARAMS],
    ) {
        let rests = skeleton.rest_positions().map(|rest| rest.as_dvec3());
        let mut by_frame = [(DMat3::ZERO, DVec3::ZERO); JOINTS];
        for ((by_frame, by), rest) in by_frame.iter_mut().zip(by_joints).zip(rests) {
            let column = |k: usize| {
                DVec3::new(
                    f64::from(by[4 * k]),
                    f64::from(by[4 * k + 1]),
                    f64::from(by[4 * k + 2]),
                )
            };
            let by_place = column(3);
            let by_rotation = DMat3::from_cols(column(0), column(1), column(2));
            *by_frame = (by_rotation - outer(by_place, rest), by_place);
        }
        for joint in Joint::ALL.into_iter().rev() {
            let (by_rotation, by_place) = by_frame[joint.index()];
            let vector = motion.axis_angle(joint);
            let turn = motion.rotation(joint).as_dquat().normalize();
            let parent_from_joint = DMat3::from_quat(turn);
            let by_turn = match joint.parent() {
                Some(parent) => {
                    let offset = skeleton.rest_offset(joint).as_dvec3();
                    let above = &mut by_frame[parent.index()];
                    above.0 +=
                        by_rotation * parent_from_joint.transpose() + outer(by_place, offset);
                    above.1 += by_place;
                    let parent = self.person_from_joint[parent.index()].matrix3;
                    parent.as_dmat3().transpose() * by_rotation
                }
                None => by_rotation,
            };
            let torque = axial(by_turn * parent_from_joint.transpose());
            let by_vector = through_jacobian(vector.as_dvec3(), torque);
            let at = MotionParams::offset_of(joint);
            for (by_p, by) in by_p[at..at + 3]
                .iter_mut()
                .zip(by_vector.as_vec3().to_array())
            {
                *by_p += by;
            }
        }
    }
}

/// a b^T.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The derivative by a rotation vector w of tr(A^T [w]x).
fn axial(a: DMat3) -> DVec3 {
    let [x, y, z] = [a.x_axis, a.y_axis, a.z_axis];
    DVec3::new(y.z - z.y, z.x - x.z, x.y - y.x)
}

/// J^T t with J the left Jacobian of SO(3) at `r`: exp(r + d) = exp(J d) exp(r) to first order (Sola et al., "A micro Lie theory", 2018).
fn through_jacobian(r: DVec3, t: DVec3) -> DVec3 {
    let angle = r.length();
    let (first, second) = if angle < SMALL_ANGLE {
        (0.5, 1.0 / 6.0)
    } else {
        let square = angle * angle;
        (
            (1.0 - angle.cos()) / square,
            (angle - angle.sin()) / (square * angle),
        )
    };
    // The transpose of a cross product's matrix is its negative.
    let across = -r.cross(t);
    t + first * across + second * -r.cross(across)
}
