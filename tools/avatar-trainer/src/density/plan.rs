//! Which Gaussians are left out, and which have children.

use super::statistics::Statistics;
use spmm3::attribute;

/// Less opaque Gaussians are left out; of one.
const LEAST_OPACITY: f32 = 0.01;
/// Wider ones are split, smaller ones cloned: metres of the largest standard deviation.
const SPLIT_ABOVE: f32 = 0.004;
/// Those that no picture saw are left out once so much of the budget is used.
const FULL: f32 = 0.9;
/// A Gaussian has been looked for after so many steps.
const LOOKED_FOR: u32 = 64;

/// What becomes of a population.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Plan {
    /// Those that stay as they are, ascending.
    pub kept: Vec<u32>,
    /// Those that two smaller ones take the place of, ascending.
    pub split: Vec<u32>,
    /// Those beside which another one is set, ascending; they are among the kept.
    pub cloned: Vec<u32>,
}

impl Plan {
    /// How many Gaussians there will be.
    #[must_use]
    pub fn count(&self) -> usize {
        self.kept.len() + 2 * self.split.len() + self.cloned.len()
    }

    /// Whether nothing changes in a population of `count`.
    #[must_use]
    pub fn is_empty(&self, count: usize) -> bool {
        self.kept.len() == count && self.split.is_empty() && self.cloned.is_empty()
    }
}

/// Chooses from `attributes` (row-major [14, N], as a package has them) and what `statistics` gathered in `steps` steps: at most `more`
/// Gaussians beyond those that stay, and at most `budget` altogether.
#[must_use]
pub fn plan(
    attributes: &[f32],
    statistics: &Statistics,
    steps: u32,
    more: usize,
    budget: usize,
) -> Plan {
    let count = statistics.pull.len();
    let plane = |index: usize| attributes.get(index * count..(index + 1) * count);
    let (Some(logits), Some(x), Some(y), Some(z)) = (
        plane(attribute::OPACITY),
        plane(attribute::LOG_SCALE.start),
        plane(attribute::LOG_SCALE.start + 1),
        plane(attribute::LOG_SCALE.start + 2),
    ) else {
        return Plan::default();
    };
    #[expect(clippy::cast_precision_loss, reason = "counts of Gaussians")]
    let full = count as f32 >= FULL * budget as f32;
    let unseen = |i: usize| full && steps >= LOOKED_FOR && statistics.seen[i] == 0;
    let opaque = |i: usize| 1.0 / (1.0 + (-logits[i]).exp()) >= LEAST_OPACITY;
    let stays: Vec<usize> = (0..count).filter(|i| opaque(*i) && !unseen(*i)).collect();
    // Never everyone: a training that went astray keeps what it has.
    let mut stays = if 2 * stays.len() < count {
        (0..count).collect()
    } else {
        stays
    };
    if stays.len() > budget {
        // What covers least is missed least: opacity times the area of the two larger axes.
        let area = |i: usize| {
            let least = x[i].min(y[i]).min(z[i]);
            (x[i] + y[i] + z[i] - least).exp() / (1.0 + (-logits[i]).exp())
        };
        stays.sort_by(|a, b| area(*b).total_cmp(&area(*a)).then(a.cmp(b)));
        stays.truncate(budget);
        stays.sort_unstable();
    }
    let room = budget.saturating_sub(stays.len()).min(more);
    let mut pulled: Vec<usize> = (stays.iter().copied())
        .filter(|i| statistics.mean(*i) > 0.0)
        .collect();
    pulled.sort_by(|a, b| {
        let by_pull = statistics.mean(*b).total_cmp(&statistics.mean(*a));
        by_pull.then(a.cmp(b))
    });
    pulled.truncate(room);
    let mut parent = vec![false; count];
    for i in pulled {
        parent[i] = true;
    }
    let mut plan = Plan::default();
    for i in stays {
        let largest = x[i].max(y[i]).max(z[i]).exp();
        let index = u32::try_from(i).unwrap_or(u32::MAX);
        match parent[i] {
            true if largest > SPLIT_ABOVE => plan.split.push(index),
            true => {
                plan.kept.push(index);
                plan.cloned.push(index);
            }
            false => plan.kept.push(index),
        }
    }
    plan
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use spmm3::ATTRIBUTES;

    /// Gaussians of a scale each (log, metres) and a logit of their opacity.
    fn attributes(scales: &[f32], logits: &[f32]) -> Vec<f32> {
        let count = scales.len();
        let mut all = vec![0.0; ATTRIBUTES * count];
        for plane in attribute::LOG_SCALE {
            all[plane * count..(plane + 1) * count].copy_from_slice(scales);
        }
        all[attribute::OPACITY * count..(attribute::OPACITY + 1) * count].copy_from_slice(logits);
        all
    }

    #[test]
    fn wide_ones_are_split_small_ones_cloned_and_faint_ones_left_out() {
        let scales = [0.02f32.ln(), 0.002f32.ln(), 0.02f32.ln(), 0.02f32.ln()];
        let all = attributes(&scales, &[2.0, 2.0, -9.0, 2.0]);
        let statistics = Statistics {
            pull: vec![5.0, 4.0, 9.0, 0.1],
            seen: vec![1, 1, 1, 1],
        };
        let plan = plan(&all, &statistics, 10, 2, 100);
        assert_eq!(plan.split, [0], "wide");
        assert_eq!(plan.cloned, [1], "small");
        assert_eq!(plan.kept, [1, 3], "the faint one is gone");
        assert_eq!(plan.count(), 5, "all of them");
    }

    proptest! {
        #[test]
        fn no_plan_goes_beyond_its_budget(
            rows in prop::collection::vec((-9.0f32..0.0, -9.0f32..9.0, 0.0f32..9.0, 0u32..3), 1..200),
            more in 0usize..100,
            budget in 1usize..300,
            steps in 0u32..200,
        ) {
            let scales: Vec<f32> = rows.iter().map(|row| row.0).collect();
            let logits: Vec<f32> = rows.iter().map(|row| row.1).collect();
            let statistics = Statistics {
                pull: rows.iter().map(|row| row.2).collect(),
                seen: rows.iter().map(|row| row.3).collect(),
            };
            let made = plan(&attributes(&scales, &logits), &statistics, steps, more, budget);
            prop_assert!(made.count() <= budget, "{} of {budget}", made.count());
            prop_assert!(made.kept.len() + made.split.len() <= rows.len(), "no one twice");
            prop_assert!(made.kept.is_sorted() && made.split.is_sorted(), "in order");
            prop_assert!(made.count() > 0, "never everyone");
        }
    }
}
