//! What a picture and its surroundings say of a posture, as the solver's terms.

use super::{
    bindings::{Binding, COUNT},
    chain::{Attachment, BODY_JOINTS, Placed, Posture},
    reading::{Reading, Seen},
    solver::SkeletonSolver,
    terms::{NEAREST, Term, View},
};
use crate::landmarks::blazepose::{ANKLES, HIPS, KNEES, SHOULDERS};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use spmm3::Joint;

/// Standard deviations of a landmark's place in metres across the line of sight and along it. A network's metres are of a person of its own
/// imagination: what it saw in the picture tells the places across, bones that keep their lengths tell how far limbs reach along it, and the
/// network mostly on which side.
const ACROSS: f64 = 0.2;
const ALONG: f64 = 0.4;
/// Of a landmark's pixel, metres at its depth.
const PIXEL: f64 = 0.02;
/// How fast a joint's turn may depart from constant speed: its standard deviation in a frame per second of that frame's length, rad/s.
const TURN_CHANGE: f64 = 4.0;
/// Likewise of the pelvis, across and along the line of sight, m/s.
const MOVE_CHANGE: [f64; 2] = [1.0, 1.5];
/// Standard deviations of spine and pelvis from upright, radians, while standing.
const LEAN: [f64; 2] = [0.35, 0.45];
/// How far a standing body's chest is from above its feet along the line of sight, metres.
const BALANCE: f64 = 0.12;
/// A part of the body whose landmarks are less sure than this is held at ease in part; its joints' standard deviation from that, and that
/// of an unseen pelvis from upright, radians.
const SEEN: f64 = 0.4;
const AT_EASE: f64 = 0.25;
const UNSEEN_LEAN: f64 = 0.15;
/// Nearest and furthest that a body is placed, metres.
pub(super) const DEPTHS: (f64, f64) = (0.4, 30.0);

/// Where the parts of the fit are switched, to see what each is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    /// Left and right are told apart by continuity and anatomy.
    pub labels: bool,
    /// The camera's tilt is estimated and leaning costs.
    pub upright: bool,
    /// Standing soles are pinned, and no sole sinks below the floor.
    pub ground: bool,
    /// Bones are as long as the person's, not as the avatar's.
    pub proportions: bool,
}

impl Default for Parts {
    fn default() -> Self {
        Self {
            labels: true,
            upright: true,
            ground: true,
            proportions: true,
        }
    }
}

/// What does not change from picture to picture.
#[derive(Debug, Clone)]
pub(super) struct Body {
    pub(super) bindings: [Binding; COUNT],
    /// Heel and ball of the left foot, then of the right; points of the floor at rest.
    pub(super) soles: [Attachment; 4],
    pub(super) parts: Parts,
    /// How the joints are held at ease.
    pub(super) rest: [UnitQuaternion<f64>; BODY_JOINTS],
}

impl Body {
    /// Where a landmark is on the skeleton.
    pub(super) fn at(&self, landmark: usize) -> Attachment {
        let binding = self.bindings.iter().find(|b| b.landmark == landmark);
        binding.map_or(Attachment::centre(Joint::Pelvis), |b| b.at)
    }
}

/// The surroundings of one picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scene {
    pub(super) seconds: f64,
    pub(super) step: f64,
    pub(super) view: View,
    /// Height of the floor, metres; the camera is at 0.
    pub(super) floor: f64,
}

impl Scene {
    /// Metres across the line of sight of a pixel at `place`.
    pub(super) fn metres_per_pixel(&self, place: &Vector3<f64>) -> f64 {
        let depth = (self.view.camera_from_world * place + self.view.translation).z;
        depth.max(NEAREST) / self.view.focal
    }
}

/// A first posture: the pelvis turned as the torso is, at the depth that the torso's size in the picture tells.
pub(super) fn first_posture(
    body: &Body,
    solver: &SkeletonSolver,
    scene: &Scene,
    reading: &Reading,
) -> Posture {
    let mut posture = solver.prior.posture();
    if reading.both(HIPS, 0.2) && reading.both(SHOULDERS, 0.2) {
        let across = reading.points[HIPS[0]].metres - reading.points[HIPS[1]].metres
            + reading.points[SHOULDERS[0]].metres
            - reading.points[SHOULDERS[1]].metres;
        let along = reading.middle(SHOULDERS) - reading.middle(HIPS);
        let forward = across.cross(&along).try_normalize(1e-6);
        if let (Some(forward), Some(x)) = (forward, across.try_normalize(1e-6)) {
            let y = forward.cross(&x);
            let axes =
                nalgebra::Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, forward]));
            posture.rotations[0] = UnitQuaternion::from_rotation_matrix(&axes);
        }
    } else if reading.both(SHOULDERS, 0.2) {
        // Upright, facing where the shoulders do.
        let across = reading.points[SHOULDERS[0]].metres - reading.points[SHOULDERS[1]].metres;
        let yaw = (-across.z).atan2(across.x);
        posture.rotations[0] = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw);
    }
    // Each seen landmark at metres + t projects to its pixel: two equations, linear in t.
    let view = &scene.view;
    let mut normal = Matrix3::identity() * 1e-9;
    let mut right = Vector3::zeros();
    for binding in &body.bindings {
        let seen = &reading.points[binding.landmark];
        let at = view.camera_from_world * seen.metres;
        let ray = (seen.pixel - view.centre) / view.focal;
        for axis in 0..2 {
            let mut row = Vector3::new(0.0, 0.0, -ray[axis]);
            row[axis] = 1.0;
            normal += row * row.transpose() * seen.confidence;
            right += row * ((ray[axis] * at.z - at[axis]) * seen.confidence);
        }
    }
    let middle = normal
        .cholesky()
        .map(|c| c.solve(&right))
        .filter(|t| t.iter().all(|v| v.is_finite()) && t.z > 0.0)
        .unwrap_or(Vector3::new(0.0, 0.0, 3.0));
    let middle = middle * (middle.z.clamp(DEPTHS.0, DEPTHS.1) / middle.z);
    let root = view.camera_from_world.transpose() * (middle - view.translation);
    let placed = solver.chain().place(&posture);
    let on_body = root_of(body, reading, &placed);
    posture.position = root - (on_body - placed.positions[0]);
    posture
}

/// The landmarks' terms.
pub(super) fn landmark_terms(
    body: &Body,
    solver: &mut SkeletonSolver,
    scene: &Scene,
    reading: &Reading,
    placed: &Placed,
) {
    let view = &scene.view;
    let axes = view.camera_from_world;
    let [across, along] = [ACROSS, ALONG].map(|s| 1.0 / (s * s));
    let root = reading.root.map(|landmark| body.at(landmark));
    for binding in &body.bindings {
        let seen = &reading.points[binding.landmark];
        let sure = seen.confidence * seen.confidence;
        if seen.confidence == 0.0 {
            continue;
        }
        let points = [(binding.at, 1.0), (root[0], -0.5), (root[1], -0.5)];
        let weight = sure * binding.solid * binding.solid;
        let depth_weight = along / (binding.depth * binding.depth);
        let spread = Vector3::new(across, across, depth_weight);
        let solid = axes.transpose() * Matrix3::from_diagonal(&spread) * axes;
        solver
            .terms
            .push(Term::sum(&points, seen.metres, solid * weight).robustly(3.0));
        let depth = (axes.row(2) * placed.point(&binding.at))[0] + view.translation.z;
        let deviation = (PIXEL * view.focal / depth.max(0.2)).clamp(1.0, 40.0);
        solver.terms.push(Term::Pixel {
            point: binding.drawn,
            view: 0,
            target: seen.pixel,
            information: sure * binding.pixel * binding.pixel / (deviation * deviation),
            robust: Some(2.0),
        });
    }
}

/// Where the middle of the reading's root is on a placed body.
pub(super) fn root_of(body: &Body, reading: &Reading, placed: &Placed) -> Vector3<f64> {
    let [a, b] = reading
        .root
        .map(|landmark| placed.point(&body.at(landmark)));
    (a + b) / 2.0
}

/// What the picture does not show is at ease: legs stand below a body that is upright, as of a person before a desk.
pub(super) fn unseen_terms(body: &Body, solver: &mut SkeletonSolver, reading: &Reading) {
    let unseen = |points: &[usize]| {
        let best = points.iter().map(|p| reading.points[*p].confidence);
        (1.0 - best.fold(0.0, f64::max) / SEEN).max(0.0)
    };
    for (side, leg) in spmm3::LEGS.into_iter().enumerate() {
        let weight = unseen(&[KNEES[side], ANKLES[side]]);
        if weight > 0.0 {
            for joint in leg {
                solver.terms.push(Term::Rotation {
                    joint,
                    target: body.rest[joint.index()],
                    information: Matrix3::identity() * (weight / (AT_EASE * AT_EASE)),
                    robust: None,
                });
            }
        }
    }
    let weight = unseen(&HIPS);
    if weight > 0.0 && body.parts.upright {
        for joint in [Joint::Spine3, Joint::Pelvis] {
            solver.terms.push(Term::Direction {
                joint,
                axis: Vector3::y(),
                target: Vector3::y(),
                information: Matrix3::identity() * (weight / (UNSEEN_LEAN * UNSEEN_LEAN)),
                robust: None,
            });
        }
    }
}

/// Continuity with the predicted posture.
pub(super) fn continuity_terms(solver: &mut SkeletonSolver, scene: &Scene, predicted: &Posture) {
    let turn = 1.0 / (TURN_CHANGE * scene.step).powi(2);
    for joint in Joint::ALL.into_iter().take(BODY_JOINTS) {
        solver.terms.push(Term::Rotation {
            joint,
            target: predicted.rotations[joint.index()],
            information: Matrix3::identity() * turn,
            robust: None,
        });
    }
    let [across, along] = MOVE_CHANGE.map(|s| 1.0 / (s * scene.step).powi(2));
    let axes = scene.view.camera_from_world;
    let information =
        axes.transpose() * Matrix3::from_diagonal(&Vector3::new(across, across, along)) * axes;
    let pelvis = Attachment::centre(Joint::Pelvis);
    solver
        .terms
        .push(Term::at(pelvis, predicted.position, information));
}

/// Whether the body stands or walks: legs seen, and about as long as a standing body's from feet to shoulders.
pub(super) fn stands(reading: &Reading) -> bool {
    let axis = reading.middle(SHOULDERS) - reading.middle(ANKLES);
    reading.both(ANKLES, 0.4) && reading.both(SHOULDERS, 0.4) && axis.norm() > 1.05 && axis.y > 0.8
}

/// A standing body leans little, above all not along the line of sight, where a network sees it least.
pub(super) fn upright_terms(solver: &mut SkeletonSolver, scene: &Scene, reading: &Reading) {
    if !stands(reading) {
        return;
    }
    let up = Vector3::y();
    for (joint, lean) in [(Joint::Spine3, LEAN[0]), (Joint::Pelvis, LEAN[1])] {
        solver.terms.push(Term::Direction {
            joint,
            axis: up,
            target: up,
            information: Matrix3::identity() / (lean * lean),
            robust: Some(1.5),
        });
    }
    let chest_over_feet = [
        (Attachment::centre(Joint::Spine3), 1.0),
        (Attachment::centre(Joint::LeftAnkle), -0.5),
        (Attachment::centre(Joint::RightAnkle), -0.5),
    ];
    let sight = scene.view.camera_from_world.row(2).transpose();
    let along = Vector3::new(sight.x, 0.0, sight.z);
    let information = along * along.transpose() / (BALANCE * BALANCE);
    solver
        .terms
        .push(Term::sum(&chest_over_feet, Vector3::zeros(), information).robustly(2.0));
}

/// The place on a landmark's ray that is as far away as `like`.
pub(super) fn unproject(view: &View, seen: &Seen, like: &Vector3<f64>) -> Vector3<f64> {
    let depth = (view.camera_from_world * like + view.translation).z;
    let ray = (seen.pixel - view.centre) / view.focal;
    view.camera_from_world.transpose()
        * (Vector3::new(ray.x, ray.y, 1.0) * depth - view.translation)
}

/// Root mean square distance of the seen landmarks from their pixels.
pub(super) fn reprojection(
    body: &Body,
    solver: &SkeletonSolver,
    scene: &Scene,
    reading: &Reading,
    posture: &Posture,
) -> f64 {
    let placed = solver.chain().place(posture);
    let mut sum = (0.0, 0.0);
    for binding in &body.bindings {
        let seen = &reading.points[binding.landmark];
        let weight = seen.confidence * binding.pixel;
        let off = scene.view.project(&placed.point(&binding.drawn)) - seen.pixel;
        sum = (sum.0 + weight * off.norm_squared(), sum.1 + weight);
    }
    if sum.1 > 0.0 {
        (sum.0 / sum.1).sqrt()
    } else {
        0.0
    }
}
