//! A second BVH reader and forward kinematics in f64, independent of the library: it trusts its input.

use glam::{DMat3, DVec3};
use spmm3::{Joint, MotionParams, Skeleton};
use std::collections::HashMap;

/// A BVH as it stands in the file.
pub(crate) struct Bvh {
    names: Vec<String>,
    parents: Vec<Option<usize>>,
    offsets: Vec<DVec3>,
    channels: Vec<Vec<String>>,
    pub(crate) frames: Vec<Vec<f64>>,
}

impl Bvh {
    pub(crate) fn read(text: &str) -> Self {
        let mut bvh = Self {
            names: vec![],
            parents: vec![],
            offsets: vec![],
            channels: vec![],
            frames: vec![],
        };
        let (head, motion) = text.split_once("MOTION").expect("MOTION");
        // An End Site pushes `None`, so that its offset goes nowhere.
        let mut open: Vec<Option<usize>> = vec![];
        for line in head.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.first().copied() {
                Some("ROOT" | "JOINT") => {
                    bvh.names.push(words[1].to_owned());
                    bvh.parents.push(open.last().copied().flatten());
                    bvh.offsets.push(DVec3::ZERO);
                    bvh.channels.push(vec![]);
                    open.push(Some(bvh.names.len() - 1));
                }
                Some("End") => open.push(None),
                Some("}") => {
                    open.pop();
                }
                Some("OFFSET") => {
                    if let Some(Some(joint)) = open.last() {
                        let v: Vec<f64> = words[1..4]
                            .iter()
                            .map(|w| w.parse().expect("offset"))
                            .collect();
                        bvh.offsets[*joint] = DVec3::from_slice(&v);
                    }
                }
                Some("CHANNELS") => {
                    let joint = open.last().copied().flatten().expect("a joint");
                    bvh.channels[joint] = words[2..].iter().map(|w| (*w).to_owned()).collect();
                }
                _ => {}
            }
        }
        bvh.frames = motion
            .lines()
            .filter(|line| !line.contains("Frame") && !line.trim().is_empty())
            .map(|line| {
                line.split_whitespace()
                    .map(|w| w.parse().expect("value"))
                    .collect()
            })
            .collect();
        bvh
    }

    /// Frames of all joints by name at rest.
    pub(crate) fn rest(&self) -> HashMap<&str, (DVec3, DMat3)> {
        let mut at: Vec<DVec3> = vec![];
        for joint in 0..self.names.len() {
            let above = self.parents[joint].map_or(DVec3::ZERO, |parent| at[parent]);
            at.push(above + self.offsets[joint]);
        }
        let frames = at.into_iter().map(|at| (at, DMat3::IDENTITY));
        self.names.iter().map(String::as_str).zip(frames).collect()
    }

    /// World frames of all joints by name, in the file's axes and units.
    ///
    /// `added`: below the root, position channels add to the offset (MakeHuman's files) instead of replacing it.
    pub(crate) fn pose(&self, frame: usize, added: bool) -> HashMap<&str, (DVec3, DMat3)> {
        let mut values = self.frames[frame].iter();
        let mut world: Vec<(DVec3, DMat3)> = vec![];
        for joint in 0..self.names.len() {
            let mut offset = self.offsets[joint];
            let mut turn = DMat3::IDENTITY;
            for channel in &self.channels[joint] {
                let value = *values.next().expect("a value per channel");
                let axis = "XYZ".find(&channel[..1]).expect("an axis");
                if channel.ends_with("position") {
                    let whole = !added || self.parents[joint].is_none();
                    offset[axis] = if whole { value } else { offset[axis] + value };
                } else {
                    let r = value.to_radians();
                    turn *= match axis {
                        0 => DMat3::from_rotation_x(r),
                        1 => DMat3::from_rotation_y(r),
                        _ => DMat3::from_rotation_z(r),
                    };
                }
            }
            world.push(match self.parents[joint] {
                Some(parent) => {
                    let (at, above) = world[parent];
                    (at + above * offset, above * turn)
                }
                None => (offset, turn),
            });
        }
        self.names.iter().map(String::as_str).zip(world).collect()
    }
}

/// Rodrigues' formula.
fn rotation(axis_angle: DVec3) -> DMat3 {
    let angle = axis_angle.length();
    if angle < 1e-12 {
        return DMat3::IDENTITY;
    }
    let k = axis_angle / angle;
    let cross = DMat3::from_cols(
        DVec3::new(0.0, k.z, -k.y),
        DVec3::new(-k.z, 0.0, k.x),
        DVec3::new(k.y, -k.x, 0.0),
    );
    DMat3::IDENTITY + cross * angle.sin() + cross * cross * (1.0 - angle.cos())
}

/// World frames of our 55 joints, root translation included.
pub(crate) fn person(skeleton: &Skeleton, motion: &MotionParams) -> Vec<(DVec3, DMat3)> {
    let rest = |joint: Joint| skeleton.rest_positions()[joint.index()].as_dvec3();
    let mut world: Vec<(DVec3, DMat3)> = vec![];
    for joint in Joint::ALL {
        let turn = rotation(motion.axis_angle(joint).as_dvec3());
        world.push(match joint.parent() {
            Some(parent) => {
                let (at, above) = world[parent.index()];
                (at + above * (rest(joint) - rest(parent)), above * turn)
            }
            None => (rest(joint) + motion.root_translation.as_dvec3(), turn),
        });
    }
    world
}

/// Height of the lowest of six points under heels, balls and toe tips, which lie on y = 0 in T-pose.
pub(crate) fn lowest_sole(skeleton: &Skeleton, motion: &MotionParams) -> f64 {
    let world = person(skeleton, motion);
    let rest = |joint: Joint| skeleton.rest_positions()[joint.index()].as_dvec3();
    let mut lowest = f64::INFINITY;
    for (ankle, foot) in [
        (Joint::LeftAnkle, Joint::LeftFoot),
        (Joint::RightAnkle, Joint::RightFoot),
    ] {
        let (a, f) = (rest(ankle), rest(foot));
        let points = [
            (ankle, DVec3::new(a.x, 0.0, a.z - 0.055)),
            (ankle, DVec3::new(f.x, 0.0, f.z)),
            (foot, DVec3::new(f.x, 0.0, f.z + 0.07)),
        ];
        for (joint, point) in points {
            let (at, turn) = world[joint.index()];
            lowest = lowest.min((at + turn * (point - rest(joint))).y);
        }
    }
    lowest
}

/// Angle between two vectors, degrees.
pub(crate) fn degrees_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}
