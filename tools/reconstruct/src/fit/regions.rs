//! The parts F_mesh is made of: regions of the mesh, each with the joints that can affect it.
//!
//! A region's units see its own joints only. That is what makes a few hundred poses enough: an elbow need not be sampled
//! together with every stance.

use crate::simulate::{Fabric, Puppet, arm_share};
use spmm3::{BODY, Joint, MotionParams};

/// One region: its inputs, by joint, how many hidden units and offset fields it gets.
#[derive(Debug, Clone)]
pub(super) struct Region {
    /// Groups of inputs, one a joint.
    pub(super) groups: Vec<Vec<usize>>,
    /// Units of each hidden layer.
    pub(super) units: usize,
    /// Offset fields.
    pub(super) fields: usize,
}

/// The most regions.
const REGIONS: usize = 6;

/// `[N_v]` region of each vertex, and the regions, sized to fill `units` and `fields`.
pub(super) fn regions(
    puppet: &Puppet,
    expressions: usize,
    units: usize,
    fields: usize,
) -> (Vec<usize>, Vec<Region>) {
    use Joint::*;
    let trunk = [
        Spine1,
        Spine2,
        Spine3,
        LeftCollar,
        RightCollar,
        LeftShoulder,
        RightShoulder,
    ];
    let with = |more: &[Joint]| -> Vec<Joint> { trunk.iter().chain(more).copied().collect() };
    let mut face: Vec<Vec<usize>> = groups(&[Jaw]);
    face.extend((BODY..BODY + expressions).map(|e| vec![e]));
    // Hanging cloth, left arm, right arm, legs, the rest, face; in 224 units and 48 fields.
    let all: [(Vec<Vec<usize>>, usize, usize); REGIONS] = [
        (
            groups(&with(&[LeftHip, RightHip, LeftElbow, RightElbow])),
            104,
            27,
        ),
        (
            groups(&[LeftCollar, LeftShoulder, LeftElbow, LeftWrist]),
            20,
            4,
        ),
        (
            groups(&[RightCollar, RightShoulder, RightElbow, RightWrist]),
            20,
            4,
        ),
        (
            groups(&[LeftHip, RightHip, LeftKnee, RightKnee, Spine1]),
            32,
            5,
        ),
        (groups(&with(&[Neck, Head, LeftHip, RightHip])), 24, 4),
        (face, 24, 4),
    ];
    let scaled = |share: usize, of: usize, total: usize| (share * total / of).max(1);
    let mut regions: Vec<Region> = all
        .into_iter()
        .map(|(groups, u, f)| Region {
            groups,
            units: scaled(u, 224, units),
            fields: scaled(f, 48, fields),
        })
        .collect();
    // Rounding leaves some over: the hanging cloth takes them.
    regions[0].units += units - regions.iter().map(|r| r.units).sum::<usize>();
    regions[0].fields += fields - regions.iter().map(|r| r.fields).sum::<usize>();
    let mut riders = vec![false; puppet.looseness.len()];
    puppet
        .riders
        .iter()
        .for_each(|v| riders[*v as usize] = true);
    let of = (0..puppet.looseness.len())
        .map(|v| {
            let skin = puppet.template.skin()[v].dense();
            let share = |joints: &[Joint]| joints.iter().map(|j| skin[j.index()]).sum::<f32>();
            if puppet.fabric[v] == Fabric::Face {
                5
            } else if arm_share(&skin) > 0.4 {
                if puppet.template.vertices()[v].x > 0.0 {
                    1
                } else {
                    2
                }
            } else if share(&[
                LeftKnee, RightKnee, LeftAnkle, RightAnkle, LeftHip, RightHip,
            ]) > 0.3
                && !riders[v]
                && puppet.looseness[v] < 0.02
            {
                3
            } else if puppet.looseness[v] > 0.0 || riders[v] {
                0
            } else {
                4
            }
        })
        .collect();
    (of, regions)
}

fn groups(joints: &[Joint]) -> Vec<Vec<usize>> {
    joints
        .iter()
        .map(|joint| {
            (0..3)
                .map(|k| MotionParams::offset_of(*joint) + k)
                .collect()
        })
        .collect()
}
