//! One picture's landmarks made safe, and left and right exchanged where they were mistaken.

use super::chain::wide;
use crate::landmarks::blazepose::{
    ANKLES, EARS, ELBOWS, EYES, HIPS, KNEES, LOWER, NOSE, SHOULDERS, WRISTS, mirrored,
};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint, Camera};
use glam::{DMat3, DQuat, DVec2};
use nalgebra::{Matrix3, Vector2, Vector3};

/// A landmark less sure than this counts as not seen.
pub(super) const UNSEEN: f64 = 0.1;
/// Landmarks further from the hips than this are mistakes, metres.
const FURTHEST: f64 = 4.0;
/// Landmarks further outside are mistakes, pixels.
const OUTERMOST: f64 = 1e5;

/// A landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    pub(super) pixel: Vector2<f64>,
    /// Relative to the middle of [`Reading::root`], in the camera's own axes with y up and z towards it, so not yet level. Metres as the
    /// network guesses them.
    pub(super) metres: Vector3<f64>,
    /// 0..=1, and 0 below [`UNSEEN`].
    pub(super) confidence: f64,
}

/// All landmarks of one picture, every number finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reading {
    pub(super) points: [Seen; BODY_LANDMARKS],
    /// The pair that all metres are relative to the middle of: the hips; where none is seen, the shoulders; of a face alone, the ears.
    pub(super) root: [usize; 2],
}

impl Reading {
    /// Takes what a network said of a picture of `camera`; a landmark with a number that cannot be is not seen. `None` where too little of the body is seen to
    /// place it.
    pub(super) fn new(body: &BodyLandmarks, camera: &Camera) -> Option<Self> {
        let mut points = body.points.map(|point| {
            let metres = wide(point.metres).component_mul(&Vector3::new(1.0, -1.0, -1.0));
            let possible = metres.iter().all(|v| v.abs() < FURTHEST);
            let seen = sure_pixel(&point).filter(|_| possible);
            seen.map_or(
                Seen {
                    pixel: Vector2::zeros(),
                    metres: Vector3::zeros(),
                    confidence: 0.0,
                },
                |(pixel, confidence)| Seen {
                    pixel,
                    metres,
                    confidence,
                },
            )
        });
        let seen = |point: usize| points[point].confidence > 0.3;
        let hips = HIPS.map(|h| points[h].confidence > 0.0);
        let count = |of: &[usize]| of.iter().filter(|p| seen(**p)).count();
        let torso = count(&SHOULDERS) + count(&HIPS);
        let head = count(&EARS) + count(&EYES) + count(&[NOSE]);
        // Before a desk, neither hips nor legs are in the picture; close to a camera, the face is all there is.
        let root = if torso >= 2 && hips != [false, false] {
            HIPS
        } else if count(&SHOULDERS) == 2 {
            SHOULDERS
        } else if head >= 4 && count(&EARS) == 2 {
            EARS
        } else {
            return None;
        };
        // With one hip gone, relative to the network's own zero.
        let middle = if root == HIPS && hips != [true, true] {
            Vector3::zeros()
        } else {
            (points[root[0]].metres + points[root[1]].metres) / 2.0
        };
        // A face alone is in the camera's own axes.
        let axes = if root == EARS {
            Matrix3::identity()
        } else {
            let seen = (root.into_iter()).filter(|at| points[*at].confidence > 0.0);
            let count = seen.clone().count().max(1) as f64;
            let pixel = seen.map(|at| points[at].pixel).sum::<Vector2<f64>>() / count;
            upright_axes(camera.line_of_sight(DVec2::new(pixel.x, pixel.y)))
        };
        for point in &mut points {
            point.metres = axes * (point.metres - middle);
        }
        Some(Self { points, root })
    }

    /// The middle of a pair, in the axes of [`Seen::metres`].
    pub(super) fn middle(&self, pair: [usize; 2]) -> Vector3<f64> {
        (self.points[pair[0]].metres + self.points[pair[1]].metres) / 2.0
    }

    /// Whether both of a pair are seen with at least so much confidence.
    pub(super) fn both(&self, pair: [usize; 2], confidence: f64) -> bool {
        pair.iter()
            .all(|p| self.points[*p].confidence >= confidence)
    }

    /// Left and right of face and arms, and of hips and legs, exchanged as asked for.
    pub(super) fn exchanged(&self, exchange: Exchange) -> Self {
        Self {
            root: self.root,
            points: std::array::from_fn(|i| {
                let swap = if i < LOWER {
                    exchange.upper
                } else {
                    exchange.lower
                };
                self.points[if swap { mirrored(i) } else { i }]
            }),
        }
    }

    /// Pixels and metres as seen by `level_from_camera` and a scale.
    pub(super) fn levelled(&self, level: &Matrix3<f64>, scale: f64) -> Self {
        let mut out = *self;
        for point in &mut out.points {
            point.metres = level * point.metres * scale;
        }
        out
    }
}

/// Where a landmark is in the picture, pixels, and how sure that is, 0..=1; `None` of one that is less sure than [`UNSEEN`] or has a number that cannot be.
pub(super) fn sure_pixel(point: &BodyPoint) -> Option<(Vector2<f64>, f64)> {
    let pixel = Vector2::new(f64::from(point.pixel.x), f64::from(point.pixel.y));
    let confidence = f64::from(point.confidence).clamp(0.0, 1.0);
    let possible = pixel.iter().all(|v| v.abs() < OUTERMOST) && confidence >= UNSEEN;
    possible.then_some((pixel, confidence))
}

/// A rotation in the camera's axes (y down, z away), in those with y up and z towards it.
pub(crate) fn upright_axes(rotation: DQuat) -> Matrix3<f64> {
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let rotation = DMat3::from_quat(rotation).to_cols_array();
    flip * Matrix3::from_column_slice(&rotation) * flip
}

/// Which halves of a body have left and right exchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Exchange {
    /// Face, arms and hands.
    pub(super) upper: bool,
    /// Hips, legs and feet.
    pub(super) lower: bool,
}

impl Exchange {
    pub(super) const NONE: Self = Self {
        upper: false,
        lower: false,
    };
    pub(super) const BOTH: Self = Self {
        upper: true,
        lower: true,
    };

    /// Which labelling of `reading` (levelled, scaled) is nearer to where `expected` has each landmark, relative to the hips.
    ///
    /// A network that mistakes left for right is as sure as ever (0.999 was seen), so only continuity tells.
    pub(super) fn guess(
        reading: &Reading,
        expected: &[Option<Vector3<f64>>; BODY_LANDMARKS],
    ) -> Self {
        const LABELLED: [[usize; 2]; 7] = [EARS, SHOULDERS, ELBOWS, WRISTS, HIPS, KNEES, ANKLES];
        let mut halves = [[0.0_f64; 2]; 2];
        for pair in LABELLED {
            let half = usize::from(pair[0] >= LOWER);
            for (side, twin) in [(pair[0], pair[1]), (pair[1], pair[0])] {
                let (Some(expected), own, other) =
                    (expected[side], &reading.points[side], &reading.points[twin])
                else {
                    continue;
                };
                let weight = own.confidence.min(other.confidence);
                let distance = |seen: &Vector3<f64>| {
                    // Depth is the least sure.
                    (seen - expected)
                        .component_mul(&Vector3::new(1.0, 1.0, 0.3))
                        .norm()
                };
                halves[half][0] += weight * distance(&own.metres);
                halves[half][1] += weight * distance(&other.metres);
            }
        }
        let [upper, lower] = halves;
        let whole = [upper[0] + lower[0], upper[1] + lower[1]];
        if whole[1] < 0.7 * whole[0] {
            // Both, but for a half that clearly speaks against it.
            return Self {
                upper: upper[1] < 1.3 * upper[0],
                lower: lower[1] < 1.3 * lower[0],
            };
        }
        // One half alone needs more: crossed arms and passing legs look like that for a moment.
        Self {
            upper: upper[1] < 0.5 * upper[0] && upper[0] > 0.3,
            lower: lower[1] < 0.5 * lower[0] && lower[0] > 0.3,
        }
    }
}
