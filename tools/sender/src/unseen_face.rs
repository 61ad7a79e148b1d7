//! The face where no camera sees one: its mouth by the voice, its lids by chance, blended with what is seen.

use crate::{Capture, Captured, Lips, SendError};
use glam::Vec3;
use lip_sync::{Blinks, Mouth, SHAPES};
use spmm3::{EXPRESSION, ExpressionPreset, Expressions, Joint, MotionParams};
use std::time::Instant;

/// Jaw opening of each of [`SHAPES`] that the avatar has no expression for, radians (as the built-in performance's).
const BARE_JAW: [f32; SHAPES.len()] = [0.2, 0.1, 0.05, 0.13, 0.04, 0.03, 0.0];
/// The time constant of the change between a face that is seen and one that is not, seconds.
const CHANGE_SECONDS: f32 = 0.2;
/// The most that a weight changes in a second: a mouth opens in 70 ms.
const FASTEST: f32 = 14.0;
/// The longest time between two motions that counts, seconds.
const LONGEST_STEP: f32 = 0.25;
/// A share below this is nothing: a face that is seen stays as it is, to the bit.
const NOTHING: f32 = 1e-3;

/// A source of motion whose unseen face speaks and blinks.
pub struct UnseenFace<'a> {
    capture: &'a mut dyn Capture,
    mover: Mover,
    lips: Lips,
}

impl std::fmt::Debug for UnseenFace<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("UnseenFace").finish_non_exhaustive()
    }
}

impl<'a> UnseenFace<'a> {
    /// `capture`'s motion of an avatar with these named expressions, with `lips` where the face is not seen.
    pub fn new(capture: &'a mut dyn Capture, presets: &Expressions, lips: Lips) -> Self {
        Self {
            capture,
            mover: Mover::new(presets, fastrand::u64(..)),
            lips,
        }
    }
}

impl Capture for UnseenFace<'_> {
    fn next(&mut self) -> Result<Option<Captured>, SendError> {
        let mut captured = self.capture.next()?;
        if let Some(captured) = &mut captured {
            let mouth = self.lips.at(Instant::now());
            let Captured { at, motion, face } = captured;
            self.mover.move_face(motion, *face, mouth, *at);
        }
        Ok(captured)
    }
}

/// What moves a face.
struct Mover {
    shapes: [Option<ExpressionPreset>; SHAPES.len()],
    blink: Option<ExpressionPreset>,
    blinks: Blinks,
    began: Option<Instant>,
    last: Option<Instant>,
    mouth: Mouth,
    /// How much of the face is unseen, 0 to 1.
    unseen: f32,
}

impl Mover {
    fn new(presets: &Expressions, seed: u64) -> Self {
        Self {
            shapes: SHAPES.map(|name| presets.get(name).cloned()),
            blink: presets.get("blink").cloned(),
            blinks: Blinks::new(seed),
            began: None,
            last: None,
            mouth: Mouth::default(),
            unseen: 0.0,
        }
    }

    /// Moves the face of `motion`, seen with the confidence `face`, as far as it is unseen.
    fn move_face(&mut self, motion: &mut MotionParams, face: Option<f32>, to: Mouth, at: Instant) {
        let target = 1.0 - face.unwrap_or(0.0).clamp(0.0, 1.0);
        let began = *self.began.get_or_insert(at);
        let seconds = at.saturating_duration_since(began).as_secs_f64();
        match self.last.replace(at) {
            None => self.unseen = target,
            Some(last) => {
                let step = at.saturating_duration_since(last).as_secs_f32();
                let step = step.min(LONGEST_STEP);
                self.unseen += (target - self.unseen) * (1.0 - (-step / CHANGE_SECONDS).exp());
                let most = FASTEST * step;
                for (weight, to) in self.mouth.weights.iter_mut().zip(to.weights) {
                    *weight += (to - *weight).clamp(-most, most);
                }
            }
        }
        let shut = self.blinks.at(seconds);
        if self.unseen < NOTHING || !self.unseen.is_finite() {
            self.unseen = 0.0;
            return;
        }
        let (spoken, jaw) = self.spoken(shut);
        for (value, spoken) in motion.expression_mut().iter_mut().zip(spoken) {
            *value += self.unseen * (spoken - *value);
        }
        let seen = motion.axis_angle(Joint::Jaw);
        motion.set_axis_angle(Joint::Jaw, seen.lerp(Vec3::X * jaw, self.unseen));
    }

    /// Expression and opening of the jaw (radians) of mouth and lids.
    fn spoken(&self, shut: f32) -> ([f32; EXPRESSION], f32) {
        let (mut sum, mut jaw) = ([0.0; EXPRESSION], 0.0);
        let mut add = |preset: &ExpressionPreset, weight: f32| {
            for (sum, value) in sum.iter_mut().zip(preset.coefficients) {
                *sum += weight * value;
            }
            jaw += weight * preset.jaw;
        };
        let mut bare = 0.0;
        for ((preset, weight), angle) in self.shapes.iter().zip(self.mouth.weights).zip(BARE_JAW) {
            match preset {
                Some(preset) => add(preset, weight),
                None => bare += weight * angle,
            }
        }
        if let Some(blink) = &self.blink {
            add(blink, shut);
        }
        (sum, jaw + bare)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn presets() -> Expressions {
        let preset = |slot: usize, jaw: f32| {
            let mut coefficients = [0.0; EXPRESSION];
            coefficients[slot] = 1.0;
            ExpressionPreset { coefficients, jaw }
        };
        [("a", preset(0, 0.2)), ("blink", preset(3, 0.0))]
            .map(|(name, preset)| (name.to_owned(), preset))
            .into()
    }

    const A: Mouth = Mouth {
        weights: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    };

    /// Motions at 30 Hz of a face seen as `face` says, with the mouth wide open.
    fn motions(seconds: u32, face: impl Fn(f32) -> Option<f32>) -> Vec<MotionParams> {
        let (mut mover, began) = (Mover::new(&presets(), 5), Instant::now());
        (0..seconds * 30)
            .map(|k| {
                let mut motion = MotionParams::default();
                motion.expression_mut()[7] = 0.4;
                let since = Duration::from_secs_f32(k as f32 / 30.0);
                mover.move_face(&mut motion, face(since.as_secs_f32()), A, began + since);
                motion
            })
            .collect()
    }

    #[test]
    fn a_face_that_is_seen_stays_as_it_is() {
        for motion in motions(20, |_| Some(1.0)) {
            assert_eq!(motion.expression()[0], 0.0, "the mouth");
            assert_eq!(motion.expression()[3], 0.0, "the lids");
            assert_eq!(motion.expression()[7], 0.4, "what is seen");
            assert_eq!(motion.axis_angle(Joint::Jaw), Vec3::ZERO, "the jaw");
        }
    }

    #[test]
    fn a_face_that_is_lost_begins_to_speak_without_a_jump() {
        let motions = motions(4, |seconds| Some(if seconds < 2.0 { 1.0 } else { 0.0 }));
        let mouth = |k: usize| motions[k].expression()[0];
        assert_eq!(mouth(59), 0.0, "seen");
        assert!(mouth(119) > 0.95, "lost: {}", mouth(119));
        assert!(motions[119].expression()[7] < 0.02, "nothing is seen");
        for k in 60..120 {
            let step = mouth(k) - mouth(k - 1);
            assert!((-1e-3..0.2).contains(&step), "a jump by {step}");
        }
    }

    #[test]
    fn eyes_blink_and_an_avatar_without_mouths_moves_its_jaw() {
        let all = motions(60, |_| None);
        let shut = all
            .windows(2)
            .filter(|pair| pair[0].expression()[3] < 0.5 && pair[1].expression()[3] >= 0.5);
        let count = shut.count();
        assert!((8..=30).contains(&count), "{count} blinks in a minute");

        let (mut mover, now) = (Mover::new(&Expressions::new(), 5), Instant::now());
        let mut motion = MotionParams::default();
        for k in 0..10u32 {
            mover.move_face(&mut motion, None, A, now + Duration::from_millis(33) * k);
        }
        assert!(
            (motion.axis_angle(Joint::Jaw).x - BARE_JAW[0]).abs() < 1e-5,
            "the jaw alone"
        );
        assert!(
            motion.expression().iter().all(|v| *v == 0.0),
            "nothing else"
        );
    }
}
