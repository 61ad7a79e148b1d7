//! A camera that stands where a headset's wearer does and looks where they look.
//!
//! It stays upright, goes where the head goes within a tenth of a second, and turns more slowly: eyes dart about, and who watches a screen sees a
//! picture that darts with them as a shaking one. It comes and goes smoothly: between the camera without a gaze and this one it is on the way.

use super::sample::LineOfSight;
use super::spring::Spring;
use glam::Vec3;
use std::time::Duration;

/// Of the springs, 1/s: of the eye, of what it looks at, and of the way there and back.
const EYE: f32 = 16.0;
const DIRECTION: f32 = 6.0;
const SHARE: f32 = 4.0;

/// Vertical field of view, degrees: a person 1.6 m away is in it from above the head to the hips.
pub(super) const FOV_DEGREES: f32 = 50.0;

/// Less of it is nothing.
const LEAST: f32 = 1e-3;

/// A view that follows another one.
#[derive(Debug, Clone, Default)]
pub(super) struct ViewCamera {
    /// Nothing before the first view, and once the last one is forgotten.
    followed: Option<Followed>,
    /// How much of the camera is the wearer's, 0 to 1.
    share: Spring<f32>,
}

#[derive(Debug, Clone)]
struct Followed {
    eye: Spring<Vec3>,
    direction: Spring<Vec3>,
}

impl ViewCamera {
    /// After `elapsed` with the wearer's view there, or none: how much the camera is theirs, 0 to 1, and their view; nothing where it is not
    /// theirs at all.
    pub(super) fn follow(
        &mut self,
        view: Option<LineOfSight>,
        elapsed: Duration,
    ) -> Option<(f32, LineOfSight)> {
        if let Some(view) = view {
            let followed = self.followed.get_or_insert(Followed {
                eye: Spring::resting(view.eye),
                direction: Spring::resting(view.direction),
            });
            followed.eye.pull(view.eye, EYE, elapsed);
            (followed.direction).pull(view.direction, DIRECTION, elapsed);
        }
        let wanted = f32::from(u8::from(view.is_some()));
        self.share.pull(wanted, SHARE, elapsed);
        let share = self.share.at.clamp(0.0, 1.0);
        if view.is_none() && share < LEAST {
            *self = Self::default();
        }
        let followed = self.followed.as_ref()?;
        let view = LineOfSight {
            eye: followed.eye.at,
            // From one side to the other it passes the middle, where it has no length for a moment.
            direction: followed.direction.at.normalize_or(Vec3::NEG_Z),
        };
        Some((share, view))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(10);

    fn view(eye: Vec3, direction: Vec3) -> LineOfSight {
        LineOfSight { eye, direction }
    }

    #[test]
    fn it_comes_to_the_wearer_stays_with_them_and_goes_when_they_have_gone() {
        let there = view(Vec3::new(0.0, 1.6, 2.0), Vec3::NEG_Z);
        let mut camera = ViewCamera::default();
        assert_eq!(camera.follow(None, STEP), None, "nobody was there");
        let mut last = 0.0;
        for _ in 0..300 {
            let (share, seen) = camera.follow(Some(there), STEP).expect("a view");
            assert!(share >= last && share - last < 0.02, "{last} to {share}");
            assert_eq!(seen, there, "from the first picture on");
            last = share;
        }
        assert!(last > 0.999, "{last}");
        let gone = (0..300).take_while(|_| camera.follow(None, STEP).is_some());
        let seconds = gone.count() as f32 / 100.0;
        assert!((1.0..3.0).contains(&seconds), "gone after {seconds} s");
        // The next one is not come to from where the last one was.
        let other = view(Vec3::new(9.0, 1.6, 0.0), Vec3::Z);
        let (_, seen) = camera.follow(Some(other), STEP).expect("a view");
        assert_eq!(seen, other);
    }

    #[test]
    fn the_head_is_followed_at_once_and_eyes_that_dart_are_not() {
        let place = |x: f32| view(Vec3::new(x, 1.6, 2.0), Vec3::NEG_Z);
        let mut camera = ViewCamera::default();
        camera.follow(Some(place(0.0)), STEP);
        // A step aside at a walker's pace: how far it is behind.
        let mut behind = 0.0f32;
        for step in 1..=100 {
            let at = 0.01 * step as f32;
            let (_, seen) = camera.follow(Some(place(at)), STEP).expect("a view");
            assert!(seen.eye.x <= at + 1e-5, "never before them");
            behind = behind.max(at - seen.eye.x);
        }
        assert!(behind < 0.13, "{behind} m at 1 m/s");
        // A glance of 0.1 s to the side and back.
        let mut furthest = 0.0f32;
        for step in 0..100 {
            let direction = if step < 10 { Vec3::NEG_X } else { Vec3::NEG_Z };
            let looked = view(Vec3::new(1.0, 1.6, 2.0), direction);
            let (_, seen) = camera.follow(Some(looked), STEP).expect("a view");
            assert!(seen.direction.is_normalized(), "{seen:?}");
            furthest = furthest.max(seen.direction.angle_between(Vec3::NEG_Z));
        }
        let degrees = furthest.to_degrees();
        assert!((2.0..20.0).contains(&degrees), "{degrees} of 90 degrees");
    }

    #[test]
    fn who_turns_round_is_followed_round_without_a_direction_that_is_none() {
        let mut camera = ViewCamera::default();
        for direction in [Vec3::NEG_Z, Vec3::Z] {
            for _ in 0..200 {
                let looked = view(Vec3::ZERO, direction);
                let (_, seen) = camera.follow(Some(looked), STEP).expect("a view");
                assert!(seen.direction.is_normalized(), "{seen:?}");
            }
        }
        let (_, seen) = camera.follow(None, STEP).expect("not gone yet");
        assert!(seen.direction.abs_diff_eq(Vec3::Z, 1e-3), "{seen:?}");
    }
}
