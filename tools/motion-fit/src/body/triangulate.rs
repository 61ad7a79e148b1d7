//! Landmarks in the room from several calibrated cameras: where their rays meet.

use super::reading::{Exchange, UNSEEN, sure_pixel};
use super::terms::View;
use crate::landmarks::blazepose::{LOWER, mirrored};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks};
use nalgebra::{Matrix3, Vector2, Vector3};

/// Pixels at which a camera's weight is halved, at a focal length of 1000.
const DOUBTFUL: f64 = 12.0;
/// Rounds of reweighting: noise-free rays meet after two, mistaken ones have lost their weight after eight.
const ROUNDS: usize = 8;
/// A camera whose weight is less after that does not agree.
const AGREEING: f64 = 0.05;
/// Rays must cross at more than about two degrees: the least share of the normal equations' smallest direction.
const LEAST_CROSSING: f64 = 1e-3;

/// A landmark in the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Located {
    /// Metres.
    pub place: Vector3<f64>,
    /// Confidence of the second surest camera that agrees, 0..=1.
    pub confidence: f64,
}

/// All landmarks of a frame, those that two cameras agree on.
pub type LocatedBody = [Option<Located>; BODY_LANDMARKS];

/// A camera that sees a landmark.
struct Ray<'a> {
    view: &'a View,
    pixel: Vector2<f64>,
    confidence: f64,
    /// What it counts, and the depth at which it sees the point, metres.
    weight: f64,
    depth: f64,
}

/// The point of the room that cameras saw at these pixels with these confidences (below 0.1: not at all): the least squares of the distances in the
/// pictures, reweighted (Cauchy) where a camera is far from the others. `None` where fewer than two cameras see it, or rays hardly cross. A pixel
/// that has no view, a view that has no pixel, and a number that is not finite count as not seen.
#[must_use]
pub fn triangulate(views: &[View], seen: &[(Vector2<f64>, f64)]) -> Option<Located> {
    let mut rays: Vec<Ray<'_>> = (views.iter().zip(seen))
        .filter(|(_, (pixel, confidence))| {
            *confidence >= UNSEEN && pixel.iter().all(|v| v.is_finite())
        })
        .map(|(view, (pixel, confidence))| Ray {
            view,
            pixel: *pixel,
            confidence: confidence.min(1.0),
            weight: confidence.min(1.0),
            depth: 1.0,
        })
        .collect();
    if rays.len() < 2 {
        return None;
    }
    let mut place = Vector3::zeros();
    for _ in 0..ROUNDS {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for ray in &rays {
            let (view, rows) = (ray.view, ray.view.camera_from_world);
            let slopes = (ray.pixel - view.centre) / view.focal;
            for axis in 0..2 {
                // (row - slope * row of depth) * place + the same of the translation = 0; divided by the depth, slopes.
                let row = (rows.row(axis) - rows.row(2) * slopes[axis]).transpose() / ray.depth;
                let known =
                    (view.translation[axis] - view.translation.z * slopes[axis]) / ray.depth;
                normal += row * row.transpose() * ray.weight;
                right -= row * (known * ray.weight);
            }
        }
        let eigen = normal.symmetric_eigenvalues();
        let crossing = eigen.min() / eigen.max();
        if crossing.is_nan() || crossing <= LEAST_CROSSING {
            return None;
        }
        place = normal.cholesky()?.solve(&right);
        if !place.iter().all(|v: &f64| v.is_finite()) {
            return None;
        }
        for ray in &mut rays {
            let sight = ray.view.camera_from_world * place + ray.view.translation;
            ray.depth = sight.z.max(0.1);
            let off = sigmas(ray.view, &(ray.view.project(&place) - ray.pixel));
            ray.weight = if sight.z > 0.0 {
                ray.confidence / (1.0 + off * off)
            } else {
                0.0
            };
        }
    }
    rays.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let confidence = rays.get(1)?.weight;
    (confidence >= AGREEING).then_some(Located { place, confidence })
}

/// A distance in a picture against what is doubtful there.
pub(super) fn sigmas(view: &View, off: &Vector2<f64>) -> f64 {
    off.norm() / (DOUBTFUL * view.focal / 1000.0)
}

/// Locates every landmark, cameras' labels exchanged as said.
pub(super) fn locate(
    views: &[View],
    seen: &[Option<BodyLandmarks>],
    exchanges: &[Exchange],
) -> LocatedBody {
    std::array::from_fn(|landmark| {
        let pixels: Vec<(Vector2<f64>, f64)> = (seen.iter().zip(exchanges))
            .map(|(seen, exchange)| pixel(seen.as_ref(), landmark, *exchange))
            .collect();
        triangulate(views, &pixels)
    })
}

/// A landmark's pixel and confidence; confidence 0 where the camera did not see it.
pub(super) fn pixel(
    seen: Option<&BodyLandmarks>,
    landmark: usize,
    exchange: Exchange,
) -> (Vector2<f64>, f64) {
    let swapped = if landmark < LOWER {
        exchange.upper
    } else {
        exchange.lower
    };
    let from = if swapped {
        mirrored(landmark)
    } else {
        landmark
    };
    (seen.and_then(|seen| seen.points.get(from)))
        .and_then(sure_pixel)
        .unwrap_or((Vector2::zeros(), 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn views() -> Vec<View> {
        [0.0, 1.4, 2.9, 4.4]
            .map(|angle: f64| View {
                camera_from_world: (Rotation3::from_axis_angle(&Vector3::x_axis(), 0.1)
                    * Rotation3::from_axis_angle(&Vector3::y_axis(), angle))
                .into_inner(),
                translation: Vector3::new(0.1, 0.2, 4.0),
                focal: 900.0,
                centre: Vector2::new(540.0, 960.0),
            })
            .to_vec()
    }

    #[test]
    fn a_point_that_cameras_see_is_found_again() {
        let point = Vector3::new(0.2, 1.1, -0.3);
        let views = views();
        let mut seen: Vec<_> = views.iter().map(|v| (v.project(&point), 1.0)).collect();
        let found = triangulate(&views, &seen).expect("a point");
        assert!((found.place - point).norm() < 1e-9, "{}", found.place);
        // One camera that is sure of another place hardly moves it.
        seen[2].0 += Vector2::new(200.0, -150.0);
        let found = triangulate(&views, &seen).expect("a point");
        assert!((found.place - point).norm() < 2e-3, "{}", found.place);
        assert!(
            triangulate(&views[..1], &seen[..1]).is_none(),
            "one ray has no end"
        );
        assert!(
            triangulate(&[views[0]; 2], &[seen[0]; 2]).is_none(),
            "nor have two that are the same"
        );
    }

    #[test]
    fn what_has_no_partner_or_is_no_number_is_not_seen() {
        let point = Vector3::new(0.2, 1.1, -0.3);
        let views = views();
        let seen: Vec<_> = views.iter().map(|v| (v.project(&point), 1.0)).collect();
        let alone = [&views[..1], &views[..0]].map(|views| triangulate(views, &seen));
        assert_eq!(alone, [None, None], "pixels without views");
        assert_eq!(
            triangulate(&views, &seen[..1]),
            None,
            "views without pixels"
        );
        assert_eq!(
            triangulate(&views[..3], &seen),
            triangulate(&views[..3], &seen[..3]),
            "a pixel too many"
        );
        for bad in [f64::NAN, f64::INFINITY] {
            let mut seen = seen.clone();
            seen[0].0.x = bad;
            seen[1].1 = -bad;
            let found = triangulate(&views, &seen).expect("the two others");
            assert!((found.place - point).norm() < 1e-9, "{}", found.place);
        }
    }
}
