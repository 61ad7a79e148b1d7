//! What a network sees of the body from all around.

use super::body_points::{BodyPoints, Sighting, body_points};
use super::networks::Networks;
use super::views::Subject;
use crate::RigError;
use crate::scan::Scan;
use crate::sight::Sight;
use glam::DVec3;

/// Gaussians that are drawn at most, for networks that see 256 pixels.
pub(super) const MOST_DRAWN: usize = 500_000;
/// What lies behind the scan in pictures.
pub(super) const BEHIND: [f32; 3] = [0.75; 3];
/// A ray that passes farther than about this from a landmark does not count, metres.
const REACH: f64 = 0.03;

/// The upright cylinder about a scan.
pub(super) fn subject(scan: &Scan, up: DVec3) -> Subject {
    let step = scan.len().div_ceil(20_000).max(1);
    let points: Vec<DVec3> = (scan.positions.iter().zip(&scan.opacities))
        .filter(|(_, opacity)| **opacity > 0.1)
        .map(|(point, _)| point.as_dvec3())
        .step_by(step)
        .collect();
    let ends = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let cut = values.len() / 500;
        let get = |at: usize| values.get(at).copied().unwrap_or_default();
        (get(cut), get(values.len().saturating_sub(1 + cut)))
    };
    let first = up.any_orthonormal_vector();
    let second = up.cross(first);
    let [(a, b), (c, d), (low, high)] = [first, second, up]
        .map(|axis| ends(&mut points.iter().map(|point| point.dot(axis)).collect()));
    let middle = first * ((a + b) / 2.0) + second * ((c + d) / 2.0) + up * ((low + high) / 2.0);
    let mut away = points
        .iter()
        .map(|point| (*point - middle).reject_from(up).length())
        .collect();
    Subject {
        middle,
        up,
        height: (high - low).max(0.1),
        radius: ends(&mut away).1.max(0.1),
    }
}

/// The body's landmarks from views all around, in how many of them it was seen, and in how many there are several people. `sight` shows
/// the scan.
pub(super) fn look_around(
    scan: &Scan,
    up: DVec3,
    front: DVec3,
    (views, share): (u32, f64),
    sight: &mut Sight,
    networks: &mut Networks,
) -> Result<(BodyPoints, usize, usize), RigError> {
    let (mut sightings, mut crowded) = (Vec::new(), 0);
    for view in subject(scan, up).around(views, front, share) {
        let picture = sight.picture(&view, BEHIND)?;
        if let Some(seen) = networks.body(&picture)? {
            sightings.push(Sighting { view, seen });
        }
        crowded += usize::from(networks.people() > 1);
    }
    Ok((body_points(&sightings, REACH), sightings.len(), crowded))
}
