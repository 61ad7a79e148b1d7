//! How a gaze moves the camera: towards the side that is looked at, around the person, who stays in the middle.
//!
//! Who looks at a shoulder wants to see around it: the eye goes there on an orbit, which shows depth by parallax and never loses
//! the person, as a turn of the camera would. Bounded, so that no person is seen from behind by accident. Quiet in the middle, where
//! the face is: eyes dart about even on one spot. Slow against eyes: a saccade takes 20 to 80 ms and a fixation 200 to 300 ms,
//! and a picture that jumped with each would pull the eyes along again. So what is looked at is low-passed twice (a critically
//! damped spring), which never overshoots: its answer is a weighted mean of where was looked before.

use super::Place;
use super::spring::Spring;
use std::time::Duration;

/// Furthest turns, degrees, when the viewer looks at an edge: to the sides, and up and down.
const FURTHEST: [f32; 2] = [25.0, 12.0];

/// Part of the way from the middle to an edge within which nothing moves.
const QUIET: f32 = 0.25;

/// Of the spring, 1/s: half of the way after 0.4 s, nine tenths after a second, 37 degrees/s at most from the middle to a side.
const STIFFNESS: f32 = 4.0;

/// A camera on a spring.
#[derive(Debug, Clone, Default)]
pub(super) struct GazeCamera {
    /// Radians to the right and upwards.
    angles: [Spring<f32>; 2],
}

impl GazeCamera {
    /// After `elapsed` with the viewer looking at `place`, or nowhere: how far the camera is turned around the person, to its right
    /// and upwards, radians.
    pub(super) fn follow(&mut self, place: Option<Place>, elapsed: Duration) -> [f32; 2] {
        let wanted = place.map_or([0.0; 2], wanted);
        for (angle, (wanted, furthest)) in
            (self.angles.iter_mut()).zip(wanted.into_iter().zip(FURTHEST))
        {
            angle.pull(wanted, STIFFNESS, elapsed);
            let furthest = furthest.to_radians();
            angle.at = angle.at.clamp(-furthest, furthest);
        }
        self.angles.map(|angle| angle.at)
    }
}

/// Where the camera is to be at last, radians.
fn wanted([x, y]: Place) -> [f32; 2] {
    let angle = |share: f32, furthest: f32| {
        let off = (2.0 * share - 1.0).clamp(-1.0, 1.0);
        let beyond = (off.abs() - QUIET).max(0.0) / (1.0 - QUIET);
        furthest.to_radians() * beyond.copysign(off)
    };
    // Pictures' y goes down.
    [angle(x, FURTHEST[0]), -angle(y, FURTHEST[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(10);

    /// Angles in degrees, one for each step.
    fn run(places: impl IntoIterator<Item = Option<Place>>) -> Vec<[f32; 2]> {
        let mut camera = GazeCamera::default();
        places
            .into_iter()
            .map(|place| camera.follow(place, STEP).map(f32::to_degrees))
            .collect()
    }

    /// A viewer whose eyes dart to any place, or blink, several times a second.
    fn darting(seed: u64, steps: usize) -> Vec<Option<Place>> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut place = None;
        (0..steps)
            .map(|_| {
                if random.u32(0..12) == 0 {
                    place = (random.u32(0..6) > 0).then(|| [random.f32(), random.f32()]);
                }
                place
            })
            .collect()
    }

    #[test]
    fn wherever_the_viewer_looks_the_camera_keeps_within_bounds_and_never_jumps() {
        for seed in 0..50 {
            let angles = run(darting(seed, 2_000));
            for two in angles.windows(2) {
                for (axis, furthest) in FURTHEST.into_iter().enumerate() {
                    assert!(two[1][axis].abs() <= furthest, "{seed}: {two:?}");
                    // From edge to edge a step is stiffness / e times twice the furthest in a second.
                    let most =
                        STIFFNESS / std::f32::consts::E * 2.0 * furthest * STEP.as_secs_f32();
                    let step = (two[1][axis] - two[0][axis]).abs();
                    assert!(step <= most * 1.01, "{seed}: {step} degrees at once");
                }
            }
        }
    }

    #[test]
    fn the_rule_is_the_same_to_the_left_as_to_the_right_and_up_as_down() {
        let places = darting(7, 1_000);
        let mirrored = places
            .iter()
            .map(|place| place.map(|[x, y]| [1.0 - x, 1.0 - y]));
        for (one, other) in run(places.clone()).iter().zip(run(mirrored)) {
            for (a, b) in one.iter().zip(other) {
                assert!((a + b).abs() < 1e-3, "{one:?} and {other:?}");
            }
        }
    }

    #[test]
    fn it_goes_all_the_way_without_overshooting_and_comes_back_without_a_gaze() {
        let there = run(std::iter::repeat_n(Some([1.0, 0.0]), 500));
        for (axis, furthest) in FURTHEST.into_iter().enumerate() {
            assert!(
                (there[499][axis] - furthest).abs() < 0.01,
                "{:?}",
                there[499]
            );
            assert!(
                there.windows(2).all(|two| two[1][axis] >= two[0][axis]),
                "it never turns back"
            );
            // By hand: a critically damped spring has gone 1 - (1 + 4 x 0.42) exp(-4 x 0.42) = 0.50 of the way then.
            let half = there[41][axis] / furthest;
            assert!((half - 0.50).abs() < 0.01, "after 0.42 s: {half}");
        }
        let looks = std::iter::repeat_n(Some([1.0, 0.0]), 500);
        let gone = run(looks.chain(std::iter::repeat_n(None, 500)));
        let at_last = gone.last().copied().unwrap_or([1.0; 2]);
        assert!(
            at_last.iter().all(|angle| angle.abs() < 0.01),
            "{at_last:?}"
        );
    }

    #[test]
    fn nothing_moves_while_the_viewer_looks_at_the_middle() {
        let still = run((0..500).map(|k| {
            let wave = (k as f32 * 0.7).sin() * 0.12;
            Some([0.5 + wave, 0.5 - wave])
        }));
        assert!(
            still.iter().flatten().all(|angle| angle.abs() < 1e-6),
            "within the quiet part"
        );
        // At its border the rule is continuous.
        let just_beyond = wanted([0.5 + QUIET / 2.0 + 1e-4, 0.5])[0];
        assert!((0.0..1e-3).contains(&just_beyond), "{just_beyond}");
    }

    #[test]
    fn the_way_does_not_depend_on_the_displays_rate() {
        let mut fast = GazeCamera::default();
        let mut slow = GazeCamera::default();
        let place = Some([0.05, 0.3]);
        for _ in 0..40 {
            let mut angles = [0.0; 2];
            for _ in 0..12 {
                angles = fast.follow(place, Duration::from_millis(5));
            }
            let at_once = slow.follow(place, Duration::from_millis(60));
            for (a, b) in angles.iter().zip(at_once) {
                assert!((a - b).abs() < 1e-4, "{angles:?} and {at_once:?}");
            }
        }
    }
}
