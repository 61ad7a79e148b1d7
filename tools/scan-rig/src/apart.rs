//! What is beside each other as the scan stands and comes apart in T-pose: arm and flank, thigh and thigh. No view looked well between them.

use crate::nearest::Nearest;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Skin is closed in where what is before it within the first as the scan stands is more than the second farther in T-pose, metres of a body of the model's
/// size.
pub(crate) const CLOSED_IN: (f32, f32) = (0.05, 0.08);

/// A point in two poses, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InTwoPoses {
    /// Where it faces as the scan stands: what is behind it does not close it in. Zero for what is closed in from any side.
    pub(crate) outwards: Vec3,
    /// As the scan stands.
    pub(crate) scanned: Vec3,
    /// In T-pose.
    pub(crate) straight: Vec3,
}

/// For each of `points` and each of `bounds` whether one of `others` is before it within the first bound of it as the scan stands, and more than the
/// second farther from it in T-pose, metres.
pub(crate) fn come_apart<const N: usize>(
    points: &[InTwoPoses],
    others: &[InTwoPoses],
    bounds: [(f32, f32); N],
) -> Vec<[bool; N]> {
    let places: Vec<[f32; 3]> = others.iter().map(|at| at.scanned.to_array()).collect();
    let tree = Nearest::new(&places);
    let widest = (bounds.iter()).fold(0.0_f32, |widest, (within, _)| widest.max(*within));
    (points.par_iter())
        .map(|point| {
            let mut found = [false; N];
            tree.within(&point.scanned.to_array(), widest, |squared, other| {
                let other = &others[other as usize];
                let apart = squared.sqrt();
                let farther = point.straight.distance(other.straight) - apart;
                if (other.scanned - point.scanned).dot(point.outwards) >= 0.0 {
                    for (found, (within, least)) in found.iter_mut().zip(bounds) {
                        *found |= apart < within && farther > least;
                    }
                }
                if found == [true; N] {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            found
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_together_and_what_was_never_near_does_not_come_apart() {
        let places = [0.0, 0.01, 0.02, 0.5].map(|x| Vec3::X * x);
        let mut both = places.map(|at| InTwoPoses {
            outwards: Vec3::ZERO,
            scanned: at,
            straight: at,
        });
        // The third leaves the first two, and the last comes a long way to where it was.
        both[2].straight = Vec3::new(0.02, 0.3, 0.0);
        both[3].straight = Vec3::X * 0.04;
        let found = come_apart(&both, &both, [(0.05, 0.08), (0.015, 0.08), (0.05, 0.4)]);
        assert_eq!(
            found,
            [
                [true, false, false],
                [true, true, false],
                [true, true, false],
                [false; 3]
            ]
        );
    }

    #[test]
    fn all_that_is_near_is_looked_at_however_many_points_are_nearer() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut anywhere =
            |side: f32| Vec3::from_array(std::array::from_fn(|_| side * random.f32()));
        // Close together as in a dense scan: thousands are within the bounds.
        let all: Vec<InTwoPoses> = (0..6000)
            .map(|at| {
                let scanned = anywhere(0.1);
                let lifted = if at % 997 == 0 { 0.3 } else { 0.0 };
                InTwoPoses {
                    outwards: if at % 3 == 0 { Vec3::ZERO } else { Vec3::X },
                    scanned,
                    straight: scanned + lifted * Vec3::Y + anywhere(0.01),
                }
            })
            .collect();
        let bounds = [(0.05, 0.08), (0.02, 0.2)];
        let found = come_apart(&all, &all, bounds);
        for (point, found) in all.iter().zip(found).step_by(7) {
            let expected = bounds.map(|(within, least)| {
                all.iter().any(|other| {
                    let [here, there] = [
                        (point.scanned.as_dvec3(), other.scanned.as_dvec3()),
                        (point.straight.as_dvec3(), other.straight.as_dvec3()),
                    ]
                    .map(|(a, b)| a.distance(b));
                    let before = (other.scanned - point.scanned).dot(point.outwards) >= 0.0;
                    before && here < f64::from(within) && there - here > f64::from(least)
                })
            });
            assert_eq!(found, expected, "{point:?}");
        }
        let parted = come_apart(&all, &all, bounds)
            .iter()
            .filter(|f| f[1])
            .count();
        assert!(
            (50..5900).contains(&parted),
            "{parted} of {} come apart",
            all.len()
        );
    }
}
