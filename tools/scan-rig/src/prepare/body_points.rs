//! A body's landmarks in space from what a network saw in several views.

use super::landmarks::{GROUPS, mirrored};
use super::triangulate::{Ray, robust_cost, triangulate};
use crate::pinhole::Pinhole;
use crate::points::KeyPoint;
use glam::DVec2;
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks};

/// What a network saw of the body in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// The view.
    pub view: Pinhole,
    /// The landmarks in the view's pixels.
    pub seen: BodyLandmarks,
}

/// The body's landmarks in space.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyPoints {
    /// The landmarks; those that no two views show have no support.
    pub points: [KeyPoint; BODY_LANDMARKS],
    /// In how many views left and right of head, arms or legs were exchanged, since the other views say so.
    pub exchanged: usize,
}

/// Rounds of the vote on left and right.
const VOTES: usize = 5;
/// The sides of a group are exchanged in a view if that lowers its cost to this share.
const CLEARLY: f64 = 0.7;

/// Triangulates what was seen; a ray counts by the square of its visibility, and up to a distance of about `reach` metres.
///
/// A network that sees a person from behind may take the left side for the right one: a view in which head, arms or legs agree better
/// with the other views once their sides are exchanged has them exchanged.
#[must_use]
pub fn body_points(sightings: &[Sighting], reach: f64) -> BodyPoints {
    let mut swaps = vec![[false; GROUPS.len()]; sightings.len()];
    let mut points = all(sightings, &swaps, reach);
    for _ in 0..VOTES {
        let mut changed = false;
        for (sighting, swaps) in sightings.iter().zip(&mut swaps) {
            for (group, swap) in GROUPS.iter().zip(swaps) {
                let now = cost(sighting, group, *swap, &points, reach);
                let other = cost(sighting, group, !*swap, &points, reach);
                if other < CLEARLY * now {
                    *swap = !*swap;
                    changed = true;
                }
            }
        }
        if !changed {
            break;
        }
        points = all(sightings, &swaps, reach);
    }
    BodyPoints {
        points,
        exchanged: swaps.iter().filter(|swaps| swaps.contains(&true)).count(),
    }
}

/// Where the landmark is in the picture and how much that counts.
fn observed(sighting: &Sighting, landmark: usize, swap: bool) -> (DVec2, f64) {
    let at = if swap { mirrored(landmark) } else { landmark };
    let point = &sighting.seen.points[at];
    let weight = f64::from(point.confidence.clamp(0.0, 1.0)).powi(2) + 1e-4;
    (point.pixel.as_dvec2(), weight)
}

fn all(
    sightings: &[Sighting],
    swaps: &[[bool; GROUPS.len()]],
    reach: f64,
) -> [KeyPoint; BODY_LANDMARKS] {
    std::array::from_fn(|landmark| {
        let group = GROUPS.iter().position(|group| group.contains(&landmark));
        let rays: Vec<Ray> = sightings
            .iter()
            .zip(swaps)
            .map(|(sighting, swaps)| {
                let swap = group.is_some_and(|group| swaps[group]);
                let (pixel, weight) = observed(sighting, landmark, swap);
                Ray::new(&sighting.view, pixel, weight)
            })
            .collect();
        triangulate(&rays, reach).unwrap_or_default()
    })
}

/// How badly a view agrees with points in space.
fn cost(
    sighting: &Sighting,
    group: &[usize],
    swap: bool,
    points: &[KeyPoint; BODY_LANDMARKS],
    reach: f64,
) -> f64 {
    let costs = group.iter().map(|landmark| {
        let (pixel, weight) = observed(sighting, *landmark, swap);
        let distance = Ray::new(&sighting.view, pixel, weight).distance(points[*landmark].position);
        weight * robust_cost(distance, 3.0 * reach)
    });
    costs.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use motion_fit::landmarks::BodyPoint;

    /// A figure whose sides differ, seen by 12 views with a little noise.
    fn sightings(random: &mut fastrand::Rng) -> (Vec<DVec3>, Vec<Sighting>) {
        let truth: Vec<DVec3> = (0..BODY_LANDMARKS)
            .map(|_| {
                DVec3::new(
                    random.f64() - 0.5,
                    1.7 * random.f64(),
                    0.6 * random.f64() - 0.3,
                )
            })
            .collect();
        let sightings = (0..12)
            .map(|index| {
                let angle = f64::from(index) / 12.0 * std::f64::consts::TAU;
                let eye = DVec3::new(3.2 * angle.sin(), 1.1, 3.2 * angle.cos());
                let view =
                    Pinhole::look_at(eye, DVec3::new(0.0, 0.9, 0.0), DVec3::Y, 1400.0, 640, 900);
                let points = std::array::from_fn(|landmark| {
                    let noise = DVec2::new(random.f64() - 0.5, random.f64() - 0.5) * 8.0;
                    let pixel = view.project(truth[landmark]).unwrap_or_default() + noise;
                    BodyPoint {
                        pixel: pixel.as_vec2(),
                        confidence: 0.5 + 0.5 * random.f32(),
                        ..BodyPoint::default()
                    }
                });
                Sighting {
                    view,
                    seen: BodyLandmarks { points },
                }
            })
            .collect();
        (truth, sightings)
    }

    #[test]
    fn views_that_take_left_for_right_are_exchanged_and_change_nothing() {
        let mut random = fastrand::Rng::with_seed(11);
        let (truth, mut sightings) = sightings(&mut random);
        // The whole body in two views, the legs alone in a third, the head alone in a fourth.
        for (view, groups) in [
            (5, &GROUPS[..]),
            (6, &GROUPS[..]),
            (7, &GROUPS[2..]),
            (8, &GROUPS[..1]),
        ] {
            let before = sightings[view].seen.clone();
            for landmark in groups.concat() {
                sightings[view].seen.points[landmark] = before.points[mirrored(landmark)];
            }
        }
        let found = body_points(&sightings, 0.03);
        assert_eq!(found.exchanged, 4, "views with exchanged sides");
        for (landmark, (point, truth)) in found.points.iter().zip(&truth).enumerate() {
            let apart = (point.position - *truth).length();
            assert!(
                apart < 0.01 && point.residual < 0.02,
                "landmark {landmark}: {apart} m, {point:?}"
            );
        }
    }

    #[test]
    fn a_body_that_no_view_shows_has_no_support() {
        let found = body_points(&[], 0.03);
        assert!(
            found.points.iter().all(|point| point.support == 0.0),
            "{found:?}"
        );
    }
}
