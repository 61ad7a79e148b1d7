//! A motion clip as if it were captured now.

use crate::{Capture, Captured, SendError};
use glam::Vec3;
use spmm3::{Joint, MotionClip, Playback};
use std::time::{Duration, Instant};

/// Plays a clip over and over at a steady rate.
#[derive(Debug)]
pub struct ClipCapture {
    clip: MotionClip,
    rate_hz: f64,
    /// Of its face, if it has one.
    face: Option<f32>,
    until: Option<Duration>,
    begun: Option<Instant>,
    count: u32,
}

impl ClipCapture {
    /// `clip` at `rate_hz` motions a second, for `length` or, without one, without end.
    #[must_use]
    pub fn new(clip: MotionClip, rate_hz: f64, length: Option<Duration>) -> Self {
        Self {
            face: has_face(&clip).then_some(1.0),
            clip,
            rate_hz,
            until: length,
            begun: None,
            count: 0,
        }
    }
}

/// Whether a clip moves a face anywhere: its jaw or its expression.
fn has_face(clip: &MotionClip) -> bool {
    let mut frames = clip.frames.iter();
    frames.any(|frame| {
        let rests = frame.axis_angle(Joint::Jaw) == Vec3::ZERO;
        !rests || frame.expression().iter().any(|value| *value != 0.0)
    })
}

impl Capture for ClipCapture {
    fn next(&mut self) -> Result<Option<Captured>, SendError> {
        let begun = *self.begun.get_or_insert_with(Instant::now);
        let due = |count: u32| Duration::from_secs_f64(f64::from(count) / self.rate_hz);
        let elapsed = begun.elapsed();
        // A machine that slept does not send what it missed.
        if elapsed > due(self.count.saturating_add(1)) {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at 240 motions a second it takes 200 days to overflow, and the cast saturates"
            )]
            let now = (elapsed.as_secs_f64() * self.rate_hz) as u32;
            log::debug!("{} motions late", now.saturating_sub(self.count));
            self.count = now;
        }
        let at = due(self.count);
        if self.until.is_some_and(|until| at >= until) {
            return Ok(None);
        }
        std::thread::sleep(at.saturating_sub(elapsed));
        self.count = self.count.saturating_add(1);
        Ok(Some(Captured {
            at: Instant::now(),
            motion: self.clip.sample(at.as_secs_f64(), Playback::Loop),
            face: self.face,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spmm3::MotionParams;

    #[test]
    fn a_clip_is_looped_at_its_rate_until_its_time_is_up() {
        let frames: Vec<_> = [1.0, 2.0]
            .map(|x| {
                let mut motion = MotionParams::default();
                motion.root_translation = Vec3::X * x;
                motion
            })
            .to_vec();
        let clip = MotionClip {
            name: "two steps".into(),
            frames,
            frame_seconds: 0.01,
            expression_basis: None,
            notes: Vec::new(),
            unmapped: Vec::new(),
        };
        let mut capture = ClipCapture::new(clip, 100.0, Some(Duration::from_millis(40)));
        let (mut seen, begun) = (Vec::new(), Instant::now());
        while let Some(captured) = capture.next().expect("a clip does not fail") {
            seen.push(captured.motion.root_translation.x);
            assert!(captured.at <= Instant::now(), "captured in the past");
        }
        // A busy machine may leave some out, but never plays ahead of time or past the end.
        assert!((1..=4).contains(&seen.len()), "{seen:?}");
        assert_eq!(seen[0], 1.0, "it begins at the beginning");
        assert!(
            begun.elapsed().as_millis() >= 10 * (seen.len() as u128 - 1),
            "at its pace"
        );
    }
}
