//! The point of a triangle that is closest to a place.

use glam::Vec3;

/// Shares of a triangle's corners in its point that is closest to `at` (Ericson, Real-Time Collision Detection, 5.1.5). They are numbers from 0
/// to 1 and sum to 1 also where the triangle has no area.
#[must_use]
pub fn shares_of_closest(at: Vec3, [a, b, c]: [Vec3; 3]) -> [f32; 3] {
    let (ab, ac) = (b - a, c - a);
    let dots = |from: Vec3| (ab.dot(at - from), ac.dot(at - from));
    let ((d1, d2), (d3, d4), (d5, d6)) = (dots(a), dots(b), dots(c));
    let share = |part: f32, rest: f32| {
        let whole = part + rest;
        if whole > 0.0 {
            (part / whole).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let of_c = d1 * d4 - d3 * d2;
    if of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let share = share(d1, -d3);
        return [1.0 - share, share, 0.0];
    }
    let of_b = d5 * d2 - d1 * d6;
    if of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let share = share(d2, -d6);
        return [1.0 - share, 0.0, share];
    }
    let of_a = d3 * d6 - d5 * d4;
    if of_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        let share = share(d4 - d3, d5 - d6);
        return [0.0, 1.0 - share, share];
    }
    let sum = of_a + of_b + of_c;
    if sum > 0.0 {
        [1.0 - of_b / sum - of_c / sum, of_b / sum, of_c / sum]
    } else {
        [1.0, 0.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_without_area_has_a_closest_point() {
        let [a, b] = [Vec3::ZERO, Vec3::X];
        for corners in [
            [a, a, a],
            [a, a, b],
            [a, b, a],
            [b, a, a],
            [a, b, a.lerp(b, 0.5)],
        ] {
            for at in [Vec3::new(0.3, 0.4, 0.0), Vec3::new(-1.0, 0.0, 2.0), b] {
                let shares = shares_of_closest(at, corners);
                let sum: f32 = shares.iter().sum();
                let bounded = shares.iter().all(|s| (0.0..=1.0).contains(s));
                assert!(bounded && (sum - 1.0).abs() < 1e-5, "{shares:?}");
            }
        }
    }
}
