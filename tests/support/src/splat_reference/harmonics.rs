//! Real spherical harmonics of degree 0 to 3 from their definition, not from a table of polynomials.
//!
//! Y(l, m) = N(l, |m|) P(l, |m|, cos theta) times sqrt(2) cos(m phi) for m > 0, sqrt(2) sin(|m| phi) for m < 0, and 1 for
//! m = 0, where P are the associated Legendre functions with the Condon-Shortley sign and
//! N(l, m) = sqrt((2 l + 1) / (4 pi) (l - m)! / (l + m)!). These are the signs that 3DGS has taken over.

use std::f64::consts::{PI, SQRT_2};

/// Functions of degree 0 to 3.
pub const ORDERS: usize = 16;

/// P(degree, order, z) by the usual recurrence: from (m, m) to (m + 1, m), then upwards in degree.
fn legendre(degree: u32, order: u32, z: f64) -> f64 {
    let sine = (1.0 - z * z).max(0.0).sqrt();
    let diagonal = |order: u32| -> f64 {
        (1..=order)
            .map(|k| -f64::from(2 * k - 1) * sine)
            .product::<f64>()
    };
    let (mut below, mut this) = (0.0, diagonal(order));
    for l in order + 1..=degree {
        let next = (z * f64::from(2 * l - 1) * this - f64::from(l + order - 1) * below)
            / f64::from(l - order);
        (below, this) = (this, next);
    }
    this
}

fn factorial(n: u32) -> f64 {
    (1..=n).map(f64::from).product()
}

/// All functions at a unit direction: degree by degree, m from -l to l within each.
pub fn real_harmonics([x, y, z]: [f64; 3]) -> [f64; ORDERS] {
    let phi = y.atan2(x);
    let mut values = [0.0; ORDERS];
    let orders = (0..4u32).flat_map(|l| (0..=2 * l).map(move |place| (l, place)));
    for (value, (l, place)) in values.iter_mut().zip(orders) {
        let m = place.abs_diff(l);
        let norm = (f64::from(2 * l + 1) / (4.0 * PI) * factorial(l - m) / factorial(l + m)).sqrt();
        let angle = f64::from(m) * phi;
        let around = match place.cmp(&l) {
            std::cmp::Ordering::Less => SQRT_2 * angle.sin(),
            std::cmp::Ordering::Equal => 1.0,
            std::cmp::Ordering::Greater => SQRT_2 * angle.cos(),
        };
        *value = norm * legendre(l, m, z) * around;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic_person::Random;

    #[test]
    fn the_definition_agrees_with_the_polynomials_that_scenes_document() {
        let mut random = Random::new(3);
        for _ in 0..200 {
            let direction = random.vector().normalize().as_dvec3().normalize();
            let direction = direction.to_array();
            let polynomials = splat_scene::sh_basis(direction);
            for (index, (a, b)) in real_harmonics(direction)
                .iter()
                .zip(polynomials)
                .enumerate()
            {
                assert!((a - b).abs() < 1e-12, "function {index}: {a} and {b}");
            }
        }
    }

    #[test]
    fn straight_up_only_the_functions_without_a_side_remain() {
        for (index, value) in real_harmonics([0.0, 0.0, 1.0]).iter().enumerate() {
            let has_no_side = [0, 2, 6, 12].contains(&index);
            assert_eq!(value.abs() > 1e-9, has_no_side, "function {index}: {value}");
        }
    }
}
