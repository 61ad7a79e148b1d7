//! Which places of the body model BlazePose's landmarks are, and what they and the user's hints ask of the fit.

use super::Hint;
use super::derivatives::Derivatives;
use super::model::BodyModel;
use super::normal_equations::NormalEquations;
use super::state::{Posed, State};
use crate::points::KeyPoint;
use glam::DVec3;
use motion_fit::landmarks::BODY_LANDMARKS;
use spmm3::Joint;

/// Landmarks that are joints: which, and their usual deviation from it, metres.
const JOINTS: [(usize, Joint, f64); 18] = [
    (2, Joint::LeftEye, 0.015),
    (5, Joint::RightEye, 0.015),
    (11, Joint::LeftShoulder, 0.03),
    (12, Joint::RightShoulder, 0.03),
    (13, Joint::LeftElbow, 0.02),
    (14, Joint::RightElbow, 0.02),
    (15, Joint::LeftWrist, 0.02),
    (16, Joint::RightWrist, 0.02),
    (17, Joint::LeftPinky1, 0.04),
    (18, Joint::RightPinky1, 0.04),
    (19, Joint::LeftIndex1, 0.04),
    (20, Joint::RightIndex1, 0.04),
    (23, Joint::LeftHip, 0.04),
    (24, Joint::RightHip, 0.04),
    (25, Joint::LeftKnee, 0.025),
    (26, Joint::RightKnee, 0.025),
    (27, Joint::LeftAnkle, 0.025),
    (28, Joint::RightAnkle, 0.025),
];

/// Landmarks of an eye are on its front: this far from its centre, metres.
const EYE_RADIUS: f64 = 0.014;

/// A hint's deviation, metres: more than a landmark's word.
const HINT: f64 = 0.005;

/// Rays of fewer views than about two (weighted) fix no point.
const SUPPORT: f64 = 2.0;

/// Beyond this many deviations a landmark loses weight.
const OUTLYING: f64 = 3.0;

/// A place of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    Joint(Joint),
    Vertex(usize),
}

/// A place, where it should be, and how sure that is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Target {
    pub(super) place: Place,
    pub(super) position: DVec3,
    /// Metres.
    pub(super) deviation: f64,
    /// The body landmark that asks for it; none: a hint.
    pub(super) landmark: Option<usize>,
    /// The landmark lies this far in front of the joint along the head's own z, metres.
    in_front: f64,
}

/// What the key points and the hints ask.
#[derive(Debug, Clone)]
pub(super) struct Targets {
    pub(super) all: Vec<Target>,
}

impl Targets {
    pub(super) fn new(
        model: &BodyModel,
        points: &[KeyPoint; BODY_LANDMARKS],
        hints: &[Hint],
    ) -> Self {
        let mut places: Vec<(usize, Place, f64, f64)> = JOINTS
            .iter()
            .map(|(landmark, joint, deviation)| {
                let in_front = if *landmark < 7 { EYE_RADIUS } else { 0.0 };
                (*landmark, Place::Joint(*joint), *deviation, in_front)
            })
            .collect();
        let vertices = marked_vertices(model);
        places.extend(
            (vertices.into_iter()).map(|(landmark, vertex, deviation)| {
                (landmark, Place::Vertex(vertex), deviation, 0.0)
            }),
        );
        let mut all: Vec<Target> = places
            .into_iter()
            .filter_map(|(landmark, place, usual, in_front)| {
                let point = points[landmark];
                let usable = point.support > 0.0
                    && point.position.is_finite()
                    && point.residual.is_finite();
                // Rays that miss one another are worth less, and so are few of them.
                let few = (SUPPORT / point.support).max(1.0);
                usable.then_some(Target {
                    place,
                    position: point.position,
                    deviation: usual.hypot((point.residual - 0.015).max(0.0)) * few,
                    landmark: Some(landmark),
                    in_front,
                })
            })
            .collect();
        all.extend(hints.iter().filter(|hint| hint.position.is_finite()).map(|hint| Target {
            place: Place::Joint(hint.joint),
            position: hint.position,
            deviation: HINT,
            landmark: None,
            in_front: 0.0,
        }));
        // A joint that the user names is where the user says, not where a network does.
        let hinted: Vec<Joint> = hints.iter().map(|hint| hint.joint).collect();
        all.retain(|target| {
            target.landmark.is_none()
                || !matches!(target.place, Place::Joint(joint) if hinted.contains(&joint))
        });
        Self { all }
    }

    /// What misses: target minus model, metres.
    pub(super) fn miss(target: &Target, state: &State, posed: &Posed) -> DVec3 {
        let head = state.rotations[Joint::Head.index()];
        let wanted = target.position - head * (DVec3::Z * target.in_front);
        wanted
            - match target.place {
                Place::Joint(joint) => posed.joints[joint.index()],
                Place::Vertex(vertex) => posed.vertices[vertex],
            }
    }

    /// Adds the targets' terms, `weight` times, those far off with less.
    pub(super) fn add(
        &self,
        weight: f64,
        state: &State,
        posed: &Posed,
        derivatives: &Derivatives<'_>,
        equations: &mut NormalEquations,
    ) {
        let mut row = vec![0.0; state.unknowns()];
        for target in &self.all {
            let miss = Self::miss(target, state, posed);
            let precision = weight / (target.deviation * target.deviation);
            let robust = if target.landmark.is_some() {
                let off = miss.length() / target.deviation / OUTLYING;
                precision / (1.0 + off * off)
            } else {
                2.0 * precision
            };
            for axis in DVec3::AXES {
                match target.place {
                    Place::Joint(joint) => derivatives.of_joint(joint, axis, &mut row),
                    Place::Vertex(vertex) => derivatives.of_vertex(vertex, axis, &mut row),
                }
                equations.add(&row, robust, axis.dot(miss));
            }
        }
    }

    /// Root mean square miss of the landmarks, metres.
    pub(super) fn error(&self, state: &State, posed: &Posed) -> f64 {
        let seen: Vec<f64> = (self.all.iter())
            .filter(|target| target.landmark.is_some())
            .map(|target| Self::miss(target, state, posed).length_squared())
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "a few dozen landmarks")]
        let count = seen.len().max(1) as f64;
        (seen.iter().sum::<f64>() / count).sqrt()
    }
}

/// Landmarks on the skin: which, the model's vertex there, and their usual deviation, metres. Nose, ears, heels, tips of the feet.
fn marked_vertices(model: &BodyModel) -> Vec<(usize, usize, f64)> {
    let at = |joint: Joint| model.joints[joint.index()];
    let place = |vertex: usize| model.rest[vertex];
    let most = |among: &dyn Fn(usize) -> bool, score: &dyn Fn(usize) -> f64| {
        (0..model.body_vertices)
            .filter(|vertex| among(*vertex))
            .max_by(|a, b| score(*a).total_cmp(&score(*b)))
    };
    let of_head = |vertex: usize| model.head_share(vertex) > 0.9;
    let eyes = at(Joint::LeftEye).y;
    let ground = (0..model.body_vertices).map(|v| place(v).y).fold(f64::INFINITY, f64::min);
    let mut found = vec![(
        0,
        most(
            &|v| of_head(v) && place(v).x.abs() < 0.004 && (place(v).y - eyes + 0.04).abs() < 0.02,
            &|v| place(v).z,
        ),
        0.015,
    )];
    let sides = [
        (7, 29, 31, 1.0, Joint::LeftAnkle, Joint::LeftFoot),
        (8, 30, 32, -1.0, Joint::RightAnkle, Joint::RightFoot),
    ];
    for (ear, heel, toe, sign, ankle, foot) in sides {
        let of_foot = move |vertex: usize| model.share(vertex, &[ankle, foot]) > 0.9;
        let toes = at(foot).x;
        let skull = at(Joint::Head).z;
        found.push((
            ear,
            most(
                &|v| {
                    of_head(v)
                        && (place(v).y - eyes + 0.005).abs() < 0.01
                        && (place(v).z - skull).abs() < 0.03
                },
                &|v| sign * place(v).x,
            ),
            0.02,
        ));
        found.push((
            heel,
            most(&|v| of_foot(v) && place(v).y < ground + 0.03, &|v| -place(v).z),
            0.03,
        ));
        found.push((
            toe,
            most(&|v| of_foot(v) && (place(v).x - toes).abs() < 0.04, &|v| place(v).z),
            0.03,
        ));
    }
    (found.into_iter())
        .filter_map(|(landmark, vertex, deviation)| Some((landmark, vertex?, deviation)))
        .collect()
}
