//! The poses that an avatar's networks have learnt from, as bounds of the joints' rotations.

use crate::{BODY, EXPRESSION, HANDS, MotionParams, PersonError};

/// Numbers of P that are rotations: body, then hands.
pub const ROTATIONS: usize = BODY + HANDS;
/// Rotations are axis-angle vectors in radians: further than any motion turns a joint.
const MOST: f32 = 1000.0;

/// The least and the greatest value of each joint rotation that F_mesh and F_attr have learnt from.
///
/// Beyond it the networks would extrapolate, and their residuals grow without bound: what they see of a motion is clamped to it. The skeleton and its skinning follow
/// the whole motion. Expression coefficients have no bounds: the face's basis is linear in them.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseRange {
    low: [f32; ROTATIONS],
    high: [f32; ROTATIONS],
}

impl PoseRange {
    /// From bounds in the order body | hands of P, radians.
    ///
    /// # Errors
    /// Names the bound that is missing, not finite or not in order.
    pub fn new(low: &[f32], high: &[f32]) -> Result<Self, PersonError> {
        let bounds = |what, values: &[f32]| {
            let array = values.try_into().map_err(|_| PersonError::Count {
                what,
                got: values.len(),
                expected: ROTATIONS,
            })?;
            PersonError::check_range(what, values, -MOST, MOST, "-1000..1000 rad")?;
            Ok(array)
        };
        let range = Self {
            low: bounds("the pose range's low", low)?,
            high: bounds("the pose range's high", high)?,
        };
        let pairs = range.low.iter().zip(&range.high);
        match pairs.clone().position(|(low, high)| low > high) {
            None => Ok(range),
            Some(at) => Err(PersonError::Value {
                what: "the pose range's high",
                at,
                value: range.high[at],
                range: "its low and above",
            }),
        }
    }

    /// What these motions show; nothing of none, nor of motions that are not finite.
    pub fn of<'a>(motions: impl IntoIterator<Item = &'a MotionParams>) -> Option<Self> {
        let mut low = [f32::INFINITY; ROTATIONS];
        let mut high = [f32::NEG_INFINITY; ROTATIONS];
        for motion in motions {
            let values = motion.body().iter().chain(motion.hands());
            for ((low, high), value) in low.iter_mut().zip(&mut high).zip(values) {
                *low = low.min(*value);
                *high = high.max(*value);
            }
        }
        Self::new(&low, &high).ok()
    }

    /// The least range that contains both.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        let mut joined = self.clone();
        for (low, other) in joined.low.iter_mut().zip(&other.low) {
            *low = low.min(*other);
        }
        for (high, other) in joined.high.iter_mut().zip(&other.high) {
            *high = high.max(*other);
        }
        joined
    }

    /// Clamps the rotations of P (`[215]`, body | expression | hands).
    pub fn clamp(&self, p: &mut [f32]) {
        let rotations = p
            .iter_mut()
            .enumerate()
            .filter(|(at, _)| !(BODY..BODY + EXPRESSION).contains(at));
        let bounds = self.low.iter().zip(&self.high);
        for ((_, value), (low, high)) in rotations.zip(bounds) {
            *value = value.max(*low).min(*high);
        }
    }

    /// The least values, radians, in the order body | hands.
    #[must_use]
    pub fn low(&self) -> &[f32; ROTATIONS] {
        &self.low
    }

    /// The greatest values, radians, in the order body | hands.
    #[must_use]
    pub fn high(&self) -> &[f32; ROTATIONS] {
        &self.high
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Joint, PARAMS};
    use glam::Vec3;

    fn turned(joint: Joint, x: f32) -> MotionParams {
        let mut motion = MotionParams::default();
        motion.set_axis_angle(joint, Vec3::new(x, 0.0, 0.0));
        motion
    }

    #[test]
    fn rotations_are_clamped_to_what_was_shown_and_expressions_are_not() {
        let shown = [
            turned(Joint::LeftElbow, -0.5),
            turned(Joint::LeftElbow, 1.0),
        ];
        let range = PoseRange::of(&shown).expect("two motions");
        let mut values = [0.0; PARAMS];
        let elbow = MotionParams::offset_of(Joint::LeftElbow);
        let finger = MotionParams::offset_of(Joint::RightThumb3) + 2;
        for (asked, seen) in [(2.0, 1.0), (-2.0, -0.5), (0.3, 0.3)] {
            values[elbow] = asked;
            values[finger] = asked;
            values[BODY + EXPRESSION - 1] = asked;
            range.clamp(&mut values);
            assert_eq!(values[elbow], seen, "the elbow");
            assert_eq!(values[finger], 0.0, "the last finger, which never moved");
            assert_eq!(values[BODY + EXPRESSION - 1], asked, "the face");
        }
        assert!(PoseRange::of(&[]).is_none(), "of nothing");
    }

    #[test]
    fn a_joined_range_contains_both() {
        let of = |x| PoseRange::of(&[turned(Joint::Neck, x)]).expect("one motion");
        let joined = of(0.2).joined(&of(-0.3));
        let neck = MotionParams::offset_of(Joint::Neck);
        assert_eq!((joined.low()[neck], joined.high()[neck]), (-0.3, 0.2));
    }

    #[test]
    fn broken_bounds_are_refused_by_name() {
        let good = [0.0; ROTATIONS];
        let mut wrong = good;
        wrong[7] = f32::NAN;
        let mut above = good;
        above[9] = 0.5;
        for (low, high, said) in [
            (&good[1..], &good[..], "the pose range's low has 164"),
            (&good[..], &wrong[..], "the pose range's high number 7"),
            (&above[..], &good[..], "the pose range's high number 9"),
        ] {
            let error = PoseRange::new(low, high).expect_err("broken").to_string();
            assert!(error.starts_with(said), "{error}");
        }
    }
}
