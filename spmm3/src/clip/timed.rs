//! Motions captured at times of their own, as a clip of even frames.

use super::{MAX_FRAMES, MotionClip, MotionError, blend, floor_index, narrow};
use crate::MotionParams;

impl MotionClip {
    /// A clip of `rate_hz` frames a second from motions at growing times in seconds, from the first to the last; what lies between two is
    /// interpolated as [`Self::sample`] does.
    ///
    /// # Errors
    /// [`MotionError::Request`] if there is no motion, or the clip would have more frames than a file may.
    pub fn evenly(
        name: &str,
        timed: &[(f64, MotionParams)],
        rate_hz: f64,
    ) -> Result<Self, MotionError> {
        let refused = |why: String| MotionError::Request(format!("motions of {name}: {why}"));
        let (Some((first, _)), Some((last, _))) = (timed.first(), timed.last()) else {
            return Err(refused("there are none".to_owned()));
        };
        let count = ((last - first) * rate_hz).round() + 1.0;
        if !(1.0..=MAX_FRAMES as f64).contains(&count) {
            return Err(refused(format!(
                "{count} frames at {rate_hz} Hz; 1..={MAX_FRAMES} are possible"
            )));
        }
        let mut after = 0;
        let frames = (0..floor_index(count)).map(|k| {
            let at = first + k as f64 / rate_hz;
            while after < timed.len() && timed[after].0 <= at {
                after += 1;
            }
            let (before, next) = (&timed[after.max(1) - 1], &timed[after.min(timed.len() - 1)]);
            let share = (at - before.0) / (next.0 - before.0).max(f64::MIN_POSITIVE);
            // A picture's own time must not become a blend by a tick's rounding.
            match share.clamp(0.0, 1.0) {
                share if share < 1e-3 => before.1.clone(),
                share if share > 1.0 - 1e-3 => next.1.clone(),
                share => blend(&before.1, &next.1, narrow(share)),
            }
        });
        Ok(Self {
            name: name.to_owned(),
            frames: frames.collect(),
            frame_seconds: rate_hz.recip(),
            notes: Vec::new(),
            expression_basis: None,
            unmapped: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn uneven_times_become_even_frames() {
        let at = |seconds: f64, x: f32| {
            let mut motion = MotionParams::default();
            motion.root_translation = Vec3::X * x;
            (seconds, motion)
        };
        let timed = [at(1.0, 0.0), at(1.1, 1.0), at(1.3, 3.0), at(1.4, 4.0)];
        let clip = MotionClip::evenly("a camera", &timed, 10.0).expect("a clip");
        let xs: Vec<f32> = clip.frames.iter().map(|m| m.root_translation.x).collect();
        for (x, expected) in xs.iter().zip([0.0, 1.0, 2.0, 3.0, 4.0]) {
            assert!((x - expected).abs() < 1e-4, "{xs:?}");
        }
        assert_eq!(xs.len(), 5);
        assert!(MotionClip::evenly("nothing", &[], 10.0).is_err());
        assert!(MotionClip::evenly("a camera", &timed, f64::NAN).is_err());
        assert!(MotionClip::evenly("a camera", &timed, 1e9).is_err());
        let one = MotionClip::evenly("a picture", &timed[..1], 30.0).expect("a pose");
        assert_eq!(one.frames.len(), 1);
    }
}
