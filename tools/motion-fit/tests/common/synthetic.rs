//! A made-up network that looks at a known motion through a known camera, with the errors that BlazePose was measured to have: it places hips,
//! shoulders and head otherwise than the skeleton, and its depth leans to and fro.

#![allow(
    clippy::cast_possible_truncation,
    reason = "the landmarks and the avatar are f32, and counts of frames are small"
)]
#![allow(unreachable_pub, reason = "it is a module of several test programs")]
#![allow(dead_code, reason = "each program of tests uses a part of it")]

use crate::common::{M3, Random, V3, add, forward, mul_v, norm, rodrigues, scale, sub, transpose};
use glam::{Quat, Vec2, Vec3};
use motion_fit::{
    body::{BodyFit, BodyPose, FitConfig, Parts},
    landmarks::{BodyLandmarks, BodyPoint, Camera},
};
use spmm3::{Joint, MotionParams, Skeleton};

/// Landmark, joint, where it sits (left or middle; of the right twin in a mirror).
const PLACES: [(usize, usize, V3); 17] = [
    (0, 15, [0.0, 0.025, 0.125]),
    (1, 15, [0.02, 0.06, 0.1]),
    (2, 15, [0.032, 0.06, 0.095]),
    (3, 15, [0.045, 0.06, 0.085]),
    (7, 15, [0.078, 0.045, 0.005]),
    (9, 15, [0.022, -0.02, 0.1]),
    (11, 13, [0.08, 0.05, -0.005]),
    (13, 18, [0.0, 0.0, -0.01]),
    (15, 20, [0.005, 0.0, 0.0]),
    (17, 20, [0.08, -0.01, -0.035]),
    (19, 20, [0.09, -0.01, 0.02]),
    (21, 20, [0.04, -0.01, 0.035]),
    (23, 0, [0.1, -0.065, 0.05]),
    (25, 4, [0.0, 0.01, 0.015]),
    (27, 7, [0.0, 0.0, 0.0]),
    (29, 7, [0.0, -0.06, -0.05]),
    (31, 7, [0.015, -0.07, 0.17]),
];
/// In a picture hips are seen on the body's front, in metres inside of it.
const HIP_AHEAD: f64 = 0.05;
pub const TWINS: [usize; 33] = [
    0, 4, 5, 6, 1, 2, 3, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15, 18, 17, 20, 19, 22, 21, 24, 23, 26,
    25, 28, 27, 30, 29, 32, 31,
];
const JOINT_TWINS: [usize; 22] = [
    0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20,
];

/// The 33 landmarks in the person's space, metres.
pub fn places(skeleton: &Skeleton, motion: &MotionParams) -> [V3; 33] {
    let (rotations, positions) = forward(skeleton, motion);
    let mut out = [[0.0; 3]; 33];
    for (landmark, joint, offset) in PLACES {
        let mut set = |landmark: usize, joint: usize, offset: V3| {
            out[landmark] = add(positions[joint], mul_v(&rotations[joint], offset));
        };
        set(landmark, joint, offset);
        if TWINS[landmark] != landmark {
            let [x, y, z] = offset;
            set(TWINS[landmark], JOINT_TWINS[joint], [-x, y, z]);
        }
    }
    out
}

/// A camera in the person's space.
#[derive(Clone, Copy)]
pub struct Eye {
    pub at: V3,
    /// How far it looks down, radians.
    pub pitch: f64,
    pub camera: Camera,
}

impl Eye {
    /// Like a webcam: 720 by 960 pixels, at `height`, `distance` in front of the origin.
    pub fn new(height: f64, distance: f64, pitch: f64) -> Self {
        Self {
            at: [0.0, height, distance],
            pitch,
            camera: Camera {
                size: Vec2::new(720.0, 960.0),
                focal: 1000.0,
                centre: Vec2::new(360.0, 480.0),
            },
        }
    }
    /// From the person's to camera axes.
    pub fn axes(&self) -> M3 {
        let (s, c) = self.pitch.sin_cos();
        [[1.0, 0.0, 0.0], [0.0, -c, s], [0.0, -s, -c]]
    }
    pub fn see(&self, point: V3) -> V3 {
        mul_v(&self.axes(), sub(point, self.at))
    }
    /// The rotation from the camera's axis to the line of sight to `p`, about the axis across both.
    pub fn sight(&self, p: V3) -> M3 {
        let aside = p[0].hypot(p[1]);
        let turn = aside.atan2(p[2]) / aside.max(1e-9);
        rodrigues([-p[1] * turn, p[0] * turn, 0.0])
    }
    pub fn project(&self, p: V3) -> [f64; 2] {
        let f = f64::from(self.camera.focal);
        [
            f * p[0] / p[2] + f64::from(self.camera.centre.x),
            f * p[1] / p[2] + f64::from(self.camera.centre.y),
        ]
    }
}

/// Sizes of errors.
#[derive(Clone, Copy)]
pub struct Errors {
    /// New in each picture, metres.
    pub white: f64,
    /// Of each landmark, slowly changing, metres: across and along the line of sight.
    pub slow: [f64; 2],
    /// The whole body leaning: at the shoulders along the line of sight, metres.
    pub lean: f64,
    /// New in each picture and slowly changing, pixels.
    pub pixels: [f64; 2],
}

impl Errors {
    pub const NONE: Self = Self {
        white: 0.0,
        slow: [0.0; 2],
        lean: 0.0,
        pixels: [0.0; 2],
    };
    /// As measured of BlazePose on renders and real footage, roughly: limbs are off by 105 mm.
    pub const USUAL: Self = Self {
        slow: [0.03, 0.1],
        ..Self::SMALL
    };
    /// Of a better network.
    pub const SMALL: Self = Self {
        white: 0.006,
        slow: [0.012, 0.05],
        lean: 0.05,
        pixels: [1.0, 2.5],
    };
}

/// The network with its memory of slow errors.
pub struct Network {
    pub eye: Eye,
    pub errors: Errors,
    pub random: Random,
    slow: [V3; 33],
    pixels: [[f64; 2]; 33],
    lean: f64,
    begun: bool,
}

/// Memory of slow errors, seconds.
const MEMORY: f64 = 0.5;

impl Network {
    pub fn new(eye: Eye, errors: Errors, seed: u64) -> Self {
        Self {
            eye,
            errors,
            random: Random(seed),
            slow: [[0.0; 3]; 33],
            pixels: [[0.0; 2]; 33],
            lean: 0.0,
            begun: false,
        }
    }

    pub fn look(&mut self, skeleton: &Skeleton, motion: &MotionParams, step: f64) -> BodyLandmarks {
        let keep = if self.begun {
            (-step / MEMORY).exp()
        } else {
            0.0
        };
        let fresh = (1.0 - keep * keep).sqrt();
        self.begun = true;
        let random = &mut self.random;
        self.lean = self.lean * keep + fresh * random.normal();
        for (slow, pixels) in self.slow.iter_mut().zip(&mut self.pixels) {
            let n = random.normals();
            for i in 0..3 {
                slow[i] = slow[i] * keep + fresh * n[i];
            }
            for v in pixels {
                *v = *v * keep + fresh * random.normal();
            }
        }
        let places = places(skeleton, motion).map(|p| self.eye.see(p));
        let mut solid = places;
        let (turned, _) = forward(skeleton, motion);
        let ahead = mul_v(&self.eye.axes(), mul_v(&turned[0], [0.0, 0.0, HIP_AHEAD]));
        for hip in [23, 24] {
            solid[hip] = sub(solid[hip], ahead);
        }
        let hips = scale(add(solid[23], solid[24]), 0.5);
        let sight = self.eye.sight(scale(add(places[23], places[24]), 0.5));
        let mut points = [BodyPoint::default(); 33];
        for (i, point) in points.iter_mut().enumerate() {
            let e = &self.errors;
            let [u, v] = self.eye.project(places[i]);
            let mut m = sub(solid[i], hips);
            let slow = self.slow[i];
            m = add(
                m,
                [
                    slow[0] * e.slow[0],
                    slow[1] * e.slow[0],
                    slow[2] * e.slow[1] - self.lean * e.lean * m[1] / 0.5,
                ],
            );
            m = add(m, scale(random.normals(), e.white));
            // The network looks at a part of the picture, as if straight at the hips.
            m = mul_v(&transpose(&sight), m);
            *point = BodyPoint {
                pixel: Vec2::new(
                    (u + e.pixels[0] * random.normal() + e.pixels[1] * self.pixels[i][0]) as f32,
                    (v + e.pixels[0] * random.normal() + e.pixels[1] * self.pixels[i][1]) as f32,
                ),
                metres: Vec3::new(m[0] as f32, m[1] as f32, m[2] as f32),
                confidence: 0.99,
            };
        }
        BodyLandmarks { points }
    }
}

/// Left and right mistaken.
pub fn swapped(seen: &BodyLandmarks) -> BodyLandmarks {
    BodyLandmarks {
        points: std::array::from_fn(|i| seen.points[TWINS[i]]),
    }
}

/// Limb joints: hips, knees, ankles, shoulders, elbows, wrists.
pub const LIMBS: [usize; 12] = [1, 2, 4, 5, 7, 8, 16, 17, 18, 19, 20, 21];

/// How a run of poses compares with the truth.
#[derive(Debug, Default, Clone, Copy)]
pub struct Score {
    /// Mean distance of the limbs' joints relative to the pelvis, mm.
    pub limbs_mm: f64,
    /// Mean angle of the pelvis in the world, degrees.
    pub pelvis_degrees: f64,
    /// Mean signed and root mean square lean of the trunk towards the camera against the truth, degrees.
    pub lean_degrees: [f64; 2],
    /// Mean speed of soles that truly stand, m/s, and of the truth's.
    pub slide: [f64; 2],
    /// Mean size of the second difference of the limbs' joints relative to the pelvis, mm a frame squared, and of the truth's.
    pub jitter: [f64; 2],
    /// Mean distance of the root's movement since the first frame, mm.
    pub root_mm: f64,
    /// Mean height of the lowest ankle less the truth's, mm.
    pub height_mm: f64,
}

/// Compares from frame `from` on.
pub fn score(
    skeleton: &Skeleton,
    truth: &[MotionParams],
    fitted: &[MotionParams],
    rate: f64,
    from: usize,
) -> Score {
    let t: Vec<_> = truth.iter().map(|m| forward(skeleton, m)).collect();
    let f: Vec<_> = fitted.iter().map(|m| forward(skeleton, m)).collect();
    let count = (t.len() - from) as f64;
    let mut s = Score::default();
    let rel = |p: &[V3; 22], j: usize| sub(p[j], p[0]);
    let mut lean = 0.0_f64;
    for i in from..t.len() {
        for j in LIMBS {
            s.limbs_mm += norm(sub(rel(&t[i].1, j), rel(&f[i].1, j))) * 1e3 / 12.0 / count;
            if i >= from + 2 {
                for (k, run) in [&f, &t].into_iter().enumerate() {
                    let second = add(
                        sub(rel(&run[i].1, j), scale(rel(&run[i - 1].1, j), 2.0)),
                        rel(&run[i - 2].1, j),
                    );
                    s.jitter[k] += norm(second) * 1e3 / 12.0 / (count - 2.0);
                }
            }
        }
        let turn = crate::common::mul(&f[i].0[0], &transpose(&t[i].0[0]));
        s.pelvis_degrees += crate::common::angle(&turn).to_degrees() / count;
        let tilt = |p: &[V3; 22]| {
            let trunk = sub(p[12], p[0]);
            trunk[2].atan2(trunk[1]).to_degrees()
        };
        let d = tilt(&f[i].1) - tilt(&t[i].1);
        s.lean_degrees[0] += d / count;
        lean += d * d / count;
        let low = |p: &[V3; 22]| p[7][1].min(p[8][1]);
        s.height_mm += (low(&f[i].1) - low(&t[i].1)) * 1e3 / count;
        let moved = |run: &[([M3; 22], [V3; 22])]| sub(run[i].1[0], run[0].1[0]);
        s.root_mm += norm(sub(moved(&t), moved(&f))) * 1e3 / count;
    }
    s.lean_degrees[1] = lean.sqrt();
    // The ankle stands where the truth's moves slower than 0.1 m/s.
    let mut stance = 0.0;
    for i in from.max(1)..t.len() {
        for j in [7, 8] {
            let speed = |run: &[([M3; 22], [V3; 22])]| {
                let d = sub(run[i].1[j], run[i - 1].1[j]);
                norm([d[0], 0.0, d[2]]) * rate
            };
            if speed(&t) < 0.15 {
                stance += 1.0;
                s.slide[0] += speed(&f);
                s.slide[1] += speed(&t);
            }
        }
    }
    s.slide = s.slide.map(|v| v / f64::max(stance, 1.0));
    s
}

/// The pose as motion parameters.
pub fn motion(pose: &BodyPose) -> MotionParams {
    let mut motion = MotionParams::default();
    pose.write(&mut motion);
    motion
}

/// Pictures a second.
pub const RATE: f64 = 30.0;

/// The recording at 30 Hz, turned about the floor's origin and moved there with the middle of its way.
pub fn performance(name: &str, yaw: f32) -> Option<Vec<MotionParams>> {
    let clip = crate::common::recording(name)?;
    let mut frames = crate::common::frames(&clip, RATE);
    let turn = Quat::from_rotation_y(yaw);
    let pelvis = crate::common::skeleton().rest_positions()[0] * Vec3::new(1.0, 0.0, 1.0);
    let middle = (frames[0].root_translation + frames[frames.len() - 1].root_translation) / 2.0;
    for frame in &mut frames {
        let rotation = turn * frame.rotation(Joint::Pelvis);
        frame.set_rotation(Joint::Pelvis, rotation);
        let mut at = frame.root_translation - middle * Vec3::new(1.0, 0.0, 1.0);
        at = turn * (at + pelvis) - pelvis;
        frame.root_translation = at;
    }
    Some(frames)
}

/// Fits all frames; `mistake` says in which left and right are exchanged.
pub fn run(
    truth: &[MotionParams],
    eye: Eye,
    errors: Errors,
    parts: Parts,
    seed: u64,
    mistake: impl Fn(usize) -> bool,
) -> Vec<BodyPose> {
    let skeleton = crate::common::skeleton();
    let mut network = Network::new(eye, errors, seed);
    let config = FitConfig {
        parts,
        ..FitConfig::new(eye.camera)
    };
    let mut fit = BodyFit::new(&skeleton, config);
    truth
        .iter()
        .enumerate()
        .map(|(i, frame)| {
            let mut seen = network.look(&skeleton, frame, 1.0 / RATE);
            if mistake(i) {
                seen = swapped(&seen);
            }
            fit.fit(i as f64 / RATE, Some(&seen))
        })
        .collect()
}

/// The poses as motion parameters.
pub fn moves(poses: &[BodyPose]) -> Vec<MotionParams> {
    poses.iter().map(motion).collect()
}
