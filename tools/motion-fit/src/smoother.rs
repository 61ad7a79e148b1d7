//! Smoothing of all motion parameters: One-Euro filters (Casiez, Roussel and Vogel, CHI 2012) on rotations, expression and root.
//!
//! A filter's cutoff rises with speed: what rests is held still, what moves is followed closely. Rotations are filtered along the shortest
//! arc, in their tangent space, not as vectors.

use crate::body::so3;
use glam::Quat;
use nalgebra::{UnitQuaternion, Vector3};
use spmm3::{EXPRESSION, JOINTS, Joint, MotionParams};

/// A One-Euro filter's numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutoff {
    /// Cutoff at rest, Hz: less is smoother and slower.
    pub rest_hz: f64,
    /// By how much the cutoff rises with each rad/s, m/s or unit of expression a second: more lags less.
    pub per_speed: f64,
    /// Cutoff of the speed itself, Hz.
    pub speed_hz: f64,
    /// A speed that noise makes, which does not raise the cutoff; units as above.
    pub still: f64,
}

/// The filters of each part of a person.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothConfig {
    /// Pelvis, spine, collars, neck and head.
    pub trunk: Cutoff,
    /// Shoulders to wrists, hips to feet.
    pub limbs: Cutoff,
    /// Fingers.
    pub fingers: Cutoff,
    /// Jaw and eyes.
    pub face: Cutoff,
    /// Expression's coefficients.
    pub expression: Cutoff,
    /// Root translation.
    pub root: Cutoff,
}

impl Default for SmoothConfig {
    fn default() -> Self {
        let cutoff = |rest_hz, per_speed, speed_hz| Cutoff {
            rest_hz,
            per_speed,
            speed_hz,
            still: 0.2,
        };
        Self {
            trunk: cutoff(0.9, 1.0, 2.0),
            limbs: cutoff(0.9, 0.7, 2.0),
            fingers: cutoff(1.2, 0.5, 1.0),
            face: cutoff(3.0, 2.0, 2.0),
            expression: cutoff(2.5, 0.7, 1.0),
            root: cutoff(1.5, 4.0, 2.0),
        }
    }
}

/// How sure each part of a pose is, 0..=1: what is less sure is smoothed more.
#[derive(Debug, Clone, PartialEq)]
pub struct Confidence {
    /// Of each joint, in SMPL-X's order.
    pub joints: [f32; JOINTS],
    /// Of the expression.
    pub expression: f32,
}

impl Default for Confidence {
    /// All sure.
    fn default() -> Self {
        Self {
            joints: [1.0; JOINTS],
            expression: 1.0,
        }
    }
}

/// Share of the cutoff that is left where nothing is sure.
const UNSURE: f64 = 0.25;
/// How far the filters of one chain of joints go along with its quickest: links that lag differently bend and slide what they carry.
const SHARED: f64 = 0.3;
/// A pause longer than this begins anew, seconds.
const PAUSE: f64 = 1.0;

/// Smooths a stream of motion parameters.
///
/// A low pass of cutoff f lags by 1 / (2 pi f): 177 ms for a limb at rest, where nothing is there to lag, and on a swing of half a radian at
/// 0.2 to 3 Hz 23 ms, fingers 39 ms (`cargo test -p motion-fit --test smoother -- --nocapture`). The jitter that is left of a noisy fit is
/// printed by `cargo test -p motion-fit --test body_motion -- --nocapture`: a tenth to a sixth above the recorded motion's own.
#[derive(Debug, Clone)]
pub struct Smoother {
    config: SmoothConfig,
    state: Option<Box<State>>,
}

#[derive(Debug, Clone)]
struct State {
    seconds: f64,
    rotations: [UnitQuaternion<f64>; JOINTS],
    spins: [Vector3<f64>; JOINTS],
    expression: [[f64; 2]; EXPRESSION],
    root: [[f64; 2]; 3],
}

impl Smoother {
    /// A smoother that has seen nothing.
    #[must_use]
    pub fn new(config: SmoothConfig) -> Self {
        Self {
            config,
            state: None,
        }
    }

    /// Smooths `motion`, which is of `seconds` on the source's clock, in place. A motion with a number that is not finite is replaced by
    /// the last one. Time that stands still or goes back counts as no time; after a pause of a second it begins anew.
    pub fn smooth(&mut self, seconds: f64, motion: &mut MotionParams, confidence: &Confidence) {
        let fresh = motion.is_finite() && seconds.is_finite();
        let Some(state) = &mut self.state else {
            if fresh {
                self.state = Some(Box::new(State::new(seconds, motion)));
            } else {
                *motion = MotionParams::default();
            }
            return;
        };
        let step = seconds - state.seconds;
        if fresh && !(-PAUSE..PAUSE).contains(&step) {
            **state = State::new(seconds, motion);
            return;
        }
        if fresh && step > 1e-6 {
            state.advance(&self.config, step, motion, confidence);
            state.seconds = seconds;
        }
        state.write_to(motion);
    }
}

/// Smooths a whole recording without lag: the middle between a smoother that goes forwards and one that goes backwards. `frames` are seconds on the source's
/// clock, in order, the motion of then and how sure it is.
pub fn smooth_all(config: &SmoothConfig, frames: &mut [(f64, MotionParams, Confidence)]) {
    let mut backwards: Vec<MotionParams> = Vec::with_capacity(frames.len());
    let mut smoother = Smoother::new(*config);
    for (seconds, motion, confidence) in frames.iter().rev() {
        let mut motion = motion.clone();
        smoother.smooth(-seconds, &mut motion, confidence);
        backwards.push(motion);
    }
    let mut smoother = Smoother::new(*config);
    for ((seconds, motion, confidence), back) in frames.iter_mut().zip(backwards.iter().rev()) {
        smoother.smooth(*seconds, motion, confidence);
        for joint in Joint::ALL {
            let middle = motion.rotation(joint).slerp(back.rotation(joint), 0.5);
            motion.set_rotation(joint, middle);
        }
        for (value, back) in motion.expression_mut().iter_mut().zip(back.expression()) {
            *value = value.midpoint(*back);
        }
        motion.root_translation = motion.root_translation.midpoint(back.root_translation);
    }
}

impl State {
    fn new(seconds: f64, motion: &MotionParams) -> Self {
        let mut state = Self {
            seconds,
            rotations: [UnitQuaternion::identity(); JOINTS],
            spins: [Vector3::zeros(); JOINTS],
            expression: [[0.0; 2]; EXPRESSION],
            root: [[0.0; 2]; 3],
        };
        for (joint, rotation) in Joint::ALL.into_iter().zip(&mut state.rotations) {
            *rotation = so3::exp(&tangent(motion, joint));
        }
        for (state, value) in state.expression.iter_mut().zip(motion.expression()) {
            state[0] = f64::from(*value);
        }
        for (state, value) in state
            .root
            .iter_mut()
            .zip(motion.root_translation.to_array())
        {
            state[0] = f64::from(value);
        }
        state
    }

    fn advance(
        &mut self,
        config: &SmoothConfig,
        step: f64,
        motion: &MotionParams,
        confidence: &Confidence,
    ) {
        let mut ways = [Vector3::zeros(); JOINTS];
        let mut cutoffs = [0.0; JOINTS];
        for (i, joint) in Joint::ALL.into_iter().enumerate() {
            let cutoff = config.of(joint);
            let target = so3::exp(&tangent(motion, joint));
            ways[i] = so3::log(&(target * self.rotations[i].inverse()));
            let spin = &mut self.spins[i];
            *spin += (ways[i] / step - *spin) * follow(cutoff.speed_hz, step);
            cutoffs[i] = cutoff.hz(spin.norm(), confidence.joints[i]);
        }
        // One cutoff for all three axes keeps the root's way straight.
        let root = motion.root_translation.to_array().map(f64::from);
        let mut speed = 0.0;
        for (state, target) in self.root.iter_mut().zip(root) {
            let now = (target - state[0]) / step;
            state[1] += (now - state[1]) * follow(config.root.speed_hz, step);
            speed += state[1] * state[1];
        }
        let mut root_hz = config.root.hz(speed.sqrt(), 1.0);
        for chain in [Chain::Stance, Chain::LeftArm, Chain::RightArm] {
            let joints = Joint::ALL.into_iter().enumerate();
            let links = joints.filter(|(_, joint)| Chain::of(*joint) == Some(chain));
            let carried = if chain == Chain::Stance { root_hz } else { 0.0 };
            let quickest = links.clone().fold(carried, |hz, (i, _)| cutoffs[i].max(hz));
            for (i, _) in links {
                cutoffs[i] += (quickest - cutoffs[i]) * SHARED;
            }
            if chain == Chain::Stance {
                root_hz += (quickest - root_hz) * SHARED;
            }
        }
        for ((rotation, way), hz) in self.rotations.iter_mut().zip(&ways).zip(cutoffs) {
            *rotation = so3::exp(&(way * follow(hz, step))) * *rotation;
            rotation.renormalize();
        }
        for (state, target) in self.root.iter_mut().zip(root) {
            state[0] += (target - state[0]) * follow(root_hz, step);
        }
        let face = confidence.expression;
        for (state, value) in self.expression.iter_mut().zip(motion.expression()) {
            config
                .expression
                .number(state, f64::from(*value), step, face);
        }
    }

    #[allow(clippy::cast_possible_truncation, reason = "motion parameters are f32")]
    fn write_to(&self, motion: &mut MotionParams) {
        for (joint, q) in Joint::ALL.into_iter().zip(&self.rotations) {
            let [x, y, z, w] = [q.i, q.j, q.k, q.w].map(|v| v as f32);
            motion.set_rotation(joint, Quat::from_xyzw(x, y, z, w).normalize());
        }
        for (value, state) in motion.expression_mut().iter_mut().zip(&self.expression) {
            *value = state[0] as f32;
        }
        motion.root_translation = glam::Vec3::from_array(self.root.map(|state| state[0] as f32));
    }
}

/// Joints that carry one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chain {
    /// The root, pelvis, legs and spine: what stands on the floor.
    Stance,
    LeftArm,
    RightArm,
}

impl Chain {
    fn of(joint: Joint) -> Option<Self> {
        use Joint::*;
        match joint {
            Pelvis | LeftHip | RightHip | Spine1 | LeftKnee | RightKnee | Spine2 | LeftAnkle
            | RightAnkle | Spine3 | LeftFoot | RightFoot => Some(Self::Stance),
            LeftCollar | LeftShoulder | LeftElbow | LeftWrist => Some(Self::LeftArm),
            RightCollar | RightShoulder | RightElbow | RightWrist => Some(Self::RightArm),
            _ => None,
        }
    }
}

impl SmoothConfig {
    fn of(&self, joint: Joint) -> &Cutoff {
        use Joint::*;
        match joint {
            Pelvis | Spine1 | Spine2 | Spine3 | Neck | Head | LeftCollar | RightCollar => {
                &self.trunk
            }
            Jaw | LeftEye | RightEye => &self.face,
            _ if joint.index() > RightEye.index() => &self.fingers,
            _ => &self.limbs,
        }
    }
}

impl Cutoff {
    fn hz(&self, speed: f64, confidence: f32) -> f64 {
        let sure = f64::from(confidence).clamp(0.0, 1.0);
        let sure = if sure.is_nan() { 0.0 } else { sure };
        (self.rest_hz + self.per_speed * (speed - self.still).max(0.0))
            * (UNSURE + (1.0 - UNSURE) * sure)
    }

    fn number(&self, state: &mut [f64; 2], target: f64, step: f64, confidence: f32) {
        let way = target - state[0];
        state[1] += (way / step - state[1]) * follow(self.speed_hz, step);
        state[0] += way * follow(self.hz(state[1].abs(), confidence), step);
    }
}

/// The share of the way that a low pass of `hz` goes in `step` seconds.
fn follow(hz: f64, step: f64) -> f64 {
    1.0 - (-std::f64::consts::TAU * hz.max(0.0) * step).exp()
}

fn tangent(motion: &MotionParams, joint: Joint) -> Vector3<f64> {
    let v = motion.axis_angle(joint);
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}
