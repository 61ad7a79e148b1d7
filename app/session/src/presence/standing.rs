//! A person in their own motion space as presence needs them: body joints, soles and heading, from one pass of kinematics.

use super::viewer::level;
use glam::{Vec2, Vec3, Vec3Swizzles};
use spmm3::{Joint, MotionParams, Skeleton};
use std::array::from_fn;

/// SMPL-X's joints before the jaw: the body without face and fingers.
pub const BODY_JOINTS: usize = 22;

/// Points along one edge of a sole, from heel to toe.
const EDGE_POINTS: usize = 7;
/// Points along both edges of a sole.
pub const SOLE_POINTS: usize = 2 * EDGE_POINTS;

/// How far the heel lies behind the ankle, the toes before the ball, and either edge of the sole beside them, in lengths
/// from ankle to ball.
const HEEL: f32 = 0.45;
const TOE: f32 = 0.45;
const EDGE: f32 = 0.28;

/// Motion space is no larger, metres.
const FURTHEST: f32 = 1_000.0;

const FEET: [[Joint; 2]; 2] = [
    [Joint::LeftAnkle, Joint::LeftFoot],
    [Joint::RightAnkle, Joint::RightFoot],
];

/// How a person stands at one moment, in their motion space, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    pub(super) body: [Vec3; BODY_JOINTS],
    /// Along the edges of the left foot's sole and of the right's.
    pub(super) soles: [[Vec3; SOLE_POINTS]; 2],
    /// Turn about y from +z to where the person faces, radians.
    pub(super) heading: f32,
}

/// The first person whose pose is known, apart from the first `own` ones, who are the viewer.
pub(crate) fn first_apart(standing: &[Option<Standing>], own: usize) -> Option<usize> {
    let others = standing.iter().enumerate().skip(own);
    let mut known = others.filter(|(_, standing)| standing.is_some());
    known.next().map(|(person, _)| person)
}

impl Standing {
    /// From the avatar's skeleton and what it is shown to do. Nothing where a number is not finite or a kilometre away.
    #[must_use]
    pub fn of(skeleton: &Skeleton, motion: &MotionParams) -> Option<Self> {
        let joints = skeleton.pose(motion);
        let root = motion.root_translation;
        let body = from_fn(|k| joints.position(Joint::ALL[k]) + root);
        let soles = FEET.map(|[ankle, ball]| {
            let [ankle_at, ball_at] = [ankle, ball].map(|j| skeleton.rest_positions()[j.index()]);
            let length = (ball_at - ankle_at).xz();
            let point = |share: f32, aside: f32| {
                let rest = ankle_at.xz() + length * share + length.perp() * aside;
                let joint = if share < 1.0 { ankle } else { ball };
                let from_joint = skeleton.rest_positions()[joint.index()];
                let rest = Vec3::new(rest.x, 0.0, rest.y) - from_joint;
                joints.person_from_joint[joint.index()].transform_point3(rest) + root
            };
            from_fn(|k| {
                let along = (k % EDGE_POINTS) as f32 / (EDGE_POINTS - 1) as f32;
                let aside = if k < EDGE_POINTS { EDGE } else { -EDGE };
                point(-HEEL + along * (1.0 + HEEL + TOE), aside)
            })
        });
        let pelvis = joints.person_from_joint[Joint::Pelvis.index()].matrix3;
        let ahead = level(pelvis.z_axis.to_vec3(), pelvis.y_axis.to_vec3());
        let standing = Self {
            body,
            soles,
            heading: ahead.x.atan2(ahead.y),
        };
        let mut points = standing.body.iter().chain(standing.soles.as_flattened());
        points
            .all(|point| point.is_finite() && point.abs().max_element() <= FURTHEST)
            .then_some(standing)
    }

    /// The point of the floor below the pelvis: x and z, metres.
    pub(super) fn spot(&self) -> Vec2 {
        self.joint(Joint::Pelvis).xz()
    }

    /// Position of a body joint.
    pub(super) fn joint(&self, joint: Joint) -> Vec3 {
        self.body.get(joint.index()).copied().unwrap_or_default()
    }
}
