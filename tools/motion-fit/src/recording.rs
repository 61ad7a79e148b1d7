//! A whole recording of one camera. What comes later is known, so nothing lags, and feet stand from the picture in which they are put down.

use crate::landmarks::Camera;
use crate::landmarks::estimates::Observation;
use crate::motion_fit::{Fitted, MotionFit, Subject};

/// The motion of a recording's pictures, in the order of their time: each as [`MotionFit::look`] has it, and all of them smoothed as
/// [`MotionFit::smooth_recording`] says.
#[must_use]
pub fn fit_recording(
    subject: &Subject<'_>,
    camera: Camera,
    observations: &[Observation],
) -> Vec<Fitted> {
    let mut fit = MotionFit::new(subject, camera);
    let looks = observations.iter().map(|seen| fit.look(seen)).collect();
    fit.smooth_recording(looks)
}
