//! What was measured while a scan was prepared.

use super::landmarks::{ANKLES, ELBOWS, HIPS, KNEES, SHOULDERS, WRISTS};
use super::upright::UpScore;
use crate::points::KeyPoint;
use motion_fit::landmarks::BODY_LANDMARKS;
use std::time::Instant;

/// What was measured while a scan was prepared.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figures {
    /// Candidates for up, in the scene's axes, that were looked at, and how much each looks like a standing person, 0..=4.
    pub up: Vec<UpScore>,
    /// How far up was from the best candidate in the end, degrees.
    pub tilt_degrees: f64,
    /// Planes (floors, walls) that were taken off.
    pub planes: usize,
    /// Gaussians that were taken for the person's.
    pub gaussians: usize,
    /// Of the last views, in how many the body was seen.
    pub views: usize,
    /// In how many of them several people were seen.
    pub crowded: usize,
    /// In how many of them left and right were exchanged.
    pub exchanged: usize,
    /// Share of what the scan shows, by area, that is not about the person's bones: 0..=1.
    pub beside: f64,
    /// Median residual of the body's landmarks, metres.
    pub body_residual: f64,
    /// Median residual of the face's landmarks, metres; nothing without a face.
    pub face_residual: Option<f64>,
    /// Seconds that each step took, in order.
    pub seconds: Vec<(&'static str, f64)>,
    /// What may be wrong with the result, as sentences for the user.
    pub doubts: Vec<String>,
}

/// Measures steps that follow each other.
pub(super) struct Steps {
    start: Instant,
    pub(super) seconds: Vec<(&'static str, f64)>,
}

impl Steps {
    pub(super) fn start() -> Self {
        Self {
            start: Instant::now(),
            seconds: Vec::new(),
        }
    }

    /// The step of that name ended.
    pub(super) fn ended(&mut self, name: &'static str) {
        self.seconds
            .push((name, self.start.elapsed().as_secs_f64()));
        self.start = Instant::now();
    }
}

/// The landmarks that are joints of limbs.
pub(super) fn joints(points: &[KeyPoint; BODY_LANDMARKS]) -> impl Iterator<Item = &KeyPoint> {
    let all = [SHOULDERS, ELBOWS, WRISTS, HIPS, KNEES, ANKLES];
    all.into_iter().flatten().map(|at| &points[at])
}
