//! Which Gaussians to leave out first when a device cannot draw them all in time.
//!
//! It keeps the order that the bake found (or a simple one, for packages without), and turns shares of it into lists that
//! a packing loop walks. It measures no times and decides nothing: the quality controller does.

use crate::{BoundGaussians, PersonError, attribute};

/// Exponent of the area that a kept Gaussian covers, relative to its own, in its scales: 0.5 would cover all of it as
/// densely as before, at the price of blur where Gaussians overlap anyway. Measured with `examples/importance.rs`.
const GROWTH: f32 = 0.4;

/// The same exponent of 1 / share, for packages without heirs.
const GROWTH_ALIKE: f32 = 0.25;

/// Most growth of one Gaussian, log2.
const MOST_GROWTH: f32 = 2.0;

/// Gaussians in the order of their importance, a permutation of 0..N_g.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Importance {
    order: Vec<u32>,
    heirs: Option<Vec<u32>>,
}

/// The Gaussians of one level of detail.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeptLevel {
    /// Indices of those to draw, ascending, so that memory is read in order.
    pub kept: Vec<u32>,
    /// For each of `kept`, what to add to the log2 of all three scales, so that it closes the holes of those it replaces.
    pub log2_growth: Vec<f32>,
}

impl Importance {
    /// Takes Gaussian indices, the most important first, each of 0..`gaussians` once; and, where known, each Gaussian's
    /// heir: the Gaussian that takes over its place once it is left out, itself if none does.
    ///
    /// # Errors
    /// If the order is no permutation of 0..`gaussians`, or a Gaussian's heir is left out before it.
    pub fn new(
        order: Vec<u32>,
        heirs: Option<Vec<u32>>,
        gaussians: usize,
    ) -> Result<Self, PersonError> {
        const ORDER: &str = "Gaussian in the order of importance";
        PersonError::check_count("order of importance", order.len(), gaussians)?;
        PersonError::check_indices(ORDER, order.iter().map(|i| *i as usize), gaussians)?;
        let mut seen = vec![false; gaussians];
        for (at, index) in order.iter().enumerate() {
            if std::mem::replace(&mut seen[*index as usize], true) {
                return Err(PersonError::Repeated {
                    what: ORDER,
                    at,
                    index: *index as usize,
                });
            }
        }
        if let Some(heirs) = &heirs {
            PersonError::check_count("heirs of Gaussians", heirs.len(), gaussians)?;
            let indices = heirs.iter().map(|i| *i as usize);
            PersonError::check_indices("heir of Gaussian", indices, gaussians)?;
            let mut known = vec![false; gaussians];
            for gaussian in order.iter().map(|i| *i as usize) {
                let heir = heirs[gaussian] as usize;
                if heir != gaussian && !known[heir] {
                    return Err(PersonError::Heir { gaussian, heir });
                }
                known[gaussian] = true;
            }
        }
        Ok(Self { order, heirs })
    }

    /// A simple order for avatars that come without one: opacity times the area of the two larger axes, the largest
    /// first, equals by index.
    #[must_use]
    pub fn by_size(gaussians: &BoundGaussians) -> Self {
        let count = gaussians.len();
        let logits = &gaussians.attributes()[attribute::OPACITY * count..];
        let weights: Vec<f32> = (0..count)
            .map(|i| area(gaussians, i) / (1.0 + (-logits[i]).exp()))
            .collect();
        let mut order: Vec<u32> = (0u32..).take(count).collect();
        order.sort_by(|a, b| weights[*b as usize].total_cmp(&weights[*a as usize]));
        Self { order, heirs: None }
    }

    /// Gaussian indices, the most important first.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// `[N_g]` each one's heir, if that is known.
    #[must_use]
    pub fn heirs(&self) -> Option<&[u32]> {
        self.heirs.as_deref()
    }

    /// The most important `share` (0..=1) of `gaussians`, which this order is of; at least one where there are any.
    /// Allocates: make the lists of all levels once, at the start.
    #[must_use]
    pub fn level(&self, gaussians: &BoundGaussians, share: f32) -> KeptLevel {
        let count = self.order.len().min(gaussians.len());
        let share = if share.is_nan() {
            1.0
        } else {
            share.clamp(0.0, 1.0)
        };
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count is one"
        )]
        let wanted = (f64::from(share) * count as f64).round() as usize;
        let (first, rest) = self.order.split_at(wanted.clamp(count.min(1), count));
        let mut kept = first.to_vec();
        kept.sort_unstable();
        let Some(heirs) = &self.heirs else {
            let alike = (count.max(1) as f32 / kept.len().max(1) as f32).log2() * GROWTH_ALIKE;
            let log2_growth = vec![alike; kept.len()];
            return KeptLevel { kept, log2_growth };
        };
        // Heirs come before those they inherit from: one pass finds the last heir of each.
        let mut stands_for: Vec<u32> = (0u32..).take(self.order.len()).collect();
        let mut areas: Vec<f32> = (0..gaussians.len()).map(|i| area(gaussians, i)).collect();
        let own = areas.clone();
        for gone in rest.iter().map(|i| *i as usize) {
            let heir = stands_for[heirs[gone] as usize];
            stands_for[gone] = heir;
            if heir as usize != gone {
                areas[heir as usize] += own[gone];
            }
        }
        let growth = |i: &u32| {
            let ratio = areas[*i as usize] / own[*i as usize].max(f32::MIN_POSITIVE);
            (GROWTH * ratio.log2()).clamp(0.0, MOST_GROWTH)
        };
        let log2_growth = kept.iter().map(growth).collect();
        KeptLevel { kept, log2_growth }
    }
}

/// Product of a Gaussian's two larger standard deviations, square metres.
fn area(gaussians: &BoundGaussians, i: usize) -> f32 {
    let count = gaussians.len();
    let logs = attribute::LOG_SCALE.map(|plane| gaussians.attributes()[plane * count + i]);
    let (sum, least) = logs.fold((0.0, f32::INFINITY), |(s, l), v| (s + v, l.min(v)));
    (sum - least).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ATTRIBUTES, INFLUENCES, SkinWeights, Template};
    use glam::Vec3;

    /// Gaussians of these scales and opacity logits.
    fn gaussians(wanted: &[([f32; 3], f32)]) -> BoundGaussians {
        let skin = SkinWeights {
            joints: [0; INFLUENCES],
            weights: std::array::from_fn(|k| if k == 0 { 1.0 } else { 0.0 }),
        };
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let template = Template::new(corners, vec![[0, 1, 2]], vec![skin; 3]).expect("a triangle");
        let count = wanted.len();
        let mut attributes = vec![0.0; ATTRIBUTES * count];
        for (i, (scales, logit)) in wanted.iter().enumerate() {
            for (axis, scale) in scales.iter().enumerate() {
                attributes[(attribute::LOG_SCALE.start + axis) * count + i] = f32::ln(*scale);
            }
            attributes[attribute::OPACITY * count + i] = *logit;
        }
        BoundGaussians::new(&template, vec![0; count], vec![[0.3; 2]; count], attributes)
            .expect("Gaussians")
    }

    #[test]
    fn an_order_is_a_permutation_whose_heirs_are_more_important() {
        let order = |order: &[u32], heirs: Option<&[u32]>| {
            Importance::new(order.to_vec(), heirs.map(<[u32]>::to_vec), 3)
                .map_err(|e| e.to_string())
        };
        assert!(order(&[2, 0, 1], None).is_ok(), "a permutation");
        assert!(order(&[2, 0, 1], Some(&[2, 0, 2])).is_ok(), "and its heirs");
        for (mistake, heirs, reason) in [
            (&[0, 1][..], None, "has 2 entries where 3 are needed"),
            (&[0, 1, 2, 0], None, "has 4 entries where 3 are needed"),
            (&[0, 1, 3], None, "number 2 is 3, but there are only 3"),
            (&[1, 0, 1], None, "number 2 is 1, which stands there before"),
            (&[2, 0, 1], Some(&[2, 0][..]), "has 2 entries where 3"),
            (&[2, 0, 1], Some(&[2, 3, 2]), "there are only 3"),
            (&[2, 0, 1], Some(&[1, 0, 2]), "Gaussian 0 goes to 1"),
        ] {
            let error = order(mistake, heirs).expect_err("a mistake");
            assert!(error.contains(reason), "{mistake:?}: {error}");
        }
    }

    #[test]
    fn a_level_holds_the_most_important_in_ascending_order_and_grows_them() {
        let all_alike = gaussians(&[([0.01; 3], 3.0); 8]);
        let order = vec![4, 7, 1, 0, 6, 2, 5, 3];
        let importance = Importance::new(order, None, 8).expect("an order");
        let half = importance.level(&all_alike, 0.5);
        assert_eq!(half.kept, [0, 1, 4, 7], "the first four");
        assert_eq!(half.log2_growth, [GROWTH_ALIKE; 4], "half as many");
        let quarter = importance.level(&all_alike, 0.25);
        assert_eq!(quarter.kept, [4, 7], "the first two");
        assert_eq!(quarter.log2_growth, [2.0 * GROWTH_ALIKE; 2], "a quarter");
        let all = importance.level(&all_alike, 1.0);
        assert_eq!(all.kept, [0, 1, 2, 3, 4, 5, 6, 7], "all");
        assert_eq!(all.log2_growth, [0.0; 8], "as they are");
        for (share, count) in [(0.0, 1), (-3.0, 1), (7.0, 8), (f32::NAN, 8)] {
            let level = importance.level(&all_alike, share);
            assert_eq!(level.kept.len(), count, "{share}");
        }
        let none = Importance::new(Vec::new(), None, 0).expect("of nothing");
        let level = none.level(&gaussians(&[]), 0.5);
        assert!(level.kept.is_empty(), "nothing of nothing");
    }

    #[test]
    fn each_grows_by_the_area_of_those_it_replaces() {
        let sizes = [0.01, 0.01, 0.02, 0.01];
        let set = gaussians(&sizes.map(|s| ([s, s, 0.001], 3.0)));
        // 3 hands on to 2, which hands on to 0; 1 has no heir.
        let importance = Importance::new(vec![0, 1, 2, 3], Some(vec![0, 1, 0, 2]), 4);
        let level = importance.expect("an order").level(&set, 0.5);
        assert_eq!(level.kept, [0, 1], "the first two");
        // Areas 1 + 4 + 1 of its own 1.
        let expected = GROWTH * 6f32.log2();
        assert!(
            (level.log2_growth[0] - expected).abs() < 1e-4,
            "{} for {expected}",
            level.log2_growth[0]
        );
        assert!(level.log2_growth[1] == 0.0, "it replaces no other");
    }

    #[test]
    fn without_a_better_order_the_large_and_solid_come_first() {
        // The least scale does not count.
        let set = gaussians(&[
            ([0.01, 0.02, 0.001], 3.0),
            ([0.01, 0.001, 0.03], 3.0),
            ([0.01, 0.02, 0.001], -1.0),
            ([0.05, 0.05, 0.05], 3.0),
        ]);
        assert_eq!(Importance::by_size(&set).order(), [3, 1, 0, 2], "order");
    }
}
