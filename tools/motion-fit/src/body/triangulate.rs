//! Landmarks in the room from several calibrated cameras: which cameras have left and right exchanged, and where the rays meet.

use super::reading::Exchange;
use super::terms::View;
use crate::landmarks::blazepose::{LOWER, mirrored};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks};
use nalgebra::{Matrix3, Vector2, Vector3};

/// Pixels at which a camera's weight is halved, at a focal length of 1000.
const DOUBTFUL: f64 = 12.0;
/// Rounds of reweighting: noise-free rays meet after two, mistaken ones have lost their weight after eight.
const ROUNDS: usize = 8;
/// Landmarks that are less sure say nothing.
const LEAST: f64 = 0.05;
/// Rays must cross at more than about two degrees: the least share of the normal equations' smallest direction.
const LEAST_CROSSING: f64 = 1e-3;
/// Left and right are exchanged where that brings landmarks nearer by this share, and they were off by more than so many standard deviations.
const CLEARLY: f64 = 0.6;
const OFF: f64 = 1.0;
/// So many cameras at most are tried in every labelling when nothing is expected yet.
const MOST_TRIED: usize = 6;

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

/// The point of the room that cameras saw at these pixels with these confidences (0: not at all): the least squares of the distances in the
/// pictures, reweighted (Cauchy) where a camera is far from the others. `None` where fewer than two cameras see it, or rays hardly cross.
#[must_use]
pub fn triangulate(views: &[View], seen: &[(Vector2<f64>, f64)]) -> Option<Located> {
    let mut weights: Vec<f64> = seen.iter().map(|(_, confidence)| *confidence).collect();
    if weights.iter().filter(|weight| **weight >= LEAST).count() < 2 {
        return None;
    }
    let mut depths = vec![1.0; views.len()];
    let mut place = Vector3::zeros();
    for _ in 0..ROUNDS {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (((view, (pixel, _)), weight), depth) in
            views.iter().zip(seen).zip(&weights).zip(&depths)
        {
            let ray = (pixel - view.centre) / view.focal;
            let rows = view.camera_from_world;
            for axis in 0..2 {
                // (row - ray * row of depth) * place + the same of the translation = 0; divided by the depth, slopes.
                let row = (rows.row(axis) - rows.row(2) * ray[axis]).transpose() / *depth;
                let known = (view.translation[axis] - view.translation.z * ray[axis]) / depth;
                normal += row * row.transpose() * *weight;
                right -= row * (known * weight);
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
        for (k, (view, (pixel, confidence))) in views.iter().zip(seen).enumerate() {
            let sight = view.camera_from_world * place + view.translation;
            depths[k] = sight.z.max(0.1);
            let off = sigmas(view, &(view.project(&place) - pixel));
            weights[k] = if *confidence >= LEAST && sight.z > 0.0 {
                confidence / (1.0 + off * off)
            } else {
                0.0
            };
        }
    }
    let mut agreeing = weights.clone();
    agreeing.sort_by(|a, b| b.total_cmp(a));
    let confidence = agreeing.get(1).copied().unwrap_or(0.0);
    (confidence >= LEAST).then_some(Located { place, confidence })
}

/// A distance in a picture against what is doubtful there.
fn sigmas(view: &View, off: &Vector2<f64>) -> f64 {
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

/// A landmark's pixel and confidence; confidence 0 where the camera saw no body.
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
    let point = seen.and_then(|seen| seen.points.get(from));
    point.map_or((Vector2::zeros(), 0.0), |point| {
        let pixel = Vector2::new(f64::from(point.pixel.x), f64::from(point.pixel.y));
        let confidence = f64::from(point.confidence);
        if pixel.iter().all(|v| v.is_finite()) && confidence.is_finite() {
            (pixel, confidence.clamp(0.0, 1.0))
        } else {
            (Vector2::zeros(), 0.0)
        }
    })
}

/// Which cameras have left and right exchanged: a network that mistakes them is as sure as ever. They are compared with where landmarks were a
/// frame before, where that is known, and then with each other.
pub(super) fn label(
    views: &[View],
    seen: &[Option<BodyLandmarks>],
    before: Option<&LocatedBody>,
) -> Vec<Exchange> {
    let mut exchanges = vec![Exchange::NONE; views.len()];
    match before {
        Some(before) => relabel(views, seen, before, &mut exchanges),
        None if views.len() <= MOST_TRIED => exchanges = tried(views, seen),
        None => {}
    }
    for _ in 0..4 {
        let was = exchanges.clone();
        let located = locate(views, seen, &exchanges);
        relabel(views, seen, &located, &mut exchanges);
        if was == exchanges {
            break;
        }
    }
    exchanges
}

/// The labelling in which the cameras agree best; of a labelling and its mirror image, the one that exchanges less.
fn tried(views: &[View], seen: &[Option<BodyLandmarks>]) -> Vec<Exchange> {
    let mut best = vec![Exchange::NONE; views.len()];
    for upper in [true, false] {
        let mut least = f64::INFINITY;
        let mut chosen = 0_u32;
        for mask in 0..1_u32 << views.len() {
            let set = |k: usize| mask >> k & 1 == 1;
            let labelled: Vec<Exchange> = (0..views.len())
                .map(|k| Exchange {
                    upper: upper && set(k),
                    lower: !upper && set(k),
                })
                .collect();
            let range = if upper {
                0..LOWER
            } else {
                LOWER..BODY_LANDMARKS
            };
            let mut off = 0.0;
            for landmark in range.filter(|landmark| mirrored(*landmark) != *landmark) {
                let pixels: Vec<(Vector2<f64>, f64)> = (seen.iter().zip(&labelled))
                    .map(|(seen, exchange)| pixel(seen.as_ref(), landmark, *exchange))
                    .collect();
                let place = triangulate(views, &pixels).map(|located| located.place);
                for (view, (pixel, confidence)) in views.iter().zip(&pixels) {
                    let squares = place.map_or(10.0, |place| {
                        sigmas(view, &(view.project(&place) - pixel)).powi(2)
                    });
                    off += confidence * squares.ln_1p();
                }
            }
            // An exchange must be worth something.
            let off = off * (1.0 + 0.02 * f64::from(mask.count_ones()));
            if off < least {
                (least, chosen) = (off, mask);
            }
        }
        for (k, exchange) in best.iter_mut().enumerate() {
            let set = chosen >> k & 1 == 1;
            if upper {
                exchange.upper = set;
            } else {
                exchange.lower = set;
            }
        }
    }
    best
}

/// Exchanges left and right of each camera's halves where that is clearly nearer to what is expected.
fn relabel(
    views: &[View],
    seen: &[Option<BodyLandmarks>],
    expected: &LocatedBody,
    exchanges: &mut [Exchange],
) {
    for ((view, seen), exchange) in views.iter().zip(seen).zip(exchanges) {
        let half = |range: std::ops::Range<usize>, now: bool| {
            let (mut own, mut other, mut weights) = (0.0, 0.0, 0.0);
            for landmark in range.filter(|landmark| mirrored(*landmark) != *landmark) {
                let Some(located) = &expected[landmark] else {
                    continue;
                };
                let at = view.project(&located.place);
                let off = |exchange| {
                    let (pixel, confidence) = pixel(seen.as_ref(), landmark, exchange);
                    (sigmas(view, &(at - pixel)).powi(2).ln_1p(), confidence)
                };
                let ((straight, a), (crossed, b)) = (off(Exchange::NONE), off(Exchange::BOTH));
                let weight = a.min(b) * located.confidence;
                own += weight * straight;
                other += weight * crossed;
                weights += weight;
            }
            if weights == 0.0 {
                return now;
            }
            let (own, other) = (own / weights, other / weights);
            let bad = OFF.ln_1p();
            if now {
                !(own < CLEARLY * other && other > bad)
            } else {
                other < CLEARLY * own && own > bad
            }
        };
        *exchange = Exchange {
            upper: half(0..LOWER, exchange.upper),
            lower: half(LOWER..BODY_LANDMARKS, exchange.lower),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::landmarks::BodyPoint;
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
    fn cameras_that_have_left_and_right_exchanged_are_told_from_the_others() {
        let views = views();
        let places: [Vector3<f64>; BODY_LANDMARKS] = std::array::from_fn(|k| {
            let side = if k == 0 {
                0.0
            } else if mirrored(k) > k {
                0.2
            } else {
                -0.2
            };
            let pair = k.min(mirrored(k));
            let height = f64::from(u8::try_from(pair).expect("small")) * 0.05;
            Vector3::new(side, 1.6 - height, 0.1 * side)
        });
        let wrong = |camera: usize, landmark: usize| camera == 1 && landmark >= LOWER;
        let seen: Vec<Option<BodyLandmarks>> = (views.iter().enumerate())
            .map(|(camera, view)| {
                let mut body = BodyLandmarks {
                    points: [BodyPoint::default(); BODY_LANDMARKS],
                };
                for (k, point) in body.points.iter_mut().enumerate() {
                    let from = if wrong(camera, k) { mirrored(k) } else { k };
                    let pixel = view.project(&places[from]);
                    #[expect(clippy::cast_possible_truncation, reason = "pixels are f32")]
                    let pixel = glam::Vec2::new(pixel.x as f32, pixel.y as f32);
                    (point.pixel, point.confidence) = (pixel, 0.9);
                }
                Some(body)
            })
            .collect();
        let exchanges = label(&views, &seen, None);
        let expected: Vec<Exchange> = (0..views.len())
            .map(|camera| Exchange {
                upper: false,
                lower: camera == 1,
            })
            .collect();
        assert_eq!(exchanges, expected, "only the second camera's legs");
        let located = locate(&views, &seen, &exchanges);
        for (located, place) in located.iter().zip(&places) {
            let off = (located.expect("seen by four").place - place).norm();
            assert!(off < 1e-4, "{off}");
        }
    }
}
