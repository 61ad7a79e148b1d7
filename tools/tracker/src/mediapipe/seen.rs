//! What a body's networks saw in one region of a picture, and two of them as one.

use glam::Vec2;
use motion_fit::landmarks::blazepose::{LOWER, mirrored};
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint};
use std::ops::Range;

/// What was seen in one region.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) body: BodyLandmarks,
    /// The two landmarks that say where to look next, pixels of the picture: the hips' middle, and a point on the circle about the person.
    pub(super) next: [Vec2; 2],
}

impl Seen {
    /// What two networks saw of one region, of which either may have seen nobody.
    pub(super) fn joined(first: Option<Self>, second: Option<Self>) -> Option<Self> {
        match (first, second) {
            (Some(first), Some(second)) => Some(first.mean(&second)),
            (one, other) => one.or(other),
        }
    }

    /// The mean of what two networks saw. Of a half of the body that `other` has with left and right the other way round, what this one saw: it then sees another
    /// pose there, of which nothing is right but the outline.
    fn mean(mut self, other: &Self) -> Self {
        let mut agree = true;
        for half in [0..LOWER, LOWER..BODY_LANDMARKS] {
            if self.exchanges(other, half.clone()) {
                agree = false;
                continue;
            }
            let points = &mut self.body.points[half.clone()];
            for (point, theirs) in points.iter_mut().zip(&other.body.points[half]) {
                *point = BodyPoint {
                    pixel: point.pixel.midpoint(theirs.pixel),
                    metres: point.metres.midpoint(theirs.metres),
                    confidence: point.confidence.midpoint(theirs.confidence),
                };
            }
        }
        if agree {
            for (next, theirs) in self.next.iter_mut().zip(other.next) {
                *next = next.midpoint(theirs);
            }
        }
        self
    }

    /// Whether `other` has left and right of these landmarks the other way round: its pixels are nearer to those of the other side, each pair counted as the least
    /// sure of its four landmarks. Without a margin: where a pair is as near either way, left and right lie on one another, and both answers give about the same.
    fn exchanges(&self, other: &Self, half: Range<usize>) -> bool {
        let (ours, theirs) = (&self.body.points, &other.body.points);
        let (mut straight, mut crossed) = (0.0, 0.0);
        for (k, twin) in half.map(|k| (k, mirrored(k))).filter(|(k, twin)| k != twin) {
            let of_pair = [&ours[k], &ours[twin], &theirs[k], &theirs[twin]];
            let sure = of_pair.map(|point| point.confidence);
            let weight = sure.into_iter().fold(1.0, f32::min);
            straight += weight * ours[k].pixel.distance(theirs[k].pixel);
            crossed += weight * ours[k].pixel.distance(theirs[twin].pixel);
        }
        crossed < straight
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A body whose landmark `k` is at `at(k)`, in pixels and in metres, as sure as `confidence`.
    fn body(at: impl Fn(usize) -> f32, confidence: f32) -> Seen {
        let points = std::array::from_fn(|k| BodyPoint {
            pixel: Vec2::new(at(k), 100.0),
            metres: Vec3::new(at(k), 0.0, 1.0),
            confidence,
        });
        Seen {
            body: BodyLandmarks { points },
            next: [Vec2::splat(at(0)), Vec2::splat(at(1))],
        }
    }

    #[test]
    fn two_networks_that_agree_are_met_in_the_middle() {
        let ours = body(|k| k as f32, 1.0);
        let mean = ours.mean(&body(|k| k as f32 + 2.0, 0.5));
        for (k, point) in mean.body.points.iter().enumerate() {
            assert!((point.pixel.x - (k as f32 + 1.0)).abs() < 1e-5, "{point:?}");
            assert!(
                (point.metres.x - (k as f32 + 1.0)).abs() < 1e-5,
                "{point:?}"
            );
            assert!((point.confidence - 0.75).abs() < 1e-6, "{point:?}");
        }
        assert!((mean.next[1].x - 2.0).abs() < 1e-5, "{:?}", mean.next);
    }

    /// Left landmarks are odd and stand at positive places, right ones at negative places; the nose is in the middle.
    fn sided(k: usize) -> f32 {
        match k {
            0 => 0.0,
            left if left % 2 == 1 => left as f32,
            right => -(right as f32),
        }
    }

    #[test]
    fn a_second_network_that_has_the_sides_exchanged_is_left_out() {
        let ours = body(sided, 1.0);
        let mean = ours.clone().mean(&body(|k| sided(mirrored(k)) + 3.0, 0.2));
        assert_eq!(mean.body, ours.body, "the first network's alone");
        assert_eq!(mean.next, ours.next, "and its region");
    }

    #[test]
    fn arms_and_legs_are_judged_apart() {
        let ours = body(sided, 1.0);
        for legs in [false, true] {
            let theirs = body(
                |k| {
                    let exchanged = (k >= LOWER) == legs;
                    3.0 + sided(if exchanged { mirrored(k) } else { k })
                },
                1.0,
            );
            let mean = ours.clone().mean(&theirs);
            for (k, (mean, ours)) in mean.body.points.iter().zip(&ours.body.points).enumerate() {
                let moved = if (k >= LOWER) == legs { 0.0 } else { 1.5 };
                let off = (mean.pixel.x - ours.pixel.x - moved).abs();
                assert!(off < 1e-5, "{k} with exchanged legs: {legs}");
            }
            assert_eq!(mean.next, ours.next, "the first network's region");
        }
    }

    #[test]
    fn landmarks_that_a_network_does_not_see_say_nothing_of_its_sides() {
        let ours = body(sided, 1.0);
        let mut theirs = ours.clone();
        // Feet and hands are out of the picture, and are guessed anywhere.
        for k in (17..LOWER).chain(27..BODY_LANDMARKS) {
            theirs.body.points[k].pixel.x = 20.0 * sided(mirrored(k));
            theirs.body.points[k].confidence = 0.01;
        }
        let mean = ours.clone().mean(&theirs);
        assert!((mean.body.points[27].confidence - 0.505).abs() < 1e-6);
        assert_eq!(mean.body.points[..17], ours.body.points[..17], "the same");
    }

    #[test]
    fn of_two_networks_of_which_one_is_blind_the_other_alone_is_believed() {
        let seen = body(sided, 0.7);
        for (first, second) in [
            (Some(seen.clone()), None),
            (None, Some(seen.clone())),
            (Some(seen.clone()), Some(seen.clone())),
        ] {
            let joined = Seen::joined(first, second).expect("one sees");
            assert_eq!((joined.body, joined.next), (seen.body.clone(), seen.next));
        }
        assert!(Seen::joined(None, None).is_none(), "nobody");
    }
}
