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
        let progress = self.calibrator.see(seconds, body);
        if self.calibrator.begins() {
            fit.begin_calibration();
        }
        match progress {
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
                    log::info!("calibration: {}", self.state);
                }
            }
        }
        match self.state {
            // A person who has begun to stand may stand to the end.
            State::Waiting(missing) if seconds - begun > PATIENCE => {
                let lacking = lacking(missing);
                log::warn!(
                    "no calibration within {PATIENCE} s, because {lacking}: this goes on without, and learns while the person moves"
                );
                true
            }
            _ => false,
        }
    }

    /// Says that the recording ended before it was done.
    pub(crate) fn end(self) {
        let lacking = match self.state {
            State::Waiting(missing) => lacking(missing),
            State::Standing(_) => "the person stood for less than two seconds",
        };
        log::warn!(
            "no calibration until the recording ended, because {lacking}: it was fitted without"
        );
    }
}

fn lacking(missing: Missing) -> &'static str {
    match missing {
        Missing::WholeBody => "nobody was seen from head to feet",
        Missing::Standing => "the person does not stand upright",
        Missing::Stillness => "the person moves",
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
    use glam::{Vec2, Vec3};
    use motion_fit::Subject;
    use motion_fit::body::landmark_places;
    use motion_fit::landmarks::{BODY_LANDMARKS, BodyPoint};
    use spmm3::Joint;
    use synthetic_person::Puppet;

    /// A person's skeleton, the camera before them, their fit, and a calibration that has seen nothing.
    fn begun() -> (Skeleton, Camera, MotionFit, Calibrating) {
        let avatar = Puppet::small().avatar();
        let camera = Camera::guessed(Vec2::new(640.0, 480.0));
        let fit = MotionFit::new(&Subject::from(&avatar), camera);
        let calibrating = Calibrating::new(&avatar.skeleton, camera);
        (avatar.skeleton, camera, fit, calibrating)
    }

    #[test]
    fn a_person_who_is_not_seen_is_waited_for_and_then_given_up() {
        let (_, _, mut fit, mut calibrating) = begun();
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

    /// What a network sees of a person of `skeleton` who stands three metres before `camera`.
    fn standing(skeleton: &Skeleton, camera: &Camera) -> BodyLandmarks {
        let places = landmark_places(skeleton, &spmm3::at_ease(skeleton));
        let hips = skeleton.rest_positions()[Joint::Pelvis.index()];
        let mut seen = BodyLandmarks {
            points: [BodyPoint::default(); BODY_LANDMARKS],
        };
        for (point, place) in seen.points.iter_mut().zip(places) {
            let Some(place) = place else { continue };
            // The camera's axes: x right, y down, z away, at a height of a metre.
            let ray = Vec3::new(place.x, 1.0 - place.y, 3.0 - place.z);
            point.pixel = camera.centre + camera.focal * ray.truncate() / ray.z;
            point.metres = Vec3::new(place.x - hips.x, hips.y - place.y, hips.z - place.z);
            point.confidence = 1.0;
        }
        seen
    }

    #[test]
    fn a_person_who_begins_to_stand_late_may_stand_to_the_end() {
        let (skeleton, camera, mut fit, mut calibrating) = begun();
        let ended = (0..1000).find(|k| {
            let seen = (*k > 19 * 30).then(|| standing(&skeleton, &camera));
            calibrating.see(f64::from(*k) / 30.0, seen.as_ref(), &mut fit)
        });
        let ended = f64::from(ended.expect("over")) / 30.0;
        assert!((ended - 21.0).abs() < 0.2, "after {ended} s");
        assert!(matches!(calibrating.state(), State::Standing(_)));
    }

    #[test]
    fn a_landmark_that_flickers_does_not_make_the_face_learnt_before_forgotten() {
        let (skeleton, camera, mut fit, mut calibrating) = begun();
        let mut starts = 0;
        let ended = (0..100).find(|k| {
            let mut seen = standing(&skeleton, &camera);
            // An ankle, once, shortly before the end.
            if *k == 55 {
                seen.points[27].confidence = 0.0;
            }
            let over = calibrating.see(f64::from(*k) / 30.0, Some(&seen), &mut fit);
            starts += u32::from(calibrating.calibrator.begins());
            over
        });
        assert!(ended.is_some_and(|k| k < 65), "ended with {ended:?}");
        assert_eq!(starts, 1, "the face is learnt anew once, at the beginning");
    }
}
