//! A whole recording of one camera. What comes later is known, so nothing lags, and feet stand from the picture in which they are put down.

use crate::body::FootLock;
use crate::landmarks::Camera;
use crate::landmarks::estimates::Observation;
use crate::motion_fit::{Fitted, MotionFit, Subject, Unsmoothed};
use crate::smoother::{SmoothConfig, smooth_all};

/// The motion of a recording's pictures, in the order of their time, as [`MotionFit::step`] has it of each, but smoothed forwards and backwards, and with feet held where they
/// stand on average while they stand.
#[must_use]
pub fn fit_recording(
    subject: &Subject<'_>,
    camera: Camera,
    observations: &[Observation],
) -> Vec<Fitted> {
    let mut fit = MotionFit::new(subject, camera);
    let looks: Vec<Unsmoothed> = observations.iter().map(|seen| fit.look(seen)).collect();
    let mut frames: Vec<_> = (observations.iter().zip(&looks))
        .map(|(seen, look)| {
            let motion = look.fitted.motion.clone();
            (seen.seconds, motion, look.confidence.clone())
        })
        .collect();
    smooth_all(&SmoothConfig::default(), &mut frames);
    let standing: Vec<_> = looks.iter().map(|look| look.standing).collect();
    let mut motions: Vec<_> = frames.into_iter().map(|(_, motion, _)| motion).collect();
    FootLock::new(subject.skeleton).apply_all(&mut motions, &standing);
    (looks.into_iter().zip(motions))
        .map(|(look, motion)| Fitted {
            motion,
            ..look.fitted
        })
        .collect()
}
