//! What is left of a session.

use crate::attendee::PersonReport;
use app_pipeline::lanes::Skipped;
use app_pipeline::quality::QualityFigures;
use renderer_splat::back_ends::BackEndTrial;
use renderer_splat::options::BackEnd;
use std::time::Instant;

/// What a session came to.
#[derive(Debug)]
pub struct SessionReport {
    /// Each person: those of the people who left before the end whose reports were kept, then those who were there, as they joined.
    pub people: Vec<PersonReport>,
    /// What was left out, of all people together.
    pub skipped: Skipped,
    /// What was given up to hold the display's rate.
    pub quality: QualityFigures,
    /// What drew ...
    pub back_end: BackEnd,
    /// ... and why.
    pub back_end_trial: Option<BackEndTrial>,
    /// When showing began ...
    pub began: Instant,
    /// ... and ended.
    pub ended: Instant,
}
