//! The expression basis: MakeHuman's linear expression units, compressed to a few orthogonal ones, as FLAME's are.
//!
//! Its name is [`spmm3::ExpressionBasis::MAKEHUMAN_1`]: whatever changes what a coefficient moves needs a new name.
//!
//! If each unit of U `[34]` is drawn independently with deviation s, the offsets' principal components are the singular
//! vectors of U; scaling each by s times its singular value gives coefficients of unit variance, FLAME's convention.

use super::mixes::{MIXES, UNITS};
use super::recipe::NEUTRAL_EYES;
use glam::Vec3;
use nalgebra::DMatrix;
use rayon::prelude::*;
use spmm3::{EXPRESSION, ExpressionPreset, Expressions};

/// How many of the 50 expression coefficients the basis uses; the rest move nothing.
pub const EXPRESSIONS_USED: usize = 16;

/// Assumed deviation of a unit's strength (0..=1) in ordinary talk.
const UNIT_DEVIATION: f32 = 0.3;

/// A named expression: its name, the jaw's opening in degrees, strengths of expression units.
type Preset = (&'static str, f32, &'static [(&'static str, f32)]);

/// The named expressions. A unit's `*` stands for both sides.
const PRESETS: [Preset; 11] = [
    (
        "blink",
        0.0,
        &[("eye-*-closure", 1.0), ("eye-*-opened-up", -NEUTRAL_EYES)],
    ),
    (
        "smile",
        0.0,
        &[
            ("mouth-corner-puller", 0.9),
            ("mouth-part-later", 0.3),
            ("eye-*-slit", 0.3),
        ],
    ),
    (
        "brows_up",
        0.0,
        &[
            ("eyebrows-*-up", 1.3),
            ("eyebrows-*-inner-up", 0.2),
            ("eyebrows-*-extern-up", 0.5),
        ],
    ),
    ("brows_down", 0.0, &[("eyebrows-*-down", 1.0)]),
    ("a", 11.0, &[]),
    (
        "e",
        4.0,
        &[("mouth-part-later", 0.7), ("mouth-retraction", 0.3)],
    ),
    (
        "i",
        2.0,
        &[("mouth-part-later", 0.6), ("mouth-retraction", 0.5)],
    ),
    ("o", 7.0, &[("mouth-pursing", 0.8)]),
    (
        "u",
        2.0,
        &[("mouth-pursing", 1.0), ("mouth-protusion", 0.3)],
    ),
    ("mbp", 0.0, &[("mouth-compression", 0.8)]),
    ("fv", 2.0, &[("mouth-upward-retraction", 0.5)]),
];

/// The basis and what it is made of.
pub(super) struct ExpressionBasis {
    /// `[16][N_v]` offsets in metres per unit of coefficient.
    pub(super) offsets: Vec<Vec<Vec3>>,
    /// Named expressions in the basis' coefficients.
    pub(super) presets: Expressions,
    /// `[16][units]` each component's mix of the units, unit length.
    pub(super) mixes: Vec<Vec<f32>>,
    /// Share of the units' energy the basis holds.
    pub(super) explained: f32,
}

/// Compresses `units`: names and `[N_v]` offsets in metres.
pub(super) fn compress(units: &[(String, Vec<Vec3>)]) -> ExpressionBasis {
    let count = units.len();
    let products: Vec<f64> = (0..count * count)
        .into_par_iter()
        .map(|k| {
            let (a, b) = (&units[k / count].1, &units[k % count].1);
            a.iter().zip(b).map(|(a, b)| f64::from(a.dot(*b))).sum()
        })
        .collect();
    let eigen = DMatrix::from_row_slice(count, count, &products).symmetric_eigen();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    order.truncate(EXPRESSIONS_USED);
    let explained = order.iter().map(|k| eigen.eigenvalues[*k]).sum::<f64>()
        / eigen.eigenvalues.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    // Each component's mix of units, its strongest unit positive, so that the signs are reproducible.
    let mixes: Vec<Vec<f32>> = order
        .iter()
        .map(|k| {
            let column = eigen.eigenvectors.column(*k);
            let sign = if column[column.icamax()] < 0.0 {
                -1.0
            } else {
                1.0
            };
            #[allow(clippy::cast_possible_truncation, reason = "a unit vector's component")]
            column.iter().map(|v| (v * sign) as f32).collect()
        })
        .collect();
    let (offsets, presets) = mix(units, &mixes);
    #[allow(clippy::cast_possible_truncation, reason = "a share of 1")]
    ExpressionBasis {
        offsets,
        presets,
        mixes,
        explained: explained as f32,
    }
}

/// Basis and presets by given mixes of the units.
fn mix<M: AsRef<[f32]> + Sync>(
    units: &[(String, Vec<Vec3>)],
    mixes: &[M],
) -> (Vec<Vec<Vec3>>, Expressions) {
    let offsets = mixes
        .par_iter()
        .map(|mix| {
            let mut sum = vec![Vec3::ZERO; units.first().map_or(0, |(_, o)| o.len())];
            for (share, (_, offsets)) in mix.as_ref().iter().zip(units) {
                for (sum, offset) in sum.iter_mut().zip(offsets) {
                    *sum += *share * UNIT_DEVIATION * *offset;
                }
            }
            sum
        })
        .collect();
    let presets = PRESETS
        .iter()
        .map(|(name, jaw_degrees, strengths)| {
            let mut coefficients = [0.0; EXPRESSION];
            for (unit, (name, _)) in units.iter().enumerate() {
                for (pattern, strength) in *strengths {
                    if matches_unit(pattern, name) {
                        for (slot, mix) in coefficients.iter_mut().zip(mixes) {
                            *slot += mix.as_ref().get(unit).copied().unwrap_or_default() * strength
                                / UNIT_DEVIATION;
                        }
                    }
                }
            }
            let preset = ExpressionPreset {
                coefficients,
                jaw: jaw_degrees.to_radians(),
            };
            ((*name).to_owned(), preset)
        })
        .collect();
    (offsets, presets)
}

/// The basis [`spmm3::ExpressionBasis::MAKEHUMAN_1`] on another body: `[16][N_v]` offsets per unit of coefficient, in the unit and frame of the
/// offsets given, and the presets. A coefficient mixes the same units as it does on the demo person, so that one motion moves both
/// faces alike. `units`: names and `[N_v]` offsets.
///
/// `None` if the units are not MakeHuman's 34.
#[must_use]
pub fn expression_basis(units: &[(String, Vec<Vec3>)]) -> Option<(Vec<Vec<Vec3>>, Expressions)> {
    let same = units.len() == UNITS.len()
        && (units.iter().zip(UNITS)).all(|((name, _), unit)| name.as_str() == unit)
        && units.iter().all(|(_, o)| o.len() == units[0].1.len());
    same.then(|| mix(units, &MIXES))
}

fn matches_unit(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((start, end)) => ["left", "right"]
            .iter()
            .any(|side| name == format!("{start}{side}{end}")),
    }
}
