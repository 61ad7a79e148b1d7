//! The wearer's motion: goals for eyes, wrists, hips and soles, and the solver that bends the avatar's skeleton to them.

use super::body::{BodyFollower, BodyReader};
use super::facing::Facing;
use super::feet::{Feet, Spot, at_rest};
use super::hands::{Goal, Hand};
use super::space::{Space, heading, scale_of};
use super::{Pose, WearerSample, ahead, wrapped};
use crate::body::chain::{Attachment, BODY_JOINTS, Chain, Placed, Posture};
use crate::body::prior::PosePrior;
use crate::body::soles;
use crate::body::solver::SkeletonSolver;
use crate::body::terms::Term;
use crate::hands::{HandFit, Side};
use glam::{DQuat, DVec3, Quat};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use spmm3::{Joint, MotionParams, Skeleton};

/// Standard deviations of goals, metres and radians: the head is where it is, and all else gives way.
const HEAD: f64 = 0.0005;
const HEAD_TURN: f64 = 0.01;
const WRIST_TURN: f64 = 0.12;
/// A ball and a heel of a standing foot: heels rise.
const BALL: f64 = 0.004;
const HEEL: f64 = 0.015;
const SEATED_SOLE: f64 = 0.02;
/// Hips below the head, and over the feet.
const HIPS_BELOW: f64 = 0.08;
const HIPS_OVER: f64 = 0.1;
const CHAIR: f64 = 0.03;
/// Hips' heading, and their tilt.
const HIPS_YAW: f64 = 0.12;
const HIPS_TILT: f64 = 0.15;
/// Steps of the solver for a sample, and for the first one.
const STEPS: usize = 8;
const FIRST_STEPS: usize = 40;
/// A longer time between samples is counted as this, seconds.
const PAUSE: f64 = 0.25;
/// How soon a chair's height follows a wearer who sits up, seconds.
const CHAIR_SECONDS: f64 = 0.5;

/// How the wearer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stance {
    /// They stand, walk and crouch.
    #[default]
    Standing,
    /// They sit on a chair that stays where it is.
    Seated,
}

/// What a sample became.
#[derive(Debug, Clone, PartialEq)]
pub struct WearerMotion {
    /// The avatar's motion. The root is relative to where the wearer began.
    pub motion: MotionParams,
    /// The wearer's size over the avatar's: motion space has the avatar's metres, each of them so many of the wearer's.
    pub scale: f64,
}

/// Follows one wearer.
#[derive(Debug, Clone)]
pub struct WearerFit {
    solver: SkeletonSolver,
    stance: Stance,
    /// The pelvis at rest.
    pelvis: DVec3,
    /// Between the eyes, relative to the head's joint; above the floor; and above the pelvis, at rest.
    eyes: Attachment,
    eye_height: f64,
    eyes_from_pelvis: DVec3,
    /// Soles: heel and ball of the left foot, then of the right.
    soles: [Attachment; 4],
    /// Left, right: how far a sole's middle is to the left of the pelvis at rest; how far both are before it.
    beside: [f64; 2],
    before: f64,
    /// From a sole's middle to its ball, metres.
    half_sole: f64,
    thigh: f64,
    hands: [Hand; 2],
    reader: BodyReader,
    state: Option<State>,
    shown: Option<WearerMotion>,
}

#[derive(Debug, Clone)]
struct State {
    seconds: f64,
    space: Space,
    facing: Facing,
    feet: Feet,
    body: BodyFollower,
    posture: Posture,
    placed: Placed,
    /// Of one who sits: where the chair is, and the hips' height, metres.
    chair: DVec3,
}

/// How much is left to suppose, 0..=1: 0 where the tracked body tells it.
#[derive(Debug, Clone, Copy)]
struct Open {
    hips: f64,
    feet: f64,
}

impl WearerFit {
    /// For the avatar of that skeleton.
    #[must_use]
    pub fn new(skeleton: &Skeleton, stance: Stance) -> Self {
        let rest = |joint: Joint| skeleton.rest_positions()[joint.index()].as_dvec3();
        let eyes = (rest(Joint::LeftEye) + rest(Joint::RightEye)) / 2.0;
        let pelvis = rest(Joint::Pelvis);
        let offset = eyes - rest(Joint::Head);
        let chain = Chain::new(skeleton);
        let soles = soles(skeleton);
        let at_rest = chain.place(&Posture {
            position: vector(pelvis),
            ..Posture::default()
        });
        let sole = |k: usize| point(at_rest.point(&soles[k]));
        let middles = [(sole(0) + sole(1)) / 2.0, (sole(2) + sole(3)) / 2.0];
        Self {
            solver: SkeletonSolver::new(chain, PosePrior::default()),
            stance,
            pelvis,
            eyes: Attachment::new(Joint::Head, vector(offset)),
            eye_height: eyes.y,
            eyes_from_pelvis: eyes - pelvis,
            soles,
            beside: middles.map(|middle| middle.x - pelvis.x),
            before: (middles[0].z + middles[1].z) / 2.0 - pelvis.z,
            half_sole: (sole(1) - sole(0)).length() / 2.0,
            thigh: (rest(Joint::LeftKnee) - rest(Joint::LeftHip)).length(),
            hands: Side::BOTH.map(|side| Hand::new(HandFit::new(skeleton, side), side)),
            reader: BodyReader::new(skeleton),
            state: None,
            shown: None,
        }
    }

    /// The motion of `sample`, which comes after those before it. The last one again while the head is not known; nothing before it was.
    pub fn step(&mut self, sample: &WearerSample) -> Option<WearerMotion> {
        let known = sample
            .floor_from_view
            .filter(|view| view.is_finite() && sample.seconds.is_finite());
        let Some(view) = known else {
            return self.shown.clone();
        };
        let mut state = match self.state.take() {
            Some(state) if state.space.holds(sample) => state,
            _ => self.begin(sample, &view),
        };
        let first = self.shown.is_none();
        let seconds = (sample.seconds - state.seconds).clamp(0.0, PAUSE);
        state.seconds = sample.seconds;
        if self.stance == Stance::Standing {
            let height = f64::from(view.translation.y);
            state.space.stretch(height, self.eye_height, seconds);
        }
        let head = state.space.head(&view);
        let body = (sample.body.as_ref()).and_then(|body| self.reader.measure(body, &state.space));
        let measured = Side::BOTH.map(|side| {
            let at_body = body.as_ref().and_then(|body| body.hand(side));
            let index = side.index();
            self.hands[index].measure(&sample.hands[index], at_body, &state.space)
        });
        state.body.follow(body, seconds, first);
        let wrists = measured.map(|hand| hand.map(|hand| hand.wrist));
        let turned = heading(head.rotation);
        state.facing.follow(head.position, turned, wrists, seconds);
        let mut below = self.hips_below(&head, turned, state.facing.yaw());
        // What the body tells of hips and feet takes the place of what is supposed of them.
        let (mut hips_open, mut feet_open) = (1.0, 1.0);
        if let Some((body, share)) = state.body.body() {
            if let Some(yaw) = body.yaw() {
                state.facing.know(yaw, share);
            }
            if let Some(hips) = body.hips() {
                below = below.lerp(DVec3::new(hips.x, below.y, hips.z), share);
                hips_open = 1.0 - share;
            }
            if body.has_legs() {
                feet_open = 1.0 - share;
            }
        }
        let yaw = state.facing.yaw();
        self.solver.terms.clear();
        self.aim_head(&head);
        let open = Open {
            hips: hips_open,
            feet: feet_open,
        };
        match self.stance {
            Stance::Standing => self.aim_standing(&mut state, below, open, seconds),
            Stance::Seated => self.aim_seated(&mut state, &head, below, open, seconds),
        }
        state.body.aim(&mut self.solver.terms);
        let hips = (DVec3::new(below.x, self.pelvis.y, below.z), yaw);
        for (side, measured) in Side::BOTH.into_iter().zip(measured) {
            let wrist = Attachment::centre(side.wrist());
            let was = (!first).then(|| point(state.placed.point(&wrist)));
            let hand = &mut self.hands[side.index()];
            if let Some(goal) = hand.step(measured.as_ref(), hips, was, seconds) {
                self.aim_wrist(side, &goal);
            }
        }
        let steps = if first { FIRST_STEPS } else { STEPS };
        self.solver.solve(&mut state.posture, steps);
        state.placed = self.solver.chain().place(&state.posture);
        // What the solver left of the head's place is the root's.
        let left = vector(head.position) - state.placed.point(&self.eyes);
        state.posture.position += left;
        state.placed = self.solver.chain().place(&state.posture);
        if open.feet < 0.5 {
            // Feet that are lost go on from where they were.
            state.feet.put(self.spots(&state.placed));
        }
        let shown = WearerMotion {
            motion: self.motion(&state.posture),
            scale: state.space.scale(),
        };
        self.state = Some(state);
        self.shown = Some(shown.clone());
        Some(shown)
    }

    /// Where a point of motion space is in the headset's floor space, metres. Nothing before the first head.
    #[must_use]
    pub fn floor_from_motion(&self, motion: DVec3) -> Option<DVec3> {
        Some(self.state.as_ref()?.space.floor(motion))
    }

    fn begin(&self, sample: &WearerSample, view: &glam::Affine3A) -> State {
        let scale = match self.stance {
            Stance::Standing => scale_of(f64::from(view.translation.y), self.eye_height),
            Stance::Seated => 1.0,
        };
        let space = Space::begin(view, sample.origin, scale);
        let mut posture = PosePrior::default().posture();
        let head = space.head(view);
        let below = self.hips_below(&head, 0.0, 0.0);
        posture.position = vector(DVec3::new(below.x, self.pelvis.y, below.z));
        State {
            seconds: sample.seconds,
            space,
            facing: Facing::default(),
            feet: Feet::new(at_rest(below, 0.0, self.beside, self.before)),
            body: BodyFollower::default(),
            placed: self.solver.chain().place(&posture),
            posture,
            chair: DVec3::new(below.x, head.position.y - self.eyes_from_pelvis.y, below.z),
        }
    }

    /// Where hips would be whose person held their head upright, metres; y is the eyes'.
    fn hips_below(&self, head: &Pose, turned: f64, yaw: f64) -> DVec3 {
        // Eyes are ahead of the neck, about which a head turns and nods.
        let neck = head.position
            - head.rotation * point(self.eyes.offset)
            - ahead(turned + 0.5 * wrapped(yaw - turned))
                * (self.eyes_from_pelvis.z - self.eyes.offset.z);
        DVec3::new(neck.x, head.position.y, neck.z)
    }

    fn aim_head(&mut self, head: &Pose) {
        let terms = &mut self.solver.terms;
        terms.push(Term::at(self.eyes, vector(head.position), sure(HEAD)));
        terms.push(Term::Orientation {
            joint: Joint::Head,
            target: turn(head.rotation),
            information: sure(HEAD_TURN),
            robust: None,
        });
    }

    fn aim_wrist(&mut self, side: Side, goal: &Goal) {
        let wrist = Attachment::centre(side.wrist());
        let terms = &mut self.solver.terms;
        terms.push(Term::at(wrist, vector(goal.wrist), sure(goal.spread)));
        terms.push(Term::Orientation {
            joint: side.wrist(),
            target: turn(goal.turn),
            information: sure(WRIST_TURN.max(goal.spread)),
            robust: None,
        });
    }

    fn aim_standing(&mut self, state: &mut State, below: DVec3, open: Open, seconds: f64) {
        let (yaw, velocity) = (state.facing.yaw(), state.facing.velocity());
        let rest = at_rest(below, yaw, self.beside, self.before);
        let feet = state.feet.step(rest, velocity, seconds);
        self.aim_soles(&feet, BALL, HEEL, open.feet);
        let over = (feet[0].place + feet[1].place) / 2.0 - ahead(yaw) * self.before;
        self.aim_hips(below, HIPS_BELOW, None, open.hips);
        self.aim_hips(over, HIPS_OVER, None, open.hips.min(open.feet));
        self.aim_hips_turn(yaw, open.hips);
    }

    fn aim_seated(
        &mut self,
        state: &mut State,
        head: &Pose,
        below: DVec3,
        open: Open,
        seconds: f64,
    ) {
        // One who sits up is as high as they get; one who leans is not.
        let height = head.position.y - self.eyes_from_pelvis.y;
        let share = 1.0 - (-seconds / CHAIR_SECONDS).exp();
        state.chair.y += (height - state.chair.y).max(0.0) * share;
        let yaw = state.facing.yaw();
        // A chair rolls after one who reaches further than they can lean.
        let away = (below - state.chair) * DVec3::new(1.0, 0.0, 1.0);
        state.chair += away - away.clamp_length_max(0.4);
        let knees = state.chair + ahead(yaw) * self.thigh;
        let feet = at_rest(knees, yaw, self.beside, 0.0);
        self.aim_soles(&feet, SEATED_SOLE, SEATED_SOLE, open.feet);
        self.aim_hips(state.chair, CHAIR, Some(CHAIR), open.hips);
        self.aim_hips_turn(yaw, open.hips);
    }

    /// Where the avatar's feet are.
    fn spots(&self, placed: &Placed) -> [Spot; 2] {
        [0, 1].map(|foot: usize| {
            let end = |k: usize| point(placed.point(&self.soles[2 * foot + k]));
            let (heel, ball) = (end(0), end(1));
            Spot {
                place: ((heel + ball) / 2.0).with_y(0.0),
                yaw: (ball.x - heel.x).atan2(ball.z - heel.z),
            }
        })
    }

    fn aim_hips(&mut self, place: DVec3, along_floor: f64, height: Option<f64>, open: f64) {
        let square = |spread: f64| open / (spread * spread);
        let flat = square(along_floor);
        let information =
            Matrix3::from_diagonal(&Vector3::new(flat, height.map_or(0.0, square), flat));
        let hips = Attachment::centre(Joint::Pelvis);
        self.solver
            .terms
            .push(Term::at(hips, vector(place), information));
    }

    fn aim_hips_turn(&mut self, yaw: f64, open: f64) {
        let square = |spread: f64| open / (spread * spread);
        let (tilt, about) = (square(HIPS_TILT), square(HIPS_YAW));
        self.solver.terms.push(Term::Orientation {
            joint: Joint::Pelvis,
            target: turn(DQuat::from_rotation_y(yaw)),
            information: Matrix3::from_diagonal(&Vector3::new(tilt, about, tilt)),
            robust: None,
        });
    }

    fn aim_soles(&mut self, feet: &[Spot; 2], ball: f64, heel: f64, open: f64) {
        for (foot, spot) in feet.iter().enumerate() {
            let toes = ahead(spot.yaw) * self.half_sole;
            for (end, spread, aside) in [(0, heel, -toes), (1, ball, toes)] {
                let place = vector(spot.place + aside);
                let sole = self.soles[2 * foot + end];
                let information = sure(spread) * open;
                self.solver.terms.push(Term::at(sole, place, information));
            }
        }
    }

    #[allow(clippy::cast_possible_truncation, reason = "motion parameters are f32")]
    fn motion(&self, posture: &Posture) -> MotionParams {
        let mut motion = MotionParams::default();
        motion.root_translation = (point(posture.position) - self.pelvis).as_vec3();
        for (joint, q) in Joint::ALL
            .into_iter()
            .take(BODY_JOINTS)
            .zip(&posture.rotations)
        {
            let [x, y, z, w] = [q.i, q.j, q.k, q.w].map(|v| v as f32);
            motion.set_rotation(joint, Quat::from_xyzw(x, y, z, w).normalize());
        }
        for (side, hand) in Side::BOTH.into_iter().zip(&self.hands) {
            let first = side.first_finger_joint().index();
            for (joint, bend) in Joint::ALL.into_iter().skip(first).zip(hand.fingers()) {
                motion.set_rotation(joint, bend.as_quat().normalize());
            }
        }
        motion
    }
}

fn sure(spread: f64) -> Matrix3<f64> {
    Matrix3::identity() / (spread * spread)
}

fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn point(v: Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

fn turn(q: DQuat) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(q.w, q.x, q.y, q.z))
}
