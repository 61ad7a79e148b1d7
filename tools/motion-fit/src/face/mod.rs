//! A face from its landmarks: how the head is turned, what the face does compared with its own neutral one, and which of the
//! avatar's named expressions show that.

mod express;
mod neutral;
mod shape;

pub use express::{FacePose, apply};

use crate::landmarks::{Camera, FaceLandmarks};
use glam::{DQuat, DVec2, DVec3};
use neutral::{Neutral, Usual};
use shape::Lengths;

/// Below this probability a face is not read.
const LEAST_CONFIDENCE: f32 = 0.3;
/// Longest time between two pictures that the neutral face follows, seconds.
const LONGEST_STEP: f64 = 0.2;
/// Lengths (outer corners of the eyes = 1) that make a measure 1.
const OPEN: f64 = 0.30;
const WIDTH: f64 = 0.10;
const CORNERS: f64 = 0.08;
const PRESS: f64 = 0.08;
const BROW: f64 = 0.03;
/// Movement of a brow that noise makes.
const BROW_STILL: f64 = 0.006;
/// By how much the mesh lifts a brow whose eye is shut. As on renders, as are the two above: the avatar's own brows rise by 0.026.
const BROW_BLINK: f64 = 0.027;
/// How much a brow seems to rise when the head is pitched down by a radian: the mesh's depth is not exact. As on renders.
const BROW_PITCH: f64 = 0.069;
/// The opening of the lids, as share of the open eye's, at which a blink begins and at which it is complete: lashes and blur
/// keep the lids of a shut eye apart.
const BLINK: [f64; 2] = [0.85, 0.40];
/// A blink from which on the iris is not seen; the mesh lifts the brow then.
const IRIS_HIDDEN: f64 = 0.5;
/// Largest gaze against the head, radians: to a side, and up or down.
const GAZE: DVec2 = DVec2::new(0.7, 0.5);

/// What a face does in one picture. Measures are relative to the person's own neutral face and do not depend on the person.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaceMeasures {
    /// From the axes of the avatar's T-pose (y up, facing +z) to the camera's (x right, y down, z away): the head joint's own
    /// rotation in the camera's axes.
    pub camera_from_head: DQuat,
    /// Opening of the lips, 0..=1; a jaw that opens by 20 degrees makes 1.
    pub mouth_open: f64,
    /// The mouth made wide (to 1) or pursed (to -1.5).
    pub mouth_width: f64,
    /// The mouth's corners pulled up (a smile, to 1.5) or down (to -1).
    pub corners: f64,
    /// The lips' red pressed in, 0..=1; below 0 (to -1) it is turned out.
    pub lip_press: f64,
    /// Each brow raised (to 1) or lowered (to -1): left, right.
    pub brows: [f64; 2],
    /// Each eye closed, 0..=1: left, right.
    pub blink: [f64; 2],
    /// Where both eyes look against the head, radians: to the person's left, and up.
    pub gaze: DVec2,
    /// The network's probability, 0..=1.
    pub confidence: f64,
}

/// Follows one person's face: knows their neutral one.
#[derive(Debug, Clone)]
pub struct FaceFit {
    gap: Neutral,
    width: Neutral,
    corners: Neutral,
    lips: Neutral,
    brows: [Neutral; 2],
    lids: [Neutral; 2],
    gaze: [Neutral; 2],
    looks: DVec2,
    raised: [f64; 2],
    last: Option<f64>,
}

impl Default for FaceFit {
    fn default() -> Self {
        Self::new()
    }
}

impl FaceFit {
    /// For a person who was not seen yet.
    #[must_use]
    pub fn new() -> Self {
        let length = |value: f64, range: f64, quantile: f64, rate: f64| {
            Neutral::new(Usual {
                value,
                range,
                quantile,
                rate,
            })
        };
        Self {
            gap: length(0.01, 0.06, 0.2, 0.01),
            width: length(0.57, 0.15, 0.5, 0.005),
            corners: length(-0.21, 0.10, 0.4, 0.004),
            lips: length(0.18, 0.10, 0.6, 0.004),
            brows: std::array::from_fn(|_| length(0.22, 0.12, 0.45, 0.004)),
            lids: std::array::from_fn(|_| length(0.27, 0.17, 0.8, 0.02)),
            gaze: std::array::from_fn(|_| length(0.0, 0.4, 0.5, 0.02)),
            looks: DVec2::ZERO,
            raised: [0.0; 2],
            last: None,
        }
    }

    /// Takes the neutral face for known as it is, and follows no more. What was seen for less than a second is learnt first.
    pub fn hold(&mut self) {
        let lengths = [
            &mut self.gap,
            &mut self.width,
            &mut self.corners,
            &mut self.lips,
        ];
        let pairs = [&mut self.brows, &mut self.lids, &mut self.gaze];
        for neutral in lengths.into_iter().chain(pairs.into_iter().flatten()) {
            neutral.hold();
        }
    }

    /// Reads the face that was seen at `seconds` on the source's clock. With the `camera` the rotation is right also where the
    /// head is not in the picture's middle. Nothing where the landmarks show no face: too small, not finite, improbable.
    pub fn measure(
        &mut self,
        face: &FaceLandmarks,
        seconds: f64,
        camera: Option<&Camera>,
    ) -> Option<FaceMeasures> {
        let improbable = !(face.confidence.is_finite() && face.confidence >= LEAST_CONFIDENCE);
        if improbable {
            return None;
        }
        let similarity = shape::align(&face.points)?;
        let Lengths {
            gap,
            width,
            corners,
            lips,
            brows,
            lids,
            gaze,
        } = shape::measure(&face.points, &similarity)?;
        let step = self.last.map_or(0.0, |last| seconds - last);
        let step = if step.is_finite() {
            step.clamp(0.0, LONGEST_STEP)
        } else {
            0.0
        };
        if seconds.is_finite() {
            self.last = Some(seconds);
        }
        let forward = similarity.to_from * DVec3::Z;
        let pitch_down = forward.y.clamp(-1.0, 1.0).asin();
        let brows = brows.map(|height| height - BROW_PITCH * pitch_down);
        self.gap.see(gap, step);
        self.width.see(width, step);
        self.corners.see(corners, step);
        self.lips.see(lips, step);
        let mut blink = [0.0; 2];
        for side in [0, 1] {
            self.lids[side].see(lids[side], step);
            let open = self.lids[side].value();
            let share = lids[side] / open.max(0.05);
            blink[side] = ((BLINK[0] - share) / (BLINK[0] - BLINK[1])).clamp(0.0, 1.0);
            if blink[side] >= IRIS_HIDDEN {
                continue;
            }
            let height = brows[side] - BROW_BLINK * blink[side];
            self.brows[side].see(height, step);
            let rise = height - self.brows[side].value();
            let moved = rise.signum() * (rise.abs() - BROW_STILL).max(0.0);
            self.raised[side] = (moved / (BROW - BROW_STILL)).clamp(-1.0, 1.0);
        }
        // Irises behind lids say nothing: the eyes keep their direction through a blink.
        if blink[0].max(blink[1]) < IRIS_HIDDEN {
            self.gaze[0].see(gaze.x, step);
            self.gaze[1].see(gaze.y, step);
            let straight = DVec2::new(self.gaze[0].value(), self.gaze[1].value());
            let sine = (gaze - straight).clamp(DVec2::NEG_ONE, DVec2::ONE);
            self.looks = DVec2::new(sine.x.asin(), sine.y.asin()).clamp(-GAZE, GAZE);
        }
        let measure = |value: f64, neutral: &Neutral, unit: f64, low: f64, high: f64| {
            ((value - neutral.value()) / unit).clamp(low, high)
        };
        Some(FaceMeasures {
            camera_from_head: camera.map_or(DQuat::IDENTITY, |camera| {
                camera.line_of_sight(similarity.to_centre.truncate())
            }) * similarity.to_from,
            mouth_open: measure(gap, &self.gap, OPEN, 0.0, 1.0),
            mouth_width: measure(width, &self.width, WIDTH, -1.5, 1.0),
            corners: measure(corners, &self.corners, CORNERS, -1.0, 1.5),
            lip_press: measure(lips, &self.lips, -PRESS, -1.0, 1.0),
            brows: self.raised,
            blink,
            gaze: self.looks,
            confidence: f64::from(face.confidence.min(1.0)),
        })
    }
}

#[cfg(test)]
mod tests;
