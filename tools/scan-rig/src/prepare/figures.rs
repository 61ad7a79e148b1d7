//! What was measured while a scan was prepared.

use super::upright::UpScore;
use crate::stopwatch::StepSeconds;
use serde::Serialize;

/// What was measured while a scan was prepared.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Candidates for up, in the scene's axes, that were looked at, and how much each looks like a standing person, 0..=4.
    pub candidates: Vec<UpScore>,
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
    /// What each step took, in order. Never in a package, which is the same whenever it is made.
    #[serde(skip)]
    pub steps: Vec<StepSeconds>,
    /// What may be wrong with the result, as sentences for the user.
    #[serde(skip)]
    pub doubts: Vec<String>,
}
