//! From the pose of the scan to the template's T-pose: linear blend skinning, inverted vertex by vertex.

use crate::body::posing::{between, blended, strongest};
use crate::body::{BodyModel, Registered, SkinRow, posing};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use spmm3::{INFLUENCES, JOINTS, Joint, SkinWeights};

/// A blended map with a smaller determinant has nearly collapsed (joints turned against each other), and its inverse would throw
/// vertices far away: the strongest joint's own map is taken.
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
        Self::chained(&posing::t_pose(&rest), &rest, registered.scale)
    }

    /// Joints turned so, the pelvis at the origin; `rest` are the body's joints in the rest pose.
    #[must_use]
    pub fn chained(rotations: &[DMat3; JOINTS], rest: &[DVec3; JOINTS], scale: f64) -> Self {
        Self {
            rotations: *rotations,
            joints: posing::chain(rotations, DVec3::ZERO, scale, rest),
        }
    }

    /// For each joint the rigid map that takes a point from pose `from` to this one.
    #[must_use]
    pub fn maps_from(&self, from: &Self) -> [DAffine3; JOINTS] {
        between(
            (&from.rotations, &from.joints),
            (&self.rotations, &self.joints),
        )
    }

    /// The same pose, everything moved by `offset`, metres.
    #[must_use]
    pub fn moved(mut self, offset: DVec3) -> Self {
        self.joints.iter_mut().for_each(|j| *j += offset);
        self
    }
}

/// The vertices whose skinning by `scan_from_template` gives `posed`, metres, `[N_v]`.
pub(super) fn unpose(
    posed: &[DVec3],
    weights: &[SkinRow],
    scan_from_template: &[DAffine3; JOINTS],
) -> Vec<DVec3> {
    (posed, weights)
        .into_par_iter()
        .map(|(vertex, row)| {
            let mut map = blended(row, scan_from_template);
            if map.matrix3.determinant() < COLLAPSED {
                map = scan_from_template[strongest(row)];
            }
            map.inverse().transform_point3(*vertex)
        })
        .collect()
}

/// The strongest joints of a row, as an avatar keeps them.
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
    if sum <= 0.0 {
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
