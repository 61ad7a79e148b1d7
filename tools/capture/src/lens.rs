//! The distortion of lenses after Brown and Conrady, as OpenCV has it: k1, k2, p1, p2, k3 on slopes (x / z, y / z).

use glam::{DMat2, DVec2};

/// OpenCV's k1, k2, p1, p2, k3.
pub(crate) type Distortion = [f64; 5];

/// Where a ray of slopes `at` seems to come from; `None` beyond the radius at which the radial polynomial stops growing: its model has no
/// meaning there, and would fold the ray back into the picture.
pub(crate) fn distort(distortion: &Distortion, at: DVec2) -> Option<DVec2> {
    let r2 = at.length_squared();
    grows_up_to(distortion, r2).then(|| bend(distortion, at).0)
}

/// The slopes of the ray that seems to come from `seen`: the inverse of [`distort`], by Newton's method.
pub(crate) fn undistort(distortion: &Distortion, seen: DVec2) -> Option<DVec2> {
    const STEPS: usize = 30;
    /// Of slopes: a ten-thousandth of a pixel of any lens.
    const NEAR: f64 = 1e-9;
    if *distortion == [0.0; 5] {
        return Some(seen);
    }
    let mut at = seen;
    for _ in 0..STEPS {
        let (bent, derivative) = bend(distortion, at);
        let away = bent - seen;
        if away.length_squared() < NEAR * NEAR {
            return grows_up_to(distortion, at.length_squared()).then_some(at);
        }
        let step = derivative.inverse() * away;
        // A strong lens' Newton step may overshoot the fold: it is held to half the way out.
        let most = 0.5 * (at.length() + 0.1);
        at -= step.clamp_length_max(most);
        if !at.is_finite() {
            return None;
        }
    }
    None
}

/// The bent slopes and their derivatives by the straight ones.
fn bend(&[k1, k2, p1, p2, k3]: &Distortion, at: DVec2) -> (DVec2, DMat2) {
    let (x, y, r2) = (at.x, at.y, at.length_squared());
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    // Of the radial factor by r2.
    let slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    let bent = DVec2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    );
    let across = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
    let derivative = DMat2::from_cols(
        DVec2::new(
            radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            across,
        ),
        DVec2::new(
            across,
            radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
        ),
    );
    (bent, derivative)
}

/// Whether r * (1 + k1 r^2 + k2 r^4 + k3 r^6) grows all the way from the axis to a squared radius: its derivative, a cubic of the squared
/// radius, is positive at the end and at its extrema before.
fn grows_up_to(&[k1, k2, _, _, k3]: &Distortion, r2: f64) -> bool {
    let derivative = |s: f64| 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3));
    // The extrema: 3 k1 + 10 k2 s + 21 k3 s^2 = 0, by the formula that does not cancel.
    let (a, b, c) = (21.0 * k3, 10.0 * k2, 3.0 * k1);
    let under = b * b - 4.0 * a * c;
    let extrema = if under >= 0.0 {
        let q = -0.5 * (b + under.sqrt().copysign(b));
        [q / a, c / q]
    } else {
        [f64::NAN; 2]
    };
    // Outside the stretch or no number: not asked.
    (extrema.into_iter().filter(|s| *s > 0.0 && *s < r2))
        .chain([r2])
        .all(|s| derivative(s) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LENS: Distortion = [-0.28, 0.09, 0.0008, -0.0011, -0.012];

    #[test]
    fn a_ray_beyond_the_fold_is_seen_nowhere() {
        let barrel = [-0.5, 0.0, 0.0, 0.0, 0.0];
        // 1 - 1.5 r^2 is zero at r = 0.816.
        assert!(
            distort(&barrel, DVec2::new(0.81, 0.0)).is_some(),
            "before the fold"
        );
        assert!(
            distort(&barrel, DVec2::new(0.82, 0.0)).is_none(),
            "after it"
        );
        let again = [-1.0, 0.3, 0.0, 0.0, 0.0];
        // It grows again from r^2 = 1.54 on, but had folded before.
        assert!(
            distort(&again, DVec2::new(1.5, 0.0)).is_none(),
            "after the second turn"
        );
    }

    #[test]
    fn what_no_ray_can_be_bent_to_has_no_slopes() {
        let barrel = [-0.5, 0.0, 0.0, 0.0, 0.0];
        // The largest bent radius is 0.544.
        assert!(
            undistort(&barrel, DVec2::new(0.6, 0.0)).is_none(),
            "beyond the lens"
        );
    }

    proptest! {
        #[test]
        fn undistorting_inverts_distorting(x in -0.8..0.8, y in -0.8..0.8) {
            let straight = DVec2::new(x, y);
            let bent = distort(&LENS, straight).expect("within the lens");
            let back = undistort(&LENS, bent).expect("an inverse");
            prop_assert!(back.distance(straight) < 1e-8, "{back} for {straight}");
        }
    }
}
