//! L_guide: controllers that disagree with their neighbours.

use crate::error::{ModelError, check_count};
use spmm3::Controllers;

/// Pairs of controllers that L_guide compares.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pairs {
    controllers: usize,
    /// Each unordered pair once, rising.
    pairs: Vec<[u16; 2]>,
}

impl Pairs {
    /// The default: controllers that hold a Gaussian together. The paper's words are "divergence between neighboring controllers"; its sum
    /// runs over all pairs, and would pull a foot's wrinkles towards a hand's.
    #[must_use]
    pub fn neighbouring(controllers: &Controllers) -> Self {
        let all = controllers.neighbours().iter().zip(controllers.masses());
        let mut pairs: Vec<[u16; 2]> = all
            .flat_map(|(held, masses)| {
                [(0, 1), (0, 2), (1, 2)].map(|(k, l)| {
                    let together = masses[k] > 0.0 && masses[l] > 0.0;
                    let (a, b) = (held[k].min(held[l]), held[k].max(held[l]));
                    (together && a != b).then_some([a, b])
                })
            })
            .flatten()
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        Self {
            controllers: controllers.vertices().len(),
            pairs,
        }
    }

    /// All pairs, as the paper's sum is written.
    #[must_use]
    pub fn all(controllers: &Controllers) -> Self {
        let count = controllers.vertices().len();
        let numbers = || (0..u16::MAX).take(count);
        Self {
            controllers: count,
            pairs: numbers()
                .flat_map(|a| numbers().skip(usize::from(a) + 1).map(move |b| [a, b]))
                .collect(),
        }
    }

    /// Each unordered pair once.
    #[must_use]
    pub fn pairs(&self) -> &[[u16; 2]] {
        &self.pairs
    }
}

/// The paper's L_guide (section IV-C): |Delta x_j - Delta x_k|^2 summed over ordered pairs, square metres; every pair counts twice, as in
/// the paper's sum. `offsets` are those of [`crate::Model::controller_offsets`], row-major [C, 3].
///
/// # Errors
/// Arrays of another number of controllers.
#[expect(
    clippy::cast_possible_truncation,
    reason = "derivatives are single precision"
)]
pub fn guide(
    offsets: &[f32],
    pairs: &Pairs,
    weight: f32,
    by_offsets: &mut [f32],
) -> Result<f64, ModelError> {
    check_count("controllers' offsets", offsets.len(), 3 * pairs.controllers)?;
    check_count(
        "derivatives by controllers' offsets",
        by_offsets.len(),
        offsets.len(),
    )?;
    let mut sum = 0.0;
    for [a, b] in &pairs.pairs {
        for axis in 0..3 {
            let (a, b) = (3 * usize::from(*a) + axis, 3 * usize::from(*b) + axis);
            let difference = f64::from(offsets[a]) - f64::from(offsets[b]);
            sum += 2.0 * difference * difference;
            let by = (4.0 * f64::from(weight) * difference) as f32;
            by_offsets[a] += by;
            by_offsets[b] -= by;
        }
    }
    Ok(f64::from(weight) * sum)
}
