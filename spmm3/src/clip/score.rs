//! The built-in performance as data: which quantity has which value when. Times in seconds of a loop of [`LOOP_SECONDS`], angles in
//! degrees, read by `built_in`.
//!
//! The person greets with the right hand, explains with both, turns to the left and presents something there, comes
//! back and makes a point with thumb and index, smiles.

/// Length of the performance in seconds.
pub const LOOP_SECONDS: f64 = 9.0;

/// Keys of one quantity: (seconds, value). Between keys it moves with minimum jerk; after the last it returns to the
/// first.
pub(super) type Track<const N: usize> = &'static [(f64, [f32; N])];

/// Value of a track at a time of the loop.
pub(super) fn at<const N: usize>(track: Track<N>, seconds: f64) -> [f32; N] {
    let seconds = seconds.rem_euclid(LOOP_SECONDS);
    let Some(next) = track
        .iter()
        .position(|(time, _)| *time > seconds)
        .or(Some(track.len()))
        .filter(|_| !track.is_empty())
    else {
        return [0.0; N];
    };
    let (t0, from) = track[(next + track.len() - 1) % track.len()];
    let (t1, to) = track[next % track.len()];
    let span = (t1 - t0).rem_euclid(LOOP_SECONDS);
    let share = if span > 0.0 {
        super::narrow((seconds - t0).rem_euclid(LOOP_SECONDS) / span)
    } else {
        0.0
    };
    // Minimum jerk (Flash and Hogan 1985): rest to rest, as a hand moves.
    let eased = share * share * share * (10.0 - 15.0 * share + 6.0 * share * share);
    std::array::from_fn(|k| from[k] + (to[k] - from[k]) * eased)
}

/// A bump of height 1 around `centre`, raised cosine of the given half width; the loop's ends meet.
pub(super) fn bump(seconds: f64, centre: f64, half_width: f64) -> f32 {
    let away =
        (seconds - centre + LOOP_SECONDS / 2.0).rem_euclid(LOOP_SECONDS) - LOOP_SECONDS / 2.0;
    if away.abs() >= half_width {
        return 0.0;
    }
    super::narrow(0.5 + 0.5 * (std::f64::consts::PI * away / half_width).cos())
}

/// Arm: raise forward, raise sideways, turn inward, elbow, palm up, wrist back, curl (0..1), pinch (0..1).
pub(super) type Arm = [f32; 8];
pub(super) const HANG: Arm = [-1.0, 13.0, 14.0, 17.0, 0.0, 0.0, 0.38, 0.0];
const EXPLAIN: Arm = [16.0, 15.0, 16.0, 84.0, 52.0, 6.0, 0.22, 0.0];
const BEAT: Arm = [13.0, 15.0, 14.0, 74.0, 58.0, 0.0, 0.20, 0.0];
const WIDE: Arm = [17.0, 26.0, -8.0, 74.0, 66.0, 8.0, 0.12, 0.0];
const GREET: Arm = [24.0, 30.0, -8.0, 118.0, -52.0, 14.0, 0.06, 0.0];
const GREET_OUT: Arm = [24.0, 32.0, -22.0, 114.0, -56.0, 10.0, 0.04, 0.0];
const PRESENT: Arm = [30.0, 40.0, -22.0, 48.0, 62.0, 8.0, 0.10, 0.0];
const POINT: Arm = [26.0, 12.0, 22.0, 104.0, -8.0, 16.0, 0.50, 1.0];
const POINT_DOWN: Arm = [22.0, 12.0, 20.0, 92.0, -4.0, 4.0, 0.50, 1.0];

pub(super) const RIGHT_ARM: Track<8> = &[
    (0.0, HANG),
    (0.45, HANG),
    (1.05, GREET),
    (1.35, GREET_OUT),
    (1.65, GREET),
    (1.95, GREET_OUT),
    (2.6, EXPLAIN),
    (2.95, BEAT),
    (3.3, EXPLAIN),
    (3.8, WIDE),
    (4.1, WIDE),
    (5.0, HANG),
    (6.3, HANG),
    (6.95, POINT),
    (7.2, POINT_DOWN),
    (7.5, POINT),
    (7.75, POINT_DOWN),
    (7.95, POINT_DOWN),
    (8.75, HANG),
];

pub(super) const LEFT_ARM: Track<8> = &[
    (0.0, HANG),
    (1.95, HANG),
    (2.65, EXPLAIN),
    (3.0, BEAT),
    (3.35, EXPLAIN),
    (3.85, WIDE),
    (4.15, WIDE),
    (4.45, EXPLAIN),
    (5.05, PRESENT),
    (5.35, [27.0, 38.0, -20.0, 54.0, 64.0, 2.0, 0.14, 0.0]),
    (5.6, PRESENT),
    (6.0, PRESENT),
    (6.9, HANG),
];

/// Body: hips to the left (millimetres), body turn to the left, lean forward.
pub(super) const BODY: Track<3> = &[
    (0.0, [0.0, 0.0, 0.0]),
    (1.1, [-24.0, -4.0, 0.5]),
    (2.2, [-20.0, -3.0, 1.0]),
    (3.2, [22.0, 2.0, 3.0]),
    (4.2, [14.0, 3.0, 2.0]),
    (5.1, [32.0, 42.0, 1.0]),
    (6.0, [30.0, 40.0, 2.0]),
    (7.0, [-22.0, -5.0, 2.5]),
    (8.0, [-18.0, -4.0, 3.0]),
];

/// Where the eyes look, relative to the room: to the left, up. The head follows late and only part of the way.
pub(super) const GAZE: Track<2> = &[
    (0.0, [0.0, 0.0]),
    (2.3, [0.0, 0.0]),
    (2.45, [-9.0, 5.0]),
    (2.85, [-9.0, 5.0]),
    (3.0, [0.0, 0.0]),
    (4.4, [0.0, 0.0]),
    (4.65, [48.0, -8.0]),
    (5.45, [48.0, -8.0]),
    (5.6, [6.0, 0.0]),
    (5.9, [6.0, 0.0]),
    (6.05, [38.0, -4.0]),
    (6.25, [38.0, -4.0]),
    (6.5, [0.0, 0.0]),
    (6.95, [-6.0, -12.0]),
    (7.3, [-6.0, -12.0]),
    (7.45, [0.0, 0.0]),
];

/// Head on top of the gaze: nod down, tilt to the person's left.
pub(super) const HEAD: Track<2> = &[
    (0.0, [0.0, 2.0]),
    (0.7, [5.0, -3.0]),
    (1.1, [-3.0, -4.0]),
    (1.9, [1.0, -3.0]),
    (2.5, [-3.0, 3.0]),
    (3.0, [5.0, 4.0]),
    (3.4, [-1.0, 3.0]),
    (3.9, [4.0, -2.0]),
    (4.6, [0.0, 0.0]),
    (5.3, [5.0, 5.0]),
    (5.9, [0.0, 3.0]),
    (6.8, [-2.0, -3.0]),
    (7.2, [6.0, -3.0]),
    (7.5, [0.0, -2.0]),
    (7.8, [6.0, -1.0]),
    (8.4, [1.0, 4.0]),
];

/// Face: smile, brows up, brows down (0..1).
pub(super) const FACE: Track<3> = &[
    (0.0, [0.65, 0.0, 0.0]),
    (0.6, [0.45, 0.7, 0.0]),
    (1.2, [0.35, 0.2, 0.0]),
    (2.3, [0.25, 0.1, 0.0]),
    (2.7, [0.1, 0.1, 0.35]),
    (3.3, [0.15, 0.8, 0.0]),
    (4.2, [0.2, 0.1, 0.0]),
    (5.2, [0.3, 0.6, 0.0]),
    (6.2, [0.25, 0.0, 0.0]),
    (7.0, [0.1, 0.2, 0.4]),
    (7.6, [0.2, 0.6, 0.0]),
    (8.3, [0.85, 0.2, 0.0]),
];

/// When the eyes close; most blinks cover a jump of the gaze.
pub(super) const BLINKS: &[f64] = &[0.3, 2.4, 3.95, 4.52, 6.38, 8.15];

/// Speech: (seconds, viseme, strength). The mouth is shut between the phrases.
pub(super) const SPEECH: &[(f64, &str, f32)] = &[
    (0.55, "e", 0.7),
    (0.72, "o", 0.9),
    (0.98, "mbp", 0.8),
    (1.12, "a", 0.9),
    (1.28, "i", 0.7),
    (1.44, "e", 0.5),
    (1.60, "u", 0.9),
    (1.78, "i", 0.9),
    (1.96, "u", 0.8),
    (2.62, "a", 0.8),
    (2.78, "mbp", 0.9),
    (2.92, "o", 1.0),
    (3.10, "fv", 0.9),
    (3.24, "e", 0.8),
    (3.40, "i", 0.8),
    (3.56, "a", 1.0),
    (3.74, "mbp", 0.9),
    (3.90, "u", 0.7),
    (4.06, "e", 0.6),
    (4.72, "o", 0.8),
    (4.88, "fv", 0.8),
    (5.02, "a", 1.0),
    (5.20, "e", 0.8),
    (5.36, "mbp", 1.0),
    (5.50, "i", 0.9),
    (5.68, "o", 0.9),
    (5.86, "a", 0.6),
    (6.55, "i", 0.8),
    (6.72, "e", 0.7),
    (6.88, "mbp", 0.9),
    (7.02, "a", 1.0),
    (7.20, "o", 0.9),
    (7.38, "fv", 0.8),
    (7.54, "e", 0.8),
    (7.70, "u", 0.9),
    (7.86, "a", 0.8),
    (8.02, "mbp", 0.6),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn in_order<const N: usize>(track: Track<N>) -> bool {
        track.windows(2).all(|w| w[0].0 < w[1].0)
            && track.iter().all(|(t, _)| (0.0..LOOP_SECONDS).contains(t))
    }

    #[test]
    fn every_track_is_in_order_and_hits_its_keys() {
        assert!(
            in_order(RIGHT_ARM) && in_order(LEFT_ARM),
            "an arm's keys are out of order"
        );
        assert!(
            in_order(BODY) && in_order(GAZE) && in_order(HEAD) && in_order(FACE),
            "a body or face track's keys are out of order"
        );
        for (time, value) in LEFT_ARM {
            assert_eq!(at(LEFT_ARM, *time), *value, "key at {time} s");
        }
    }
}
