//! A realistic skeleton, recordings, random numbers and an independent forward kinematics.

#![allow(unreachable_pub, reason = "it is a module of several test programs")]
#![allow(dead_code, reason = "each program of tests uses a part of it")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::cast_possible_truncation,
    reason = "tests fail by panicking; figures are narrowed for the avatar's f32"
)]

use glam::Vec3;
use spmm3::{JOINTS, Joint, LoadOptions, MotionClip, MotionParams, Playback, Skeleton};
use std::path::Path;

/// Joints from pelvis to wrists of a grown person in T-pose, metres, soles on y = 0: pelvis, then the left of each pair.
const REST: [(usize, [f64; 3]); 14] = [
    (0, [0.0, 0.98, 0.0282]),
    (1, [0.0686, 0.889, 0.0227]),
    (3, [0.0, 1.0889, 0.0015]),
    (4, [0.105, 0.5103, 0.016]),
    (6, [0.0, 1.2241, 0.0026]),
    (7, [0.09, 0.1119, -0.027]),
    (9, [0.0, 1.277, 0.028]),
    (10, [0.116, 0.06, 0.0943]),
    (12, [0.0, 1.4909, -0.0148]),
    (13, [0.08, 1.3973, -0.0083]),
    (15, [0.0, 1.5559, 0.0365]),
    (16, [0.1738, 1.4288, -0.0173]),
    (18, [0.4304, 1.4158, -0.0418]),
    (20, [0.6827, 1.4242, -0.0451]),
];

/// The skeleton that tests fit.
pub fn skeleton() -> Skeleton {
    let mut rest = [Vec3::ZERO; JOINTS];
    let mut set = |joint: Joint, at: Vec3| {
        rest[joint.index()] = at;
        if let Some(twin) = joint.name().strip_prefix("left_") {
            let name = format!("right_{twin}");
            if let Some(right) = Joint::ALL.into_iter().find(|j| j.name() == name) {
                rest[right.index()] = at * Vec3::new(-1.0, 1.0, 1.0);
            }
        }
    };
    for (joint, [x, y, z]) in REST {
        set(Joint::ALL[joint], Vec3::new(x as f32, y as f32, z as f32));
    }
    let wrist = Vec3::new(0.6827, 1.4242, -0.0451);
    for (first, side, along) in [
        (Joint::LeftIndex1, 0.025, 0.10),
        (Joint::LeftMiddle1, 0.003, 0.105),
        (Joint::LeftPinky1, -0.04, 0.08),
        (Joint::LeftRing1, -0.02, 0.095),
        (Joint::LeftThumb1, 0.03, 0.03),
    ] {
        for bone in 0..3 {
            let at = wrist + Vec3::new(along + 0.03 * bone as f32, -0.01, side);
            set(Joint::ALL[first.index() + bone], at);
        }
    }
    let head = Vec3::new(0.0, 1.5559, 0.0365);
    set(Joint::Jaw, head + Vec3::new(0.0, 0.0, 0.02));
    set(Joint::LeftEye, head + Vec3::new(0.03, 0.065, 0.08));
    rest[Joint::RightEye.index()] = head + Vec3::new(-0.03, 0.065, 0.08);
    Skeleton::new(rest).expect("finite")
}

/// A recording of `shared/data` on [`skeleton`]; nothing, after a line that says so, where it is missing. On CI that is a failure.
pub fn recording(name: &str) -> Option<MotionClip> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if !path.exists() {
        assert!(
            std::env::var("CI").as_deref() != Ok("true"),
            "{} is missing, and CI must have it",
            path.display()
        );
        println!("skipped: {} is not here", path.display());
        return None;
    }
    Some(MotionClip::load(&path, &skeleton(), &LoadOptions::default()).expect("a recording"))
}

/// The recording at `rate` frames a second.
pub fn frames(clip: &MotionClip, rate: f64) -> Vec<MotionParams> {
    let count = (clip.duration() * rate).floor() as usize;
    (0..count)
        .map(|i| clip.sample(i as f64 / rate, Playback::Clamp))
        .collect()
}

/// A seeded source of numbers (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// 0..1
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    /// -1..1
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
    /// Roughly normal, standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
    pub fn normals(&mut self) -> V3 {
        [self.normal(), self.normal(), self.normal()]
    }
}

pub type V3 = [f64; 3];
pub type M3 = [[f64; 3]; 3];

pub fn add(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] + b[i])
}
pub fn sub(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] - b[i])
}
pub fn scale(a: V3, k: f64) -> V3 {
    a.map(|v| v * k)
}
pub fn norm(a: V3) -> f64 {
    a.iter().map(|v| v * v).sum::<f64>().sqrt()
}
pub fn mul_v(m: &M3, x: V3) -> V3 {
    std::array::from_fn(|i| (0..3).map(|k| m[i][k] * x[k]).sum())
}
pub fn mul(a: &M3, b: &M3) -> M3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}
pub fn transpose(m: &M3) -> M3 {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}
/// Rodrigues' formula.
pub fn rodrigues(v: V3) -> M3 {
    let angle = norm(v);
    if angle < 1e-12 {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let [x, y, z] = scale(v, 1.0 / angle);
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
        [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
        [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
    ]
}
/// Angle of a rotation matrix, radians.
pub fn angle(m: &M3) -> f64 {
    let w = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    (norm(w) / 2.0).atan2((m[0][0] + m[1][1] + m[2][2] - 1.0) / 2.0)
}

pub const PARENTS: [usize; 22] = [
    0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19,
];

/// Each body joint's world rotation and position, with the root's translation.
pub fn forward(skeleton: &Skeleton, motion: &MotionParams) -> ([M3; 22], [V3; 22]) {
    let rest = skeleton
        .rest_positions()
        .map(|v| [f64::from(v.x), f64::from(v.y), f64::from(v.z)]);
    let mut rotations = [[[0.0; 3]; 3]; 22];
    let mut positions = [[0.0; 3]; 22];
    let root = motion.root_translation;
    for joint in 0..22 {
        let v = &motion.values()[3 * joint..3 * joint + 3];
        let turn = rodrigues([f64::from(v[0]), f64::from(v[1]), f64::from(v[2])]);
        if joint == 0 {
            rotations[0] = turn;
            positions[0] = add(
                rest[0],
                [f64::from(root.x), f64::from(root.y), f64::from(root.z)],
            );
        } else {
            let p = PARENTS[joint];
            rotations[joint] = mul(&rotations[p], &turn);
            positions[joint] = add(
                positions[p],
                mul_v(&rotations[p], sub(rest[joint], rest[p])),
            );
        }
    }
    (rotations, positions)
}
