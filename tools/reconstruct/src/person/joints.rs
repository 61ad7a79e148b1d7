//! From the 163 bones of MakeHuman's rig to SMPL-X's 55 joints.

use crate::ReconstructError;
use crate::makehuman::{BoneWeights, Quad, Rig};
use glam::Vec3;
use spmm3::{INFLUENCES, JOINTS, Joint, SkinWeights};
use std::path::Path;

/// The SMPL-X joint that takes over a bone's weights.
pub(super) fn joint_of_bone(bone: &str) -> Option<Joint> {
    let (name, side) = match bone.strip_suffix(".L") {
        Some(name) => (name, "left_"),
        None => bone
            .strip_suffix(".R")
            .map_or((bone, ""), |name| (name, "right_")),
    };
    let sided = |joint: &str| named(&format!("{side}{joint}"));
    let starts = |prefix: &str| name.starts_with(prefix);
    if let Some((finger, phalanx)) = name.strip_prefix("finger").and_then(|f| f.split_once('-')) {
        let finger = match finger {
            "1" => "thumb",
            "2" => "index",
            "3" => "middle",
            "4" => "ring",
            _ => "pinky",
        };
        return sided(&format!("{finger}{phalanx}"));
    }
    match name {
        "root" | "spine05" | "pelvis" => Some(Joint::Pelvis),
        "spine04" => Some(Joint::Spine1),
        "spine03" => Some(Joint::Spine2),
        "spine02" | "spine01" | "breast" => Some(Joint::Spine3),
        // The lower lip opens with the jaw; `oris06` without a side is the upper lip and stays with the head.
        "jaw" | "special04" | "oris01" | "oris02" | "oris07" => Some(Joint::Jaw),
        "oris06" if !side.is_empty() => Some(Joint::Jaw),
        "eye" => sided("eye_smplhf"),
        "clavicle" | "shoulder01" => sided("collar"),
        "upperarm01" | "upperarm02" => sided("shoulder"),
        "lowerarm01" | "lowerarm02" => sided("elbow"),
        "wrist" => sided("wrist"),
        "upperleg01" | "upperleg02" => sided("hip"),
        "lowerleg01" | "lowerleg02" => sided("knee"),
        "foot" => sided("ankle"),
        _ if starts("neck") => Some(Joint::Neck),
        _ if starts("metacarpal") => sided("wrist"),
        _ if starts("toe") => sided("foot"),
        _ if starts("tongue") => Some(Joint::Jaw),
        _ => Some(Joint::Head),
    }
}

fn named(name: &str) -> Option<Joint> {
    Joint::ALL.into_iter().find(|j| j.name() == name)
}

/// The bone whose head is a joint's position.
fn pivot_of_joint(joint: Joint) -> String {
    let name = joint.name();
    let (bare, side) = match name.strip_prefix("left_") {
        Some(bare) => (bare, ".L"),
        None => name
            .strip_prefix("right_")
            .map_or((name, ""), |bare| (bare, ".R")),
    };
    let bone = match bare {
        "pelvis" => "spine05",
        "spine1" => "spine04",
        "spine2" => "spine03",
        "spine3" => "spine02",
        "neck" => "neck01",
        "eye_smplhf" => "eye",
        "collar" => "clavicle",
        "shoulder" => "upperarm01",
        "elbow" => "lowerarm01",
        "hip" => "upperleg01",
        "knee" => "lowerleg01",
        "ankle" => "foot",
        "foot" => "toe2-1",
        _ => match bare.split_at(bare.len() - 1) {
            ("thumb", phalanx) => return format!("finger1-{phalanx}{side}"),
            ("index", phalanx) => return format!("finger2-{phalanx}{side}"),
            ("middle", phalanx) => return format!("finger3-{phalanx}{side}"),
            ("ring", phalanx) => return format!("finger4-{phalanx}{side}"),
            ("pinky", phalanx) => return format!("finger5-{phalanx}{side}"),
            _ => bare,
        },
    };
    format!("{bone}{side}")
}

/// Positions of the 55 joints, given where the rig's bones begin.
pub(super) fn joint_positions(
    rig: &Rig,
    heads: &[Vec3],
    source: &Path,
) -> Result<[Vec3; JOINTS], ReconstructError> {
    let mut positions = [Vec3::ZERO; JOINTS];
    for joint in Joint::ALL {
        let bone = pivot_of_joint(joint);
        let head = rig.find(&bone).and_then(|b| heads.get(b)).ok_or_else(|| {
            ReconstructError::content(source, format!("the rig has no bone {bone}"))
        })?;
        positions[joint.index()] = *head;
    }
    Ok(positions)
}

/// Which joint each bone of the rig goes to.
pub(super) fn joints_of_rig(rig: &Rig, source: &Path) -> Result<Vec<Joint>, ReconstructError> {
    rig.bones()
        .iter()
        .map(|bone| {
            joint_of_bone(&bone.name).ok_or_else(|| {
                let what = format!("bone {} belongs to no SMPL-X joint", bone.name);
                ReconstructError::content(source, what)
            })
        })
        .collect()
}

/// Sums weights over the bones of each joint: `[N_v][55]`.
pub(super) fn collapse_weights(weights: &[BoneWeights], joints: &[Joint]) -> Vec<[f32; JOINTS]> {
    weights
        .iter()
        .map(|row| {
            let mut dense = [0.0; JOINTS];
            for (bone, weight) in row {
                if let Some(joint) = joints.get(usize::from(*bone)) {
                    dense[joint.index()] += weight;
                }
            }
            dense
        })
        .collect()
}

/// Rounds of averaging cloth's weights with the neighbours'.
const CLOTH_SMOOTHING: usize = 6;

/// Spreads the weights of cloth over its surface. The files' weights step from the trunk to a sleeve over one edge,
/// which tears when an arm is raised; `is_cloth` says which vertices to smooth.
pub(super) fn smooth_cloth(dense: &mut [[f32; JOINTS]], quads: &[Quad], is_cloth: &[bool]) {
    let mut neighbours = vec![Vec::new(); dense.len()];
    for quad in quads {
        for k in 0..4 {
            let (a, b) = (quad.corners[k] as usize, quad.corners[(k + 1) % 4] as usize);
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
    }
    for _ in 0..CLOTH_SMOOTHING {
        let before = dense.to_vec();
        for (vertex, near) in neighbours.iter().enumerate().filter(|(v, _)| is_cloth[*v]) {
            let share = 0.5 / near.len().max(1) as f32;
            for joint in 0..JOINTS {
                let around: f32 = near.iter().map(|n| before[*n][joint]).sum();
                dense[vertex][joint] = 0.5 * before[vertex][joint] + share * around;
            }
        }
    }
}

/// Keeps the strongest joints of a dense row and makes them sum to 1.
pub(super) fn strongest(dense: &[f32; JOINTS]) -> SkinWeights {
    let mut order: [u8; JOINTS] = Joint::ALL.map(|j| j as u8);
    order.sort_by(|a, b| dense[usize::from(*b)].total_cmp(&dense[usize::from(*a)]));
    let mut skin = SkinWeights::default();
    let kept = &order[..INFLUENCES];
    let sum: f32 = kept.iter().map(|j| dense[usize::from(*j)]).sum();
    for (slot, joint) in kept.iter().enumerate() {
        let weight = dense[usize::from(*joint)];
        if weight > 0.0 {
            skin.joints[slot] = *joint;
            skin.weights[slot] = weight / sum;
        }
    }
    skin
}
