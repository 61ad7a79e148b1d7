//! Adam (Kingma and Ba, 2015), for any array of numbers.

use crate::error::{GradientError, check_count};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

/// How fast the first moment forgets.
const BETA_1: f32 = 0.9;
/// How fast the second moment forgets.
const BETA_2: f32 = 0.999;
/// Added to the root of the second moment; as 3DGS has it.
const EPSILON: f32 = 1e-15;
/// Numbers that one thread takes at a time.
const GRAIN: usize = 16_384;

/// Numbers that follow one another and are learnt at one rate: a plane of [`crate::Attributes`], a layer of a network.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Group {
    /// How many.
    pub count: usize,
    /// The learning rate: about how far a number moves in a step. At 0 it stays, and so do its moments.
    pub rate: f32,
}

/// What Adam remembers of the derivatives. Plain arrays, so that a trainer can store them, or move them when Gaussians come and go.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Adam {
    /// Mean of the derivatives by each number, not yet corrected for its start at 0.
    pub first: Vec<f32>,
    /// Mean of their squares.
    pub second: Vec<f32>,
    /// Steps that were made.
    pub steps: u32,
}

impl Adam {
    /// Before the first step, for so many numbers.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self {
            first: vec![0.0; count],
            second: vec![0.0; count],
            steps: 0,
        }
    }

    /// Makes a step down the gradient. `groups` cover all numbers, in their order.
    ///
    /// # Errors
    /// Derivatives, moments or groups that are not as many as the numbers; nothing has changed then.
    pub fn step(
        &mut self,
        numbers: &mut [f32],
        gradients: &[f32],
        groups: &[Group],
    ) -> Result<(), GradientError> {
        let count = numbers.len();
        let covered = groups
            .iter()
            .fold(0usize, |sum, group| sum.saturating_add(group.count));
        check_count("derivatives", gradients.len(), count)?;
        check_count("numbers in groups", covered, count)?;
        check_count("Adam's first moments", self.first.len(), count)?;
        check_count("Adam's second moments", self.second.len(), count)?;
        self.steps = self.steps.saturating_add(1);
        let mut rest = (
            numbers,
            gradients,
            &mut self.first[..],
            &mut self.second[..],
        );
        for group in groups {
            let (numbers, more_numbers) = rest.0.split_at_mut(group.count);
            let (gradients, more_gradients) = rest.1.split_at(group.count);
            let (firsts, more_firsts) = rest.2.split_at_mut(group.count);
            let (seconds, more_seconds) = rest.3.split_at_mut(group.count);
            rest = (more_numbers, more_gradients, more_firsts, more_seconds);
            if group.rate == 0.0 {
                continue;
            }
            let step = Step::new(self.steps, group.rate);
            numbers
                .par_chunks_mut(GRAIN)
                .zip(gradients.par_chunks(GRAIN))
                .zip(firsts.par_chunks_mut(GRAIN))
                .zip(seconds.par_chunks_mut(GRAIN))
                .for_each(|(((numbers, gradients), firsts), seconds)| {
                    step.take(numbers, gradients, firsts, seconds);
                });
        }
        Ok(())
    }
}

/// One step at one rate, for who keeps moments of their own or computes derivatives as they are needed.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    level: Level,
    /// The learning rate, corrected for the first moment's start.
    rate: f32,
    /// The correction of the second moment.
    second: f32,
}

impl Step {
    /// Step number `steps` (the first is 1) at a learning rate.
    #[must_use]
    pub fn new(steps: u32, rate: f32) -> Self {
        let unbiased = |beta: f32| 1.0 / (1.0 - f64::from(beta).powf(f64::from(steps)));
        #[expect(clippy::cast_possible_truncation, reason = "factors near 1 to 1000")]
        let (first, second) = (unbiased(BETA_1) as f32, unbiased(BETA_2) as f32);
        Self {
            level: Level::new(),
            rate: rate * first,
            second,
        }
    }

    /// Moves as many numbers as there are of everything, on this thread.
    pub fn take(
        self,
        numbers: &mut [f32],
        gradients: &[f32],
        firsts: &mut [f32],
        seconds: &mut [f32],
    ) {
        dispatch!(self.level, simd => self.run(simd, numbers, gradients, firsts, seconds));
    }

    /// A plain loop, which the compiler lays out for the processor's vectors.
    #[inline(always)]
    fn run<S: Simd>(
        self,
        _: S,
        numbers: &mut [f32],
        gradients: &[f32],
        firsts: &mut [f32],
        seconds: &mut [f32],
    ) {
        let moments = firsts.iter_mut().zip(seconds);
        let pairs = numbers.iter_mut().zip(gradients).zip(moments);
        for ((number, gradient), (first, second)) in pairs {
            *first += (1.0 - BETA_1) * (gradient - *first);
            *second += (1.0 - BETA_2) * (gradient * gradient - *second);
            *number -= self.rate * *first / ((*second * self.second).sqrt() + EPSILON);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kingma and Ba's algorithm 1, word by word, in f64.
    fn reference(start: f64, gradients: &[f64], rate: f64) -> f64 {
        let (mut number, mut m, mut v) = (start, 0.0, 0.0);
        for (t, g) in (1..).zip(gradients) {
            m = 0.9 * m + 0.1 * g;
            v = 0.999 * v + 0.001 * g * g;
            let (m_hat, v_hat) = (m / (1.0 - 0.9f64.powi(t)), v / (1.0 - 0.999f64.powi(t)));
            number -= rate * m_hat / (v_hat.sqrt() + 1e-15);
        }
        number
    }

    #[test]
    fn steps_are_those_of_the_article_at_each_groups_rate() {
        let groups = [
            Group {
                count: 2,
                rate: 0.1,
            },
            Group {
                count: 1,
                rate: 0.0,
            },
            Group {
                count: 1,
                rate: 0.003,
            },
        ];
        let mut numbers = [1.0f32, -2.0, 5.0, 0.5];
        let start = numbers;
        let mut adam = Adam::new(4);
        let by_step: Vec<[f32; 4]> = (0..200u8)
            .map(|step| {
                let wave = (f32::from(step) * 0.3).sin();
                [wave + 0.2, 1e-6 * (wave - 0.1), wave, 40.0 * wave]
            })
            .collect();
        for gradients in &by_step {
            adam.step(&mut numbers, gradients, &groups).expect("four");
        }
        for (k, rate) in [(0, 0.1), (1, 0.1), (3, 0.003)] {
            let gradients: Vec<f64> = by_step.iter().map(|all| f64::from(all[k])).collect();
            let expected = reference(f64::from(start[k]), &gradients, rate);
            let got = f64::from(numbers[k]);
            let moved = (expected - f64::from(start[k])).abs();
            assert!(
                (got - expected).abs() < 1e-4 * moved.max(1.0),
                "{k}: {got}, {expected}"
            );
        }
        assert!(
            (numbers[2] - 5.0).abs() < f32::EPSILON,
            "at rate 0 it stays"
        );
    }

    #[test]
    fn what_does_not_fit_is_refused_and_changes_nothing() {
        let mut adam = Adam::new(3);
        let group = |count| [Group { count, rate: 0.1 }];
        let mut numbers = [1.0; 3];
        for refused in [
            adam.step(&mut numbers, &[1.0; 2], &group(3)),
            adam.step(&mut numbers, &[1.0; 3], &group(4)),
            Adam::new(2).step(&mut numbers, &[1.0; 3], &group(3)),
        ] {
            assert!(
                matches!(refused, Err(GradientError::Count { .. })),
                "{refused:?}"
            );
        }
        assert_eq!((adam, numbers), (Adam::new(3), [1.0; 3]), "unchanged");
    }
}
