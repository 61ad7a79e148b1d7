//! Long Gaussians as rows of shorter ones: a long one would stand off the body where the body bends.

use crate::scan::Scan;
use glam::{Mat3, Vec3};

/// Gaussians whose longest standard deviation is more are split, metres.
pub(super) const LONGEST: f32 = 0.02;
/// Rounds of splitting: what is 3 m long ends below [`LONGEST`].
const ROUNDS: usize = 10;
/// Standard deviation of the three parts along the axis that is split, as a share of the whole's.
const PART: f32 = 0.55;
/// The largest opacity that a part gets: 1 has no finite logit.
const OPAQUE: f32 = 0.999;
/// For opacities of the whole: distance of the outer parts from the middle, as a share of the whole's standard deviation, and opacities
/// of the outer parts and the middle one, as shares of the whole's.
///
/// Fitted, so that the opacity of the three blended along the axis differs from the whole's by 2 to 3 % (root mean square).
const PARTS: [(f32, [f32; 3]); 5] = [
    (0.1, [1.043, 0.452, 0.892]),
    (0.3, [1.022, 0.466, 0.912]),
    (0.5, [0.998, 0.483, 0.939]),
    (0.7, [0.972, 0.503, 0.977]),
    (0.9, [0.941, 0.527, 1.032]),
];

/// A scan without Gaussians longer than `longest` metres (standard deviation), and which Gaussian of the given scan each was part of.
/// No more than `most` Gaussians are made: if that is too few, the longest of the last round stay.
#[must_use]
pub(super) fn without_long(scan: &Scan, longest: f32, most: usize) -> (Scan, Vec<u32>) {
    let mut out = scan.clone();
    let mut parents: Vec<u32> = (0_u32..).take(scan.len()).collect();
    for _ in 0..ROUNDS {
        let is_long = |out: &Scan, at: usize| out.scales[at].max_element() > longest;
        if split_where(&mut out, &mut parents, most, is_long) == 0 {
            break;
        }
    }
    (out, parents)
}

/// Splits each Gaussian for which `is_to_split`, unless there would be more than `most`; how many were. The middle part stays in its place,
/// the outer ones are appended, with the entry of `of` that the whole has.
pub(super) fn split_where<T: Copy>(
    scan: &mut Scan,
    of: &mut Vec<T>,
    most: usize,
    is_to_split: impl Fn(&Scan, usize) -> bool,
) -> usize {
    let mut count = 0;
    for at in 0..scan.len() {
        if scan.len() + 2 <= most && is_to_split(scan, at) {
            of.extend([of[at]; 2]);
            split(scan, at);
            count += 1;
        }
    }
    count
}

/// Replaces a Gaussian by its middle part and appends the outer two.
fn split(scan: &mut Scan, at: usize) {
    let scale = scan.scales[at];
    let axis = (0..3).fold(0, |most, axis| {
        if scale[axis] > scale[most] {
            axis
        } else {
            most
        }
    });
    let direction = Mat3::from_quat(scan.rotations[at]).col(axis);
    let [distance, outer, middle] = parts(scan.opacities[at]);
    let shift: Vec3 = direction * (scale[axis] * distance);
    let opacity = scan.opacities[at];
    scan.scales[at][axis] *= PART;
    scan.opacities[at] = (opacity * middle).min(OPAQUE);
    for side in [1.0, -1.0] {
        scan.positions.push(scan.positions[at] + shift * side);
        scan.rotations.push(scan.rotations[at]);
        scan.scales.push(scan.scales[at]);
        scan.opacities.push((opacity * outer).min(OPAQUE));
        scan.colours.push(scan.colours[at]);
    }
}

/// The row of [`PARTS`] for an opacity, between its neighbours.
fn parts(opacity: f32) -> [f32; 3] {
    let mut below = PARTS[0];
    for row in PARTS {
        if opacity <= row.0 {
            let width = row.0 - below.0;
            let share = if width > 0.0 {
                (opacity - below.0) / width
            } else {
                0.0
            };
            return std::array::from_fn(|i| below.1[i] + (row.1[i] - below.1[i]) * share.max(0.0));
        }
        below = row;
    }
    below.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn the_parts_of_a_long_gaussian_look_like_it_and_are_short() {
        for opacity in [0.05, 0.2, 0.6, 0.95] {
            let scan = Scan {
                positions: vec![Vec3::new(0.1, 0.2, 0.3)],
                rotations: vec![Quat::from_rotation_z(0.7)],
                scales: vec![Vec3::new(0.034, 0.004, 0.003)],
                opacities: vec![opacity],
                colours: vec![Vec3::ONE],
            };
            let (parts, parents) = without_long(&scan, LONGEST, 100);
            assert_eq!(parents, [0, 0, 0], "parents at opacity {opacity}");
            let along = Quat::from_rotation_z(0.7) * Vec3::X;
            let mut error = 0.0;
            for step in -40..=40 {
                let x = step as f32 * 0.1 * 0.034;
                let whole = opacity * (-0.5 * (x / 0.034).powi(2)).exp();
                let mut clear = 1.0;
                for at in 0..3 {
                    let away = (parts.positions[at] - scan.positions[0]).dot(along) - x;
                    let sigma = parts.scales[at].x;
                    clear *= 1.0 - parts.opacities[at] * (-0.5 * (away / sigma).powi(2)).exp();
                }
                error += (1.0 - clear - whole).powi(2) / 81.0;
            }
            let error = error.sqrt() / opacity;
            assert!(error < 0.035, "{error} at opacity {opacity}");
        }
    }

    #[test]
    fn splitting_ends_at_the_bound_of_length_or_of_number() {
        let scan = Scan {
            positions: vec![Vec3::ZERO; 2],
            rotations: vec![Quat::IDENTITY; 2],
            scales: vec![Vec3::new(0.15, 0.03, 0.001), Vec3::splat(0.001)],
            opacities: vec![0.5; 2],
            colours: vec![Vec3::ONE; 2],
        };
        let (parts, parents) = without_long(&scan, LONGEST, 100_000);
        let longest = parts
            .scales
            .iter()
            .map(|s| s.max_element())
            .fold(0.0, f32::max);
        assert!(longest <= LONGEST, "{longest} m");
        assert_eq!(parents.len(), parts.len(), "a parent for each");
        assert_eq!(
            parents.iter().filter(|p| **p == 1).count(),
            1,
            "the short one"
        );
        assert!(without_long(&scan, LONGEST, 10).0.len() <= 10, "the bound");
    }
}
