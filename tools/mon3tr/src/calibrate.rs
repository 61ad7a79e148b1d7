//! `--calibrate`: two seconds of standing before the camera, and what a person is told meanwhile.

use motion_fit::MotionFit;
use motion_fit::calibration::{Calibration, Calibrator, Missing, Progress};
use motion_fit::landmarks::{BodyLandmarks, Camera};
use spmm3::Skeleton;
use std::fmt;

/// For so long a person is waited for, seconds.
const PATIENCE: f64 = 20.0;

/// A calibration that is under way.
#[derive(Debug)]
pub(crate) struct Calibrating {
    calibrator: Calibrator,
    begun: Option<f64>,
    state: State,
}

/// What the person is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum State {
    Waiting(Missing),
    /// For so many seconds more.
    Standing(f64),
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Waiting(Missing::WholeBody) => f.write_str("show yourself from head to feet"),
            Self::Waiting(Missing::Standing) => f.write_str("stand upright"),
            Self::Waiting(Missing::Stillness) => f.write_str("stand still"),
            Self::Standing(left) => write!(f, "stay like this, {left:.0} s"),
        }
    }
}

impl Calibrating {
    /// For a person who is fitted by `skeleton`, before `camera`.
    pub(crate) fn new(skeleton: &Skeleton, camera: Camera) -> Self {
        Self {
            calibrator: Calibrator::new(skeleton, camera),
            begun: None,
            state: State::Waiting(Missing::WholeBody),
        }
    }

    /// What the person is told now.
    pub(crate) fn state(&self) -> State {
        self.state
    }

    /// The pictures have another size from now on.
    pub(crate) fn set_camera(&mut self, camera: Camera) {
        self.calibrator.set_camera(camera);
    }

    /// Takes a picture, before it is fitted. Returns whether the calibration is over: held by `fit`, or given up.
    pub(crate) fn see(
        &mut self,
        seconds: f64,
        body: Option<&BodyLandmarks>,
        fit: &mut MotionFit,
    ) -> bool {
        if self.begun.is_none() {
            log::info!(
                "calibration: stand upright, seen from head to feet, arms hanging, and look calmly at the camera for two seconds"
            );
        }
        let begun = *self.begun.get_or_insert(seconds);
        let before = self.state;
        match self.calibrator.see(seconds, body) {
            Progress::Done(calibration) => {
                fit.hold(&calibration);
                log::info!(
                    "calibration is done: {}; this is held from now on",
                    told(&calibration)
                );
                return true;
            }
            Progress::Waiting(missing) => self.state = State::Waiting(missing),
            Progress::Standing(left) => {
                self.state = State::Standing(left);
                if matches!(before, State::Waiting(_)) {
                    fit.begin_calibration();
                    log::info!("calibration: {}", self.state);
                }
            }
        }
        let is_late = seconds - begun > PATIENCE;
        if is_late {
            let lacking = match self.state {
                State::Waiting(Missing::WholeBody) => "nobody was seen from head to feet",
                State::Waiting(Missing::Standing) => "the person does not stand upright",
                State::Waiting(Missing::Stillness) => "the person moves",
                State::Standing(_) => "too few pictures came while the person stood",
            };
            log::warn!(
                "no calibration within {PATIENCE} s, because {lacking}: this goes on without, and learns while the person moves"
            );
        }
        is_late
    }
}

fn told(calibration: &Calibration) -> String {
    let pitch = calibration.pitch_radians().to_degrees();
    format!(
        "the camera looks {} by {:.0} degrees, {:.2} m above the floor",
        if pitch < 0.0 { "up" } else { "down" },
        pitch.abs(),
        calibration.height_metres
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;
    use motion_fit::Subject;
    use synthetic_person::Puppet;

    #[test]
    fn a_person_who_is_not_seen_is_waited_for_and_then_given_up() {
        let avatar = Puppet::small().avatar();
        let camera = Camera::guessed(Vec2::new(640.0, 480.0));
        let mut fit = MotionFit::new(&Subject::from(&avatar), camera);
        let mut calibrating = Calibrating::new(&avatar.skeleton, camera);
        // The source's clock may begin anywhere.
        let ended =
            (0..1000).find(|k| calibrating.see(50.0 + f64::from(*k) / 30.0, None, &mut fit));
        let seconds = f64::from(ended.expect("given up")) / 30.0;
        assert!((seconds - PATIENCE).abs() < 0.1, "{seconds} s");
        assert_eq!(
            calibrating.state().to_string(),
            "show yourself from head to feet"
        );
    }
}
