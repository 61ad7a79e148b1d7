//! The two ways in which what was seen becomes motion.

use motion_fit::landmarks::{Camera, Observation};
use motion_fit::{Fitted, MotionFit, Subject, fit_recording};
use serde::Serialize;

/// How pictures are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum FitBy {
    /// One after the other, as a call has them.
    Live,
    /// As a whole, when the recording is there.
    Recording,
}

impl FitBy {
    pub(super) const ALL: [Self; 2] = [Self::Live, Self::Recording];

    /// As tables have it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::Recording => "recording",
        }
    }

    /// The motion of one camera's pictures.
    pub(super) fn fit(
        self,
        subject: &Subject<'_>,
        camera: Camera,
        seen: &[Observation],
    ) -> Vec<Fitted> {
        match self {
            Self::Live => {
                let mut fit = MotionFit::new(subject, camera);
                seen.iter().map(|seen| fit.step(seen)).collect()
            }
            Self::Recording => fit_recording(subject, camera, seen),
        }
    }
}
