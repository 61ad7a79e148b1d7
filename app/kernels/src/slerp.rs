//! Slerp without sines: two polynomials, fitted for each display time.
//!
//! All Gaussians of a picture are interpolated at one time t, so that Slerp's two weights are functions of the angle
//! alone. With theta the angle between the quaternions (as vectors) and x = sin^2(theta/2) = |b - a|^2 / 4,
//!
//! ```text
//! slerp(a, b, t) = s a + w (b - a),   s = cos((t - 1/2) theta) / cos(theta/2),   w = sin(t theta) / sin(theta)
//! ```
//!
//! where s and w are analytic in x up to x = 1: they are the hypergeometric functions 2F1(t, 1-t; 1/2; x) and
//! t 2F1(1+t, 1-t; 3/2; x), the series that Eberly's "A Fast and Accurate Algorithm for Computing SLERP" truncates. On
//! the shortest arc x <= 1/2, where polynomials through Chebyshev nodes come nearer than the truncated series with fewer
//! terms. s(0) = 1 and w(0) = t are exact: equal quaternions stay what they are, and small angles lose nothing, since x
//! comes from the difference and not from a cosine near 1.

use fearless_simd::prelude::*;

/// Coefficients of each polynomial.
const TERMS: usize = 8;
/// x at an angle of 90 degrees between quaternions, a rotation by 180: the most on the shortest arc.
const MOST_X: f64 = 0.5;

/// The weights of Slerp at one time, for any angle. Their error is at most 1e-6 for t in 0..=2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SlerpWeights {
    t: f32,
    /// (s - 1) / x, lowest power first.
    sum: [f32; TERMS],
    /// (w - t) / x.
    second: [f32; TERMS],
}

impl SlerpWeights {
    /// For time `t`: 0 is the first quaternion, 1 the second, beyond goes on turning.
    pub(super) fn at(t: f32) -> Self {
        let wide = f64::from(t);
        let sum = through_nodes(|x| {
            let half = x.sqrt().asin();
            (((2.0 * wide - 1.0) * half).cos() / half.cos() - 1.0) / x
        });
        let second = through_nodes(|x| {
            let half = x.sqrt().asin();
            ((2.0 * wide * half).sin() / (2.0 * half).sin() - wide) / x
        });
        Self { t, sum, second }
    }

    /// The quaternions at this time on the shortest arcs from `a` to `b`, both unit. Where they are equal, exactly `a`.
    #[inline(always)]
    pub(super) fn slerp<S: Simd>(&self, simd: S, a: [S::f32s; 4], b: [S::f32s; 4]) -> [S::f32s; 4] {
        let [ax, ay, az, aw] = a;
        let [bx, by, bz, bw] = b;
        let dot = aw.mul_add(bw, az.mul_add(bz, ay.mul_add(by, ax * bx)));
        // The other quaternion of b's rotation, -b, where it is nearer.
        let side = S::f32s::splat(simd, 1.0).copysign(dot);
        let (dx, dy) = (bx.mul_sub(side, ax), by.mul_sub(side, ay));
        let (dz, dw) = (bz.mul_sub(side, az), bw.mul_sub(side, aw));
        let x = dw.mul_add(dw, dz.mul_add(dz, dy.mul_add(dy, dx * dx))) * 0.25;
        let sum = polynomial(simd, &self.sum, x).mul_add(x, S::f32s::splat(simd, 1.0));
        let second = polynomial(simd, &self.second, x).mul_add(x, S::f32s::splat(simd, self.t));
        [
            second.mul_add(dx, sum * ax),
            second.mul_add(dy, sum * ay),
            second.mul_add(dz, sum * az),
            second.mul_add(dw, sum * aw),
        ]
    }
}

#[inline(always)]
fn polynomial<S: Simd>(simd: S, terms: &[f32; TERMS], x: S::f32s) -> S::f32s {
    let mut value = S::f32s::splat(simd, terms[TERMS - 1]);
    for term in terms[..TERMS - 1].iter().rev() {
        value = value.mul_add(x, S::f32s::splat(simd, *term));
    }
    value
}

/// The polynomial that meets `function` at Chebyshev's nodes in 0..=[`MOST_X`], lowest power first.
#[expect(
    clippy::cast_possible_truncation,
    reason = "vectors compute in single precision"
)]
fn through_nodes(function: impl Fn(f64) -> f64) -> [f32; TERMS] {
    let node = |k: usize| {
        let turn = std::f64::consts::PI * (k as f64 + 0.5) / TERMS as f64;
        0.5 * MOST_X * (1.0 - turn.cos())
    };
    let nodes: [f64; TERMS] = std::array::from_fn(node);
    // Newton's divided differences, then multiplied out.
    let mut differences = nodes.map(function);
    for order in 1..TERMS {
        for k in (order..TERMS).rev() {
            differences[k] = (differences[k] - differences[k - 1]) / (nodes[k] - nodes[k - order]);
        }
    }
    let mut powers = [0.0; TERMS];
    for k in (0..TERMS).rev() {
        for power in (1..TERMS).rev() {
            powers[power] = powers[power - 1] - nodes[k] * powers[power];
        }
        powers[0] = differences[k] - nodes[k] * powers[0];
    }
    powers.map(|power| power as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::levels;
    use fearless_simd::dispatch;
    use synthetic_person::Random;

    /// Slerp from the formula with sines, in f64: from `a` to `b` where `side` is 1, to -b where it is -1.
    fn reference(a: [f64; 4], b: [f64; 4], side: f64, t: f64) -> [f64; 4] {
        let b = b.map(|x| side * x);
        let apart = |sign: f64| {
            let squares = a.iter().zip(b).map(|(x, y)| (x + sign * y).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let angle = 2.0 * apart(-1.0).atan2(apart(1.0));
        let (first, second) = if angle < 1e-12 {
            (1.0 - t, t)
        } else {
            (
                ((1.0 - t) * angle).sin() / angle.sin(),
                (t * angle).sin() / angle.sin(),
            )
        };
        std::array::from_fn(|k| first * a[k] + second * b[k])
    }

    /// How far `got` is from Slerp on the shortest arc. Half a turn has two, and rounding may choose either.
    fn error(got: [f32; 4], a: [f32; 4], b: [f32; 4], t: f64) -> f64 {
        let unit = |q: [f32; 4]| {
            let q = q.map(f64::from);
            let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            q.map(|x| x / length)
        };
        let (a, b) = (unit(a), unit(b));
        let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
        let off = |side: f64| {
            let want = reference(a, b, side, t);
            let parts = got.iter().zip(want).map(|(x, y)| (f64::from(*x) - y).abs());
            parts.fold(0.0, f64::max)
        };
        if dot.abs() < 1e-6 {
            off(1.0).min(off(-1.0))
        } else {
            off(dot.signum())
        }
    }

    #[inline(always)]
    fn one<S: Simd>(simd: S, weights: &SlerpWeights, a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
        let splat = |q: [f32; 4]| q.map(|number| S::f32s::splat(simd, number));
        weights
            .slerp(simd, splat(a), splat(b))
            .map(|lanes| lanes[0])
    }

    fn unit(q: [f32; 4]) -> [f32; 4] {
        let length = q.iter().map(|x| x * x).sum::<f32>().sqrt();
        q.map(|x| x / length)
    }

    /// Pairs of quaternions: any, nearly equal, opposite in sign, a half turn apart.
    fn pairs() -> Vec<([f32; 4], [f32; 4])> {
        let mut random = Random::new(5);
        let mut any = || unit(std::array::from_fn(|_| random.normal()));
        let mut pairs = Vec::new();
        for _ in 0..2_000 {
            let (a, b) = (any(), any());
            let near = |by: f32| unit(std::array::from_fn(|k| a[k] + by * b[k]));
            pairs.extend([(a, b), (a, a), (a, a.map(|x| -x))]);
            pairs.extend([1e-7, 1e-5, 1e-3, 0.1].map(|by| (a, near(by))));
            pairs.extend([1e-7, 1e-3].map(|by| (a, near(by).map(|x| -x))));
            // Rotations half a turn apart: quaternions at right angles.
            let [x, y, z, w] = a;
            pairs.extend([(a, [-y, x, -w, z]), (a, [w, z, -y, -x])]);
        }
        pairs.push(([0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]));
        pairs
    }

    #[test]
    fn slerp_agrees_with_the_formula_to_a_millionth_at_any_angle_and_time() {
        let pairs = pairs();
        for t in [0.0, 0.25, 0.5, 0.731, 1.0, 1.5, 2.0] {
            let weights = SlerpWeights::at(t);
            for level in levels() {
                let mut worst = 0.0f64;
                for (a, b) in &pairs {
                    let got = dispatch!(level, simd => one(simd, &weights, *a, *b));
                    let error = error(got, *a, *b, f64::from(t));
                    assert!(
                        error < 2e-6,
                        "{a:?} to {b:?} at {t} gave {got:?}, {error} off"
                    );
                    worst = worst.max(error);
                }
                println!("t = {t}, {level:?}: {worst:.1e}");
            }
        }
    }

    #[test]
    fn equal_rotations_stay_equal_to_the_bit() {
        let mut random = Random::new(6);
        for t in [0.0, 0.3, 1.0, 1.7, 2.0] {
            let weights = SlerpWeights::at(t);
            for level in levels() {
                for _ in 0..200 {
                    let a = unit(std::array::from_fn(|_| random.normal()));
                    let got = dispatch!(level, simd => one(simd, &weights, a, a));
                    assert_eq!(got, a, "at {t}");
                }
            }
        }
    }
}
