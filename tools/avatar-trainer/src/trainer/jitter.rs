//! Small random changes of what networks see of a pose: with the few poses of a capture, they would learn each by heart.

use crate::random::{mixed, normal};

/// Of what a seed decides.
const JITTER: u64 = u64::MAX - 3;

/// Draws the change of a step, a function of the seed and the step's number: each parameter's has a standard deviation of `share` times its spread. Nothing of
/// no share.
pub(super) fn draw((seed, step): (u64, u64), share: f32, spread: &[f32], into: &mut Vec<f32>) {
    into.clear();
    if share > 0.0 {
        let mut rng = fastrand::Rng::with_seed(mixed(mixed(seed, JITTER), step));
        let changes = spread
            .iter()
            .map(|spread| share * spread * normal(&mut rng));
        into.extend(changes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_as_large_as_asked_for_and_differ_from_step_to_step() {
        let spread: Vec<f32> = (0..4000u16).map(|k| 0.1 + f32::from(k % 2)).collect();
        let of = |step| {
            let mut drawn = vec![9.0];
            draw((7, step), 0.5, &spread, &mut drawn);
            drawn
        };
        let (first, second) = (of(1), of(2));
        assert_eq!(first, of(1), "a function of seed and step");
        assert_eq!(first.len(), spread.len(), "one for each parameter");
        for (parity, wanted) in [(0, 0.05), (1, 0.55)] {
            let of_spread = |drawn: &[f32]| -> Vec<f64> {
                let all = drawn.iter().skip(parity).step_by(2);
                all.map(|x| f64::from(*x)).collect()
            };
            let (a, b) = (of_spread(&first), of_spread(&second));
            let dot = |a: &[f64], b: &[f64]| -> f64 {
                a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len() as f64
            };
            let deviation = dot(&a, &a).sqrt();
            assert!((deviation / wanted - 1.0).abs() < 0.06, "{deviation}");
            assert!(dot(&a, &b).abs() < 0.08 * wanted * wanted, "independent");
        }
        let mut none = vec![1.0];
        draw((7, 1), 0.0, &spread, &mut none);
        assert!(none.is_empty(), "no share");
    }
}
