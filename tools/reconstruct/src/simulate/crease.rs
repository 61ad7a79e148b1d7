//! Small shapes that follow the pose alone: cloth that bunches inside a bent elbow, knee or groin, and cheeks and lips
//! that bulge where an expression squeezes the skin. Both are smooth in the pose, so that a small network can learn them.

use super::Surface;
use glam::Vec3;
use spmm3::{Joint, MotionParams, Skeleton};

/// Distance between two folds, metres: finer than the mesh, so the Gaussians have the folds.
const FOLD_SPACING: f32 = 0.04;
/// Height of the folds inside a joint bent by a right angle, metres.
const FOLD_HEIGHT: f32 = 0.0045;
/// How far cloth bunches inside a joint bent by a right angle, and flattens outside, metres: part of the mesh.
const BUNCH_HEIGHT: f32 = 0.006;
/// How far folds reach along the limb from the joint, metres (deviation of a bell curve).
const FOLD_REACH: f32 = 0.075;
/// Limbs are thinner than this, metres: cloth further from the axis belongs to something else.
const LIMB_RADIUS: f32 = 0.16;
/// How much darker a fold's valley is than its ridge, relative to the fold's full height.
const VALLEY_SHADE: f32 = 0.3;

/// Metres of bulge for skin squeezed to nothing; real strains are below a third.
const BULGE: f32 = 0.004;
/// Strain beyond which skin folds instead (eyelids, mouth corners).
const MAX_STRAIN: f32 = 0.3;

/// A joint that folds the cloth around it.
#[derive(Debug, Clone, Copy)]
struct Hinge {
    joint: Joint,
    child: Joint,
    /// Side that closes when the joint bends.
    inner: Vec3,
    /// Axis-angle direction of bending.
    axis: Vec3,
}

const HINGES: [Hinge; 6] = [
    Hinge {
        joint: Joint::LeftElbow,
        child: Joint::LeftWrist,
        inner: Vec3::Z,
        axis: Vec3::NEG_Y,
    },
    Hinge {
        joint: Joint::RightElbow,
        child: Joint::RightWrist,
        inner: Vec3::Z,
        axis: Vec3::Y,
    },
    Hinge {
        joint: Joint::LeftKnee,
        child: Joint::LeftAnkle,
        inner: Vec3::NEG_Z,
        axis: Vec3::X,
    },
    Hinge {
        joint: Joint::RightKnee,
        child: Joint::RightAnkle,
        inner: Vec3::NEG_Z,
        axis: Vec3::X,
    },
    Hinge {
        joint: Joint::LeftHip,
        child: Joint::LeftKnee,
        inner: Vec3::Z,
        axis: Vec3::NEG_X,
    },
    Hinge {
        joint: Joint::RightHip,
        child: Joint::RightKnee,
        inner: Vec3::Z,
        axis: Vec3::NEG_X,
    },
];

/// Height of the cloth's folds at a point of the rest surface, metres along its normal.
#[derive(Debug, Clone)]
pub struct Creases {
    bends: [(f32, Vec3, Vec3, Vec3); HINGES.len()],
}

impl Creases {
    /// Reads how far each hinge is bent.
    #[must_use]
    pub fn new(skeleton: &Skeleton, motion: &MotionParams) -> Self {
        let rest = skeleton.rest_positions();
        let bends = HINGES.map(|hinge| {
            let bend = motion
                .axis_angle(hinge.joint)
                .dot(hinge.axis)
                .clamp(0.0, 2.4);
            let origin = rest[hinge.joint.index()];
            let along = (rest[hinge.child.index()] - origin).normalize_or(Vec3::NEG_Y);
            (
                bend / std::f32::consts::FRAC_PI_2,
                origin,
                along,
                hinge.inner,
            )
        });
        Self { bends }
    }

    /// How far the cloth bunches at a point of the T-pose, metres along its normal.
    #[must_use]
    pub fn bunch(&self, rest: Vec3) -> f32 {
        self.sum(rest, |_, side, _| {
            BUNCH_HEIGHT * (side.max(0.0) - 0.4 * (-side).max(0.0))
        })
    }

    /// Height of the fine folds at a point of the T-pose, metres along its normal.
    #[must_use]
    pub fn fold(&self, rest: Vec3) -> f32 {
        self.sum(rest, |s, side, turn| {
            // Folds run slightly askew around the limb, as fabric cut on the thread does, and fade towards the outside.
            let wave = ((s + 0.02 * turn) * std::f32::consts::TAU / FOLD_SPACING).cos();
            let inside = ((side + 0.5) / 1.5).clamp(0.0, 1.0);
            FOLD_HEIGHT * inside * inside * wave
        })
    }

    /// Factor by which a fold of `height` metres changes the light: valleys see less of the sky.
    #[must_use]
    pub fn fold_light(height: f32) -> f32 {
        1.0 + VALLEY_SHADE * (height / FOLD_HEIGHT).clamp(-1.3, 0.8)
    }

    fn sum(&self, rest: Vec3, shape: impl Fn(f32, f32, f32) -> f32) -> f32 {
        let mut height = 0.0;
        for (bend, origin, along, inner) in self.bends {
            let offset = rest - origin;
            let s = offset.dot(along);
            let radial = offset - along * s;
            let window = (-0.5 * (s / FOLD_REACH).powi(2)).exp();
            if bend < 1e-3 || window < 0.01 || radial.length() > LIMB_RADIUS {
                continue;
            }
            let fade = 1.0 - (radial.length() / LIMB_RADIUS).powi(4);
            let radial = radial.normalize_or_zero();
            let turn = along.cross(inner).dot(radial);
            height += bend * window * fade * shape(s, radial.dot(inner), turn);
        }
        height
    }
}

/// Bulge of each vertex where `moved` squeezes or stretches the edges of `rest`, metres along the normal.
///
/// `mask` is 1 on the skin of the face. Skin keeps its volume: what gets narrower gets thicker.
#[must_use]
pub fn bulges(surface: &Surface, rest: &[Vec3], moved: &[Vec3], mask: &[f32]) -> Vec<f32> {
    let mut heights: Vec<f32> = (0..rest.len())
        .map(|v| {
            let around = surface.neighbours(v);
            if mask[v] <= 0.0 || around.is_empty() {
                return 0.0;
            }
            let strain: f32 = around
                .iter()
                .map(|n| {
                    let n = *n as usize;
                    moved[v].distance(moved[n]) / rest[v].distance(rest[n]).max(1e-6) - 1.0
                })
                .sum();
            -BULGE * (strain / around.len() as f32).clamp(-MAX_STRAIN, MAX_STRAIN) * mask[v]
        })
        .collect();
    surface.smooth(&mut heights, 3);
    heights
}
