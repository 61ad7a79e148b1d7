//! How the capture's poses vary.

use spmm3::{BODY, EXPRESSION, MotionParams, PARAMS};

/// Joints that vary less are taken to vary by so much, radians: a feature of them is no guess about larger angles.
const LEAST_ANGLE: f32 = 0.15;
/// The same for coefficients of the face.
const LEAST_EXPRESSION: f32 = 0.5;

/// Mean and spread of each motion parameter over the frames that are learnt from.
#[derive(Debug, Clone, PartialEq)]
pub struct InputStatistics {
    /// `[215]`
    pub mean: Vec<f32>,
    /// `[215]` Standard deviations, or the least one that is believed.
    pub spread: Vec<f32>,
}

impl InputStatistics {
    /// Of these frames.
    #[must_use]
    pub fn new<'a>(motions: impl Iterator<Item = &'a MotionParams> + Clone) -> Self {
        let count = motions.clone().count().max(1);
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let share = 1.0 / count as f64;
        let mut mean = vec![0.0f64; PARAMS];
        for motion in motions.clone() {
            for (sum, value) in mean.iter_mut().zip(motion.values()) {
                *sum += f64::from(*value) * share;
            }
        }
        let mut variance = vec![0.0f64; PARAMS];
        for motion in motions {
            for ((sum, value), mean) in variance.iter_mut().zip(motion.values()).zip(&mean) {
                *sum += (f64::from(*value) - mean).powi(2) * share;
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "networks are single precision"
        )]
        let narrow = |value: f64| value as f32;
        let face = BODY..BODY + EXPRESSION;
        let spread = variance.iter().enumerate().map(|(index, variance)| {
            let least = if face.contains(&index) {
                LEAST_EXPRESSION
            } else {
                LEAST_ANGLE
            };
            narrow(variance.sqrt()).max(least)
        });
        Self {
            spread: spread.collect(),
            mean: mean.into_iter().map(narrow).collect(),
        }
    }
}
