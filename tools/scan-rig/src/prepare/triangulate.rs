//! A point from the rays of several views, some of which are wrong.

use crate::pinhole::Pinhole;
use crate::points::KeyPoint;
use glam::{DMat3, DVec2, DVec3};

/// A line of sight to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it begins, metres.
    pub eye: DVec3,
    /// Its unit direction.
    pub along: DVec3,
    /// How much it counts, 0 or more.
    pub weight: f64,
}

impl Ray {
    /// Through a pixel of a view.
    #[must_use]
    pub fn new(view: &Pinhole, pixel: DVec2, weight: f64) -> Self {
        Self {
            eye: view.eye,
            along: view.ray(pixel),
            weight,
        }
    }

    /// Distance of a point from the line, metres.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        (point - self.eye)
            .reject_from_normalized(self.along)
            .length()
    }
}

/// Geman and McClure's cost of a distance, 0..1.
#[must_use]
pub fn robust_cost(distance: f64, reach: f64) -> f64 {
    let share = (distance / reach).powi(2);
    share / (1.0 + share)
}

/// Rounds of reweighting.
const ROUNDS: usize = 15;
/// Rays whose directions span less than this (a pair's squared sine) determine no point.
const LEAST_PARALLAX: f64 = 0.01;

/// The point that most of the rays, by weight, pass within `reach` metres or so (Geman and McClure's estimator); nothing if no two of
/// the rays count and cross.
///
/// It starts from the pair of rays whose crossing all rays agree with best, so that also half of them may be wrong if they do not agree
/// with one another.
#[must_use]
pub fn triangulate(rays: &[Ray], reach: f64) -> Option<KeyPoint> {
    let counts = |ray: &Ray| ray.weight > 0.0 && ray.eye.is_finite() && ray.along.is_finite();
    let rays: Vec<Ray> = rays.iter().copied().filter(counts).collect();
    let cost = |point: DVec3| -> f64 {
        let costs = rays
            .iter()
            .map(|ray| ray.weight * robust_cost(ray.distance(point), reach));
        costs.sum()
    };
    let mut best: Option<(f64, DVec3)> = None;
    for (index, first) in rays.iter().enumerate() {
        for second in &rays[index + 1..] {
            if first.along.cross(second.along).length_squared() < LEAST_PARALLAX {
                continue;
            }
            let pair = [(*first, 1.0), (*second, 1.0)];
            if let Some(point) = nearest(pair)
                && let cost = cost(point)
                && best.is_none_or(|(least, _)| cost < least)
            {
                best = Some((cost, point));
            }
        }
    }
    let mut point = best?.1;
    let weight = |ray: &Ray, point: DVec3| {
        ray.weight / (1.0 + (ray.distance(point) / reach).powi(2)).powi(2)
    };
    for _ in 0..ROUNDS {
        point = nearest(rays.iter().map(|ray| (*ray, weight(ray, point))))?;
    }
    let (mut sum, mut squares, mut support) = (0.0, 0.0, 0.0);
    for ray in &rays {
        let weight = weight(ray, point);
        sum += weight;
        squares += weight * ray.distance(point).powi(2);
        support += weight;
    }
    let key = KeyPoint {
        position: point,
        residual: (squares / sum).sqrt(),
        support,
    };
    (key.position.is_finite() && key.residual.is_finite()).then_some(key)
}

/// The point with the least weighted sum of squared distances from lines; nothing where they do not determine one.
fn nearest(rays: impl IntoIterator<Item = (Ray, f64)>) -> Option<DVec3> {
    let (mut normal, mut right, mut total) = (DMat3::ZERO, DVec3::ZERO, 0.0);
    for (ray, weight) in rays {
        let along = ray.along;
        let across =
            DMat3::IDENTITY - DMat3::from_cols(along * along.x, along * along.y, along * along.z);
        normal += across * weight;
        right += across * ray.eye * weight;
        total += weight;
    }
    if total <= 0.0 {
        return None;
    }
    let normal = normal * (1.0 / total);
    (normal.determinant().abs() > 1e-9).then(|| normal.inverse() * (right * (1.0 / total)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views(count: u32) -> Vec<Pinhole> {
        (0..count)
            .map(|index| {
                let angle = f64::from(index) / f64::from(count) * std::f64::consts::TAU;
                let eye = DVec3::new(3.2 * angle.sin(), 1.1, 3.2 * angle.cos());
                Pinhole::look_at(eye, DVec3::new(0.0, 0.9, 0.0), DVec3::Y, 1400.0, 640, 900)
            })
            .collect()
    }

    #[test]
    fn exact_rays_meet_in_their_point() {
        let truth = DVec3::new(0.21, 1.43, -0.08);
        let rays: Vec<Ray> = (views(12).iter())
            .map(|view| Ray::new(view, view.project(truth).unwrap_or_default(), 0.8))
            .collect();
        let found = triangulate(&rays, 0.03).unwrap_or_default();
        assert!((found.position - truth).length() < 1e-9, "{found:?}");
        assert!(
            found.residual < 1e-9 && (found.support - 12.0 * 0.8).abs() < 1e-6,
            "{found:?}"
        );
    }

    #[test]
    fn wrong_rays_do_not_count_while_they_are_the_minority_and_disagree() {
        let truth = DVec3::new(-0.3, 0.5, 0.1);
        let mut random = fastrand::Rng::with_seed(5);
        for wrong in [1, 3, 5] {
            let rays: Vec<Ray> = (views(12).iter().enumerate())
                .map(|(index, view)| {
                    let mut pixel = view.project(truth).unwrap_or_default();
                    if index * 5 % 12 < wrong {
                        pixel += DVec2::from_angle(random.f64() * std::f64::consts::TAU) * 150.0;
                    } else {
                        pixel += DVec2::new(random.f64() - 0.5, random.f64() - 0.5) * 6.0;
                    }
                    Ray::new(view, pixel, 0.9)
                })
                .collect();
            let found = triangulate(&rays, 0.03).unwrap_or_default();
            let apart = (found.position - truth).length();
            assert!(apart < 0.006, "{wrong} wrong rays: {apart} m");
            assert!(found.residual < 0.03, "{wrong} wrong rays: {found:?}");
        }
    }

    #[test]
    fn rays_that_determine_no_point_give_none() {
        let [first, ..] = views(12)[..] else { return };
        let ray = Ray::new(&first, DVec2::new(300.0, 400.0), 1.0);
        assert!(triangulate(&[], 0.03).is_none(), "no ray");
        assert!(triangulate(&[ray], 0.03).is_none(), "one ray");
        assert!(
            triangulate(&[ray, ray], 0.03).is_none(),
            "the same ray twice"
        );
        let none = Ray {
            along: DVec3::NAN,
            ..ray
        };
        assert!(
            triangulate(&[none, none, ray], 0.03).is_none(),
            "no numbers"
        );
        let nothing = Ray { weight: 0.0, ..ray };
        assert!(triangulate(&[nothing, ray], 0.03).is_none(), "no weight");
    }
}
