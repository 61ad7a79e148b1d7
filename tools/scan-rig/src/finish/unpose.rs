//! From the pose of the scan to the template's T-pose: linear blend skinning, inverted vertex by vertex.

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use spmm3::{JOINTS, SkinWeights};

/// A blended map with a smaller determinant has collapsed (joints turned against each other by nearly 180 degrees): the strongest
/// joint's own is taken.
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
    /// For each joint the rigid map that takes a point from pose `from` to this one.
    #[must_use]
    pub fn maps_from(&self, from: &Self) -> [DAffine3; JOINTS] {
        std::array::from_fn(|j| {
            let turn = self.rotations[j] * from.rotations[j].transpose();
            DAffine3::from_mat3_translation(turn, self.joints[j] - turn * from.joints[j])
        })
    }

    /// The same pose, everything moved by `offset`, metres.
    #[must_use]
    pub fn moved(mut self, offset: DVec3) -> Self {
        self.joints.iter_mut().for_each(|j| *j += offset);
        self
    }
}

/// A vertex' blend of its joints' maps.
#[must_use]
pub fn blend(maps: &[DAffine3; JOINTS], skin: &SkinWeights) -> DAffine3 {
    let mut sum = DAffine3 {
        matrix3: DMat3::ZERO,
        translation: DVec3::ZERO,
    };
    for (joint, weight) in skin.joints.iter().zip(skin.weights) {
        if let Some(map) = maps.get(usize::from(*joint)) {
            sum.matrix3 += map.matrix3 * f64::from(weight);
            sum.translation += map.translation * f64::from(weight);
        }
    }
    sum
}

/// The vertices whose skinning by `scan_from_template` gives `posed`, metres, `[N_v]`.
#[must_use]
pub fn unpose(
    posed: &[DVec3],
    skin: &[SkinWeights],
    scan_from_template: &[DAffine3; JOINTS],
) -> Vec<DVec3> {
    (posed, skin)
        .into_par_iter()
        .map(|(vertex, skin)| {
            let mut map = blend(scan_from_template, skin);
            if map.matrix3.determinant() < COLLAPSED {
                map = strongest(scan_from_template, skin);
            }
            map.inverse().transform_point3(*vertex)
        })
        .collect()
}

fn strongest(maps: &[DAffine3; JOINTS], skin: &SkinWeights) -> DAffine3 {
    let pairs = skin.joints.iter().zip(skin.weights);
    let joint = pairs.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |p| *p.0);
    maps.get(usize::from(joint)).copied().unwrap_or_default()
}
