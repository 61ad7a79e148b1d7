//! Which places of the body model BlazePose's landmarks are, and what they and the user's hints ask of the fit.

use super::Hint;
use super::derivatives::Derivatives;
use super::face::OnFace;
use super::model::BodyModel;
use super::normal_equations::NormalEquations;
use super::state::Posed;
use crate::points::KeyPoint;
use crate::prepare::landmarks::mirrored;
use glam::DVec3;
use motion_fit::landmarks::BODY_LANDMARKS;
use spmm3::Joint;

/// A landmark near a joint.
struct NearJoint {
    landmark: usize,
    joint: Joint,
    /// What carries the offset along.
    carrier: Joint,
    /// How far the landmark usually is from the joint, in the rest pose, metres. Means over synthetic people and a scanned one: the network and
    /// MakeHuman have their own ideas of where a shoulder is.
    offset: [f64; 3],
    /// How much it usually differs from that, metres.
    deviation: f64,
}

const fn near(
    landmark: usize,
    joint: Joint,
    carrier: Joint,
    offset: [f64; 3],
    deviation: f64,
) -> NearJoint {
    NearJoint {
        landmark,
        joint,
        carrier,
        offset,
        deviation,
    }
}

use Joint as J;

/// Landmarks near joints of the left side; those of the right side, whose numbers follow, mirror them.
const LEFT: [NearJoint; 9] = [
    near(2, J::LeftEye, J::Head, [-0.002, 0.005, 0.008], 0.015),
    near(11, J::LeftShoulder, J::Spine3, [0.004, 0.026, -0.004], 0.02),
    near(13, J::LeftElbow, J::LeftShoulder, [0.0, 0.0, 0.004], 0.02),
    near(15, J::LeftWrist, J::LeftElbow, [0.002, -0.005, 0.008], 0.02),
    near(
        17,
        J::LeftPinky1,
        J::LeftWrist,
        [-0.008, 0.012, 0.007],
        0.03,
    ),
    near(
        19,
        J::LeftIndex1,
        J::LeftWrist,
        [-0.005, -0.008, -0.018],
        0.03,
    ),
    near(23, J::LeftHip, J::Pelvis, [-0.001, -0.014, 0.022], 0.03),
    // On a straight leg in one colour the network's knee is up to 0.07 too high.
    near(25, J::LeftKnee, J::LeftHip, [0.0, 0.008, 0.0], 0.09),
    near(27, J::LeftAnkle, J::LeftKnee, [-0.003, 0.022, 0.0], 0.02),
];

/// The joint of the other side.
fn other_side(joint: Joint) -> Joint {
    let name = joint.name().replacen("left_", "right_", 1);
    Joint::ALL
        .into_iter()
        .find(|joint| joint.name() == name)
        .unwrap_or(joint)
}

/// The deviation of one of the face's landmarks, metres: they are many, and err together; all of them are worth a few good points.
const FACE: f64 = 0.04;

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
    pub(super) source: Source,
    /// How far the position is from the place in the rest pose, metres.
    pub(super) offset: DVec3,
    /// The joint that carries the offset along.
    pub(super) carrier: Joint,
}

/// Who says where a place should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// BlazePose's landmark of this number.
    Body(usize),
    Face,
    Hint,
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
        face: &[OnFace],
        hints: &[Hint],
    ) -> Self {
        let mirror = DVec3::new(-1.0, 1.0, 1.0);
        let joints = LEFT.iter().flat_map(|left| {
            let offset = DVec3::from_array(left.offset);
            let place = Place::Joint(left.joint);
            let other = Place::Joint(other_side(left.joint));
            let carriers = [left.carrier, other_side(left.carrier)];
            [
                (left.landmark, place, offset, carriers[0], left.deviation),
                (
                    mirrored(left.landmark),
                    other,
                    offset * mirror,
                    carriers[1],
                    left.deviation,
                ),
            ]
        });
        let vertices = (marked_vertices(model).into_iter()).map(|(landmark, vertex, deviation)| {
            (
                landmark,
                Place::Vertex(vertex),
                DVec3::ZERO,
                Joint::Head,
                deviation,
            )
        });
        let mut all = Vec::new();
        for (landmark, place, offset, carrier, usual) in joints.chain(vertices) {
            let point = points[landmark];
            if point.support > 0.0 && point.position.is_finite() && point.residual.is_finite() {
                // Rays that miss one another are worth less, and so are few of them.
                let few = (SUPPORT / point.support).max(1.0);
                all.push(Target {
                    place,
                    position: point.position,
                    deviation: usual.hypot((point.residual - 0.015).max(0.0)) * few,
                    source: Source::Body(landmark),
                    offset,
                    carrier,
                });
            }
        }
        all.extend(face.iter().map(|on| Target {
            place: Place::Vertex(on.vertex),
            position: on.place,
            deviation: FACE,
            source: Source::Face,
            offset: on.offset,
            carrier: Joint::Head,
        }));
        // A joint that the user names is where the user says, not where a network does.
        let hinted: Vec<Place> = hints.iter().map(|hint| Place::Joint(hint.joint)).collect();
        all.retain(|target| !hinted.contains(&target.place));
        let hints = hints.iter().filter(|hint| hint.position.is_finite());
        all.extend(hints.map(|hint| Target {
            place: Place::Joint(hint.joint),
            position: hint.position,
            deviation: HINT,
            source: Source::Hint,
            offset: DVec3::ZERO,
            carrier: hint.joint,
        }));
        Self { all }
    }

    /// What misses: target minus model, metres.
    pub(super) fn miss(target: &Target, posed: &Posed) -> DVec3 {
        let carrier = &posed.maps[target.carrier.index()];
        target.position
            - carrier.transform_vector3(target.offset)
            - match target.place {
                Place::Joint(joint) => posed.joints[joint.index()],
                Place::Vertex(vertex) => posed.vertices[vertex],
            }
    }

    /// Adds the targets' terms, `weight` times, those far off with less.
    pub(super) fn add(
        &self,
        weight: f64,
        posed: &Posed,
        derivatives: &Derivatives<'_>,
        equations: &mut NormalEquations,
    ) {
        let mut row = vec![0.0; equations.unknowns()];
        for target in &self.all {
            let miss = Self::miss(target, posed);
            let precision = weight / (target.deviation * target.deviation);
            let robust = if target.source != Source::Hint {
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

    /// Root mean square miss of the body's landmarks, metres.
    pub(super) fn error(&self, posed: &Posed) -> f64 {
        let seen: Vec<f64> = (self.all.iter())
            .filter(|target| matches!(target.source, Source::Body(_)))
            .map(|target| Self::miss(target, posed).length_squared())
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
    let ground = (0..model.body_vertices)
        .map(|v| place(v).y)
        .fold(f64::INFINITY, f64::min);
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
            most(&|v| of_foot(v) && place(v).y < ground + 0.03, &|v| {
                -place(v).z
            }),
            0.03,
        ));
        found.push((
            toe,
            most(&|v| of_foot(v) && (place(v).x - toes).abs() < 0.04, &|v| {
                place(v).z
            }),
            0.03,
        ));
    }
    (found.into_iter())
        .filter_map(|(landmark, vertex, deviation)| Some((landmark, vertex?, deviation)))
        .collect()
}
