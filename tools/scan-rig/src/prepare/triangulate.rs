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
