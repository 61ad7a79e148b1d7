//! The body that a BVH shows, in our axes: at rest, in each frame, and how large it is.

use super::{LoadOptions, MotionError, bvh::Bvh, names::Parts};
use crate::{Joint, Skeleton};
use glam::{Mat3, Quat, Vec3};

/// Metres per unit that files use, with their names.
const UNITS: [(f32, &str); 6] = [
    (1.0, "metres"),
    (0.1, "decimetres"),
    (0.01, "centimetres"),
    (0.001, "millimetres"),
    (0.0254, "inches"),
    (0.3048, "feet"),
];

/// Joint frames of the source body in our axes (person's left +x, up +y, forward +z), still in file units.
pub(super) struct Pose {
    pub(super) positions: Vec<Vec3>,
    pub(super) rotations: Vec<Quat>,
}

impl Pose {
    pub(super) fn along(&self, from: usize, to: usize) -> Option<Vec3> {
        (self.positions[to] - self.positions[from]).try_normalize()
    }
}

/// The source body at rest, and its frames.
pub(super) struct Source<'a> {
    pub(super) bvh: &'a Bvh,
    our_from_file: Quat,
    pub(super) rest: Pose,
    leg: f32,
    pub(super) axes_note: String,
}

impl<'a> Source<'a> {
    pub(super) fn new(bvh: &'a Bvh, parts: &Parts) -> Result<Self, MotionError> {
        let lost = |what: &str| MotionError::Skeleton {
            missing: what.to_owned(),
            found: "joints that lie on each other".to_owned(),
        };
        let need = |joint: Joint| parts.named(joint).ok_or_else(|| lost(joint.name()));
        let hips = [need(Joint::LeftHip)?, need(Joint::RightHip)?];
        let knees = [need(Joint::LeftKnee)?, need(Joint::RightKnee)?];
        let ankles = [need(Joint::LeftAnkle)?, need(Joint::RightAnkle)?];
        let head = need(Joint::Head)?;
        let mut source = Self {
            bvh,
            our_from_file: Quat::IDENTITY,
            rest: Pose {
                positions: Vec::new(),
                rotations: Vec::new(),
            },
            leg: 0.0,
            axes_note: String::new(),
        };
        let file = source.at_rest();
        let at = |joint: usize| file.positions[joint];
        let feet = (at(ankles[0]) + at(ankles[1])) * 0.5;
        let up = nearest_axis(at(head) - feet, None).ok_or_else(|| lost("upright rest pose"))?;
        let left = nearest_axis(at(hips[0]) - at(hips[1]), Some(up))
            .ok_or_else(|| lost("distance between the hips"))?;
        let forward = left.cross(up);
        let file_from_our = Mat3::from_cols(left, up, forward);
        source.our_from_file = Quat::from_mat3(&file_from_our).conjugate();
        source.axes_note = format!(
            "axes: up is {}, the rest pose faces {}; turned to y up, facing z",
            axis_name(up),
            axis_name(forward)
        );
        source.rest = source.at_rest();
        let length = |side: usize| {
            let at = |joint: usize| source.rest.positions[joint];
            at(hips[side]).distance(at(knees[side])) + at(knees[side]).distance(at(ankles[side]))
        };
        source.leg = (length(0) + length(1)) * 0.5;
        if source.leg.is_finite() && source.leg > 1e-6 {
            Ok(source)
        } else {
            Err(lost("leg of any length"))
        }
    }

    fn at_rest(&self) -> Pose {
        self.chain(|joint| (self.bvh.joints[joint].offset, Quat::IDENTITY))
    }

    pub(super) fn pose(&self, frame: usize) -> Pose {
        self.chain(|joint| self.bvh.local(frame, joint))
    }

    /// Forward kinematics of the file's tree, turned into our axes.
    fn chain(&self, local: impl Fn(usize) -> (Vec3, Quat)) -> Pose {
        let turn = self.our_from_file;
        let count = self.bvh.joints.len();
        let mut pose = Pose {
            positions: Vec::with_capacity(count),
            rotations: Vec::with_capacity(count),
        };
        for (index, joint) in self.bvh.joints.iter().enumerate() {
            let (translation, rotation) = local(index);
            let translation = turn * translation;
            let rotation = turn * rotation * turn.conjugate();
            let (position, rotation) = match joint.parent {
                Some(parent) => {
                    let above = pose.rotations[parent];
                    (
                        pose.positions[parent] + above * translation,
                        (above * rotation).normalize(),
                    )
                }
                None => (translation, rotation),
            };
            pose.positions.push(position);
            pose.rotations.push(rotation);
        }
        pose
    }

    /// The one axis about which joint `lower` turns against `upper` in all frames, if there is one; positive is the way
    /// it turns.
    pub(super) fn hinge(&self, upper: usize, lower: usize) -> Option<Vec3> {
        let step = (self.bvh.frames() / 100).max(1);
        let turns: Vec<Vec3> = (0..self.bvh.frames())
            .step_by(step)
            .map(|frame| {
                let pose = self.pose(frame);
                let turn = pose.rotations[upper].conjugate() * pose.rotations[lower];
                if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis()
            })
            .collect();
        let most = turns
            .iter()
            .max_by(|a, b| a.length().total_cmp(&b.length()))
            .filter(|turn| turn.length() > 0.35)?;
        let axis = most.normalize();
        turns
            .iter()
            .all(|turn| turn.reject_from_normalized(axis).length() < 0.03)
            .then_some(axis)
    }

    /// Metres of our body per file unit of travel, sideways (x, z) and up (y).
    pub(super) fn travel(
        &self,
        skeleton: &Skeleton,
        options: &LoadOptions,
        notes: &mut Vec<String>,
    ) -> Result<Vec3, MotionError> {
        let ours = leg_length(skeleton);
        let fitted = ours / self.leg;
        if let Some(scale) = options.bvh_scale {
            if !(scale.is_finite() && scale > 0.0) {
                return Err(MotionError::Request(format!(
                    "a BVH scale of {scale} makes no sense; give metres per file unit, for example 0.01 for centimetres"
                )));
            }
            notes.push(format!(
                "units: {scale} m as asked, legs of {:.2} m; travel over the floor is not fitted",
                self.leg * scale
            ));
            return Ok(Vec3::new(scale, fitted, scale));
        }
        let error = |unit: f32| (self.leg * unit / ours).ln().abs();
        let (unit, name) = UNITS
            .into_iter()
            .min_by(|a, b| error(a.0).total_cmp(&error(b.0)))
            .unwrap_or(UNITS[0]);
        notes.push(format!(
            "units: {name}, legs of {:.2} m; travel is scaled by {:.3} to this avatar's {ours:.2} m",
            self.leg * unit,
            fitted / unit
        ));
        Ok(Vec3::splat(fitted))
    }
}
/// Mean length of thigh and shank together, metres.
fn leg_length(skeleton: &Skeleton) -> f32 {
    [
        Joint::LeftKnee,
        Joint::LeftAnkle,
        Joint::RightKnee,
        Joint::RightAnkle,
    ]
    .into_iter()
    .map(|joint| skeleton.rest_offset(joint).length())
    .sum::<f32>()
        * 0.5
}

/// The coordinate axis nearest to a direction, but square to `square_to`.
fn nearest_axis(direction: Vec3, square_to: Option<Vec3>) -> Option<Vec3> {
    let candidates = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    let best = candidates
        .filter(|axis| square_to.is_none_or(|other| axis.dot(other).abs() < 0.5))
        .max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)))?;
    (best.dot(direction) > 1e-6).then_some(best)
}

fn axis_name(axis: Vec3) -> String {
    let letter = ["x", "y", "z"]
        .into_iter()
        .zip(axis.to_array())
        .find(|(_, v)| v.abs() > 0.5);
    letter.map_or_else(String::new, |(name, v)| {
        format!("{}{name}", if v < 0.0 { "-" } else { "" })
    })
}
