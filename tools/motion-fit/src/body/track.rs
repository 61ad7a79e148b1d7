//! One account of how a body moved: a posture with its speed, followed from picture to picture.

use super::{
    chain::{BODY_JOINTS, Placed, Posture},
    contact::{Contact, SeenSole},
    evidence::{
        Body, DEPTHS, Scene, continuity_terms, first_posture, landmark_terms, reprojection,
        root_of, unproject, unseen_terms, upright_terms,
    },
    reading::{Exchange, Reading},
    so3,
    solver::SkeletonSolver,
    terms::Term,
};
use crate::landmarks::BODY_LANDMARKS;
use crate::landmarks::blazepose::{HEELS, TOES};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Steps of the solver for a picture, and for the first one.
const STEPS: usize = 4;
const FIRST_STEPS: usize = 25;
/// Speeds fade with this time, seconds: what is hidden comes to rest.
const FADE: f64 = 0.1;
/// How near to its pin a standing sole is held, metres; to the floor; and how firmly no sole sinks below it.
const PIN: f64 = 0.05;
const FLOOR: f64 = 0.08;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Track {
    pub(super) posture: Posture,
    /// Turn from the left of each joint, rad/s.
    spin: [Vector3<f64>; BODY_JOINTS],
    /// Of the pelvis, m/s.
    drift: Vector3<f64>,
    pub(super) contacts: [Contact; 4],
    /// What this account exchanged in the last picture.
    pub(super) exchange: Exchange,
    /// For how long it exchanged all without a break, seconds.
    pub(super) exchanged_seconds: f64,
    /// Sum of the fits' costs and their number.
    pub(super) costs: (f64, u32),
    /// Root mean square of the last fit's reprojection, pixels.
    pub(super) reprojection: f64,
    /// Pictures fitted.
    pub(super) age: u64,
}

impl Track {
    pub(super) fn new(posture: Posture) -> Self {
        Self {
            posture,
            spin: [Vector3::zeros(); BODY_JOINTS],
            drift: Vector3::zeros(),
            contacts: [Contact::default(); 4],
            exchange: Exchange::NONE,
            exchanged_seconds: 0.0,
            costs: (0.0, 0),
            reprojection: 0.0,
            age: 0,
        }
    }

    fn begun(&self) -> bool {
        self.age > 0
    }

    /// Mean cost of the fits since the last count began.
    pub(super) fn mean_cost(&self) -> f64 {
        self.costs.0 / f64::from(self.costs.1.max(1))
    }

    /// The posture after `step` seconds of fading speed.
    fn predicted(&self, step: f64) -> Posture {
        // The integral of a speed that fades.
        let reach = FADE * (1.0 - (-step / FADE).exp());
        Posture {
            position: self.posture.position + self.drift * step,
            rotations: std::array::from_fn(|joint| {
                so3::exp(&(self.spin[joint] * reach)) * self.posture.rotations[joint]
            }),
        }
    }

    /// Goes on without a picture; eases towards `rest` (of each joint; the pelvis' is in the world) as `ease` 0..=1 says.
    pub(super) fn coast(
        &mut self,
        step: f64,
        rest: &[UnitQuaternion<f64>; BODY_JOINTS],
        ease: f64,
    ) {
        self.posture = self.predicted(step);
        let fade = (-step / FADE).exp();
        self.drift *= fade;
        for ((spin, rotation), rest) in self
            .spin
            .iter_mut()
            .zip(&mut self.posture.rotations)
            .zip(rest)
        {
            *spin *= fade;
            let to_rest = so3::log(&(*rest * rotation.inverse()));
            *rotation = so3::exp(&(to_rest * ease)) * *rotation;
            rotation.renormalize();
        }
        self.contacts = [Contact::default(); 4];
        self.exchanged_seconds = 0.0;
    }

    /// Turns all about the camera: the world became level in another way.
    pub(super) fn turn(&mut self, by: &Matrix3<f64>) {
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(*by);
        let turn = UnitQuaternion::from_rotation_matrix(&rotation);
        self.posture.position = by * self.posture.position;
        self.posture.rotations[0] = turn * self.posture.rotations[0];
        self.spin[0] = by * self.spin[0];
        self.drift = by * self.drift;
        for contact in &mut self.contacts {
            contact.turn(by);
        }
    }

    /// Fits one picture's landmarks (levelled, in the avatar's size). `exchange` fixes left and right; otherwise continuity decides.
    pub(super) fn follow(
        &mut self,
        body: &Body,
        solver: &mut SkeletonSolver,
        scene: &Scene,
        reading: &Reading,
        exchange: Option<Exchange>,
    ) {
        let step = scene.step;
        let predicted = self.predicted(step);
        let placed = solver.chain().place(&predicted);
        self.exchange = match exchange {
            Some(exchange) => exchange,
            None if self.begun() && body.parts.labels => guess(body, &placed, reading),
            None => Exchange::NONE,
        };
        self.exchanged_seconds = if self.exchange == Exchange::BOTH {
            self.exchanged_seconds + step
        } else {
            0.0
        };
        let reading = reading.exchanged(self.exchange);
        let mut posture = predicted;
        if !self.begun() {
            posture = first_posture(body, solver, scene, &reading);
        }
        let placed = solver.chain().place(&posture);

        solver.terms.clear();
        solver.views.clear();
        solver.views.push(scene.view);
        landmark_terms(body, solver, scene, &reading, &placed);
        unseen_terms(body, solver, &reading);
        if self.begun() {
            continuity_terms(solver, scene, &posture);
        }
        if body.parts.upright {
            upright_terms(solver, scene, &reading);
        }
        if body.parts.ground && self.begun() {
            self.ground_terms(body, solver, scene, &reading, &placed);
        }
        let solved = solver.solve(&mut posture, if self.begun() { STEPS } else { FIRST_STEPS });
        if solved.cost.is_finite() {
            self.costs.0 += solved.cost;
            self.costs.1 += 1;
        }
        // A body behind the camera or beyond all is a mistake of depth.
        let forward = scene.view.camera_from_world.row(2).transpose();
        let depth = forward.dot(&posture.position);
        if depth < DEPTHS.0 {
            posture.position += forward * (DEPTHS.0 - depth);
        } else if depth > DEPTHS.1 {
            posture.position *= DEPTHS.1 / depth;
        }

        if self.begun() {
            let blend = 0.5;
            for joint in 0..BODY_JOINTS {
                let turn = posture.rotations[joint] * self.posture.rotations[joint].inverse();
                let speed = so3::log(&turn) / step;
                self.spin[joint] += (speed - self.spin[joint]) * blend;
            }
            let speed = (posture.position - self.posture.position) / step;
            self.drift += (speed - self.drift) * blend;
        }
        self.posture = posture;
        self.age += 1;
        self.reprojection = reprojection(body, solver, scene, &reading, &posture);
    }

    /// Pins standing soles and keeps all above the floor.
    fn ground_terms(
        &mut self,
        body: &Body,
        solver: &mut SkeletonSolver,
        scene: &Scene,
        reading: &Reading,
        placed: &Placed,
    ) {
        let root = root_of(body, reading, placed);
        let landmarks = [HEELS[0], TOES[0], HEELS[1], TOES[1]];
        let lowest = body
            .soles
            .iter()
            .map(|sole| placed.point(sole).y)
            .fold(f64::INFINITY, f64::min);
        for ((contact, sole), landmark) in self.contacts.iter_mut().zip(&body.soles).zip(landmarks)
        {
            let expected = placed.point(sole);
            // The landmark sits on the shoe, not under it: its own movement is taken, the place is the skeleton's.
            let binding = body.bindings.iter().find(|b| b.landmark == landmark);
            let seen = &reading.points[landmark];
            let measured = binding.filter(|_| seen.confidence > 0.4).map(|binding| {
                let carried = placed.point(&binding.at);
                let moved = unproject(&scene.view, seen, &(root + seen.metres)) - carried;
                SeenSole {
                    place: expected + moved,
                    pixel: seen.pixel,
                    metres_per_pixel: scene.metres_per_pixel(&expected),
                }
            });
            contact.update(
                scene.seconds,
                scene.step,
                measured,
                expected,
                lowest.max(scene.floor),
                scene.floor,
            );
            if let Some((pin, hold)) = contact.pin() {
                let information = Matrix3::identity() * (hold / (PIN * PIN));
                solver
                    .terms
                    .push(Term::at(*sole, pin, information).robustly(2.0));
            }
            // One-sided: nothing sinks. The lowest sole, if it is near, stands on the floor.
            if expected.y < scene.floor || (expected.y <= lowest && expected.y < scene.floor + 0.1)
            {
                let target = Vector3::new(0.0, scene.floor, 0.0);
                let up = Matrix3::from_diagonal(&Vector3::new(0.0, 1.0 / (FLOOR * FLOOR), 0.0));
                solver.terms.push(Term::at(*sole, target, up).robustly(3.0));
            }
        }
    }
}

/// The labelling that continues the predicted pose.
fn guess(body: &Body, placed: &Placed, reading: &Reading) -> Exchange {
    let mut expected = [None; BODY_LANDMARKS];
    let middle = root_of(body, reading, placed);
    for binding in &body.bindings {
        expected[binding.landmark] = Some(placed.point(&binding.at));
    }
    for at in expected.iter_mut().flatten() {
        *at -= middle;
    }
    Exchange::guess(reading, &expected)
}
