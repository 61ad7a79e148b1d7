//! What is beside each other as the scan stands and comes apart in T-pose: arm and flank, thigh and thigh. No view looked well between them.

use crate::nearest::Nearest;
use glam::Vec3;
use rayon::prelude::*;

/// Skin is closed in where what is within the first as the scan stands is more than the second farther in T-pose, metres.
pub(crate) const CLOSED_IN: (f32, f32) = (0.05, 0.08);

/// How many of the nearest others are looked at.
const LOOKED_AT: usize = 512;

/// The same points in two poses, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InTwoPoses<'a> {
    /// As the scan stands.
    pub(crate) scanned: &'a [Vec3],
    /// In T-pose.
    pub(crate) straight: &'a [Vec3],
}

/// For each of `points` and each of `bounds` whether one of `others` is within the first bound of it as the scan stands, and more than the
/// second farther from it in T-pose, metres.
pub(crate) fn come_apart<const N: usize>(
    points: InTwoPoses<'_>,
    others: InTwoPoses<'_>,
    bounds: [(f32, f32); N],
) -> Vec<[bool; N]> {
    let places: Vec<[f32; 3]> = others.scanned.iter().map(|at| at.to_array()).collect();
    let tree = Nearest::new(&places);
    let widest = (bounds.iter()).fold(0.0_f32, |widest, (within, _)| widest.max(*within));
    (points.scanned.par_iter().zip(points.straight))
        .map_init(
            || vec![(0.0_f32, 0_u32); LOOKED_AT],
            |near, (scanned, straight)| {
                let mut found = [false; N];
                let count = tree.some(&scanned.to_array(), near);
                for (squared, other) in near.iter().take(count) {
                    let apart = squared.sqrt();
                    if apart >= widest {
                        break;
                    }
                    let Some(other) = others.straight.get(*other as usize) else {
                        continue;
                    };
                    let farther = straight.distance(*other) - apart;
                    for (found, (within, least)) in found.iter_mut().zip(bounds) {
                        *found |= apart < within && farther > least;
                    }
                }
                found
            },
        )
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_together_and_what_was_never_near_does_not_come_apart() {
        let scanned = [0.0, 0.01, 0.02, 0.5].map(|x| Vec3::X * x);
        let mut straight = scanned;
        // The third leaves the first two, and the last comes a long way to where it was.
        straight[2] = Vec3::new(0.02, 0.3, 0.0);
        straight[3] = Vec3::X * 0.04;
        let both = InTwoPoses {
            scanned: &scanned,
            straight: &straight,
        };
        let found = come_apart(both, both, [(0.05, 0.08), (0.015, 0.08), (0.05, 0.4)]);
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
}
