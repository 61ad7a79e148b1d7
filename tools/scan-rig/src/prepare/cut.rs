//! Cuts what may be a person out of a scan: floors and walls taken off, the rest divided into what hangs together.

use super::clusters::clusters;
use super::plane::{Plane, find_plane};
use super::sample::Sample;
use crate::scan::Scan;
use glam::Vec3;
use rayon::prelude::*;

/// Gaussians that are looked at: of more, evenly spread ones.
const MOST_LOOKED_AT: usize = 250_000;
/// Planes that are taken off at most: a floor, a ceiling, four walls.
const MOST_PLANES: usize = 6;
/// A cluster with less than this share of the largest one's cells is no second person.
const LEAST_SHARE: f64 = 0.2;
/// Clusters that are handed on at most.
const MOST_CLUSTERS: usize = 4;

/// What hangs together in a scan, apart from floors and walls.
#[derive(Debug, Clone)]
pub struct Cut {
    /// For each Gaussian of the scan, whether it belongs to this.
    pub keep: Vec<bool>,
    /// Opposite corners of its box, in the scan's units.
    pub low: Vec3,
    /// The other corner.
    pub high: Vec3,
    /// A plane that was taken off and below which nothing of it lies, with its normal towards it.
    pub planes: Vec<Plane>,
}

/// The largest clusters of a scan, largest first; none if the scan is empty. `within` are opposite corners of a box that everything
/// lies in, in the scan's units.
#[must_use]
pub fn cut(scan: &Scan, within: Option<[Vec3; 2]>) -> Vec<Cut> {
    let sample = Sample::of(scan, within, MOST_LOOKED_AT);
    let Some(size) = sample.size() else {
        return Vec::new();
    };
    let mut left: Vec<usize> = (0..sample.points.len()).collect();
    let mut planes: Vec<Plane> = Vec::new();
    while planes.len() < MOST_PLANES
        && let Some(plane) = find_plane(&sample, &left, size)
    {
        left.retain(|at| !plane.takes(sample.points[*at].position));
        planes.push(plane);
    }
    let cell = sample.cell();
    let positions: Vec<Vec3> = left.iter().map(|at| sample.points[*at].position).collect();
    let found = clusters(&positions, cell);
    let most = found.first().map_or(0, |cluster| cluster.cells());
    #[expect(clippy::cast_precision_loss, reason = "counts of cells")]
    let least = (most as f64 * LEAST_SHARE).max(1.0);
    #[expect(clippy::cast_precision_loss, reason = "counts of cells")]
    let large = found
        .iter()
        .filter(|cluster| cluster.cells() as f64 >= least);
    large
        .take(MOST_CLUSTERS)
        .map(|main| {
            // What is near a cluster and not large itself, such as glasses, belongs to it.
            let (low, high) = main.bounds();
            let margin = Vec3::splat(2.0 * cell);
            #[expect(clippy::cast_precision_loss, reason = "counts of cells")]
            let parts: Vec<_> = found
                .iter()
                .filter(|part| {
                    let (a, b) = part.bounds();
                    let cells = part.cells() as f64;
                    let inside = a.cmpge(low - margin).all() && b.cmple(high + margin).all();
                    std::ptr::eq(*part, main)
                        || inside && cells < least && cells > 0.003 * main.cells() as f64
                })
                .collect();
            let planes: Vec<Plane> = planes
                .iter()
                .map(|plane| plane.towards((low + high) / 2.0))
                .collect();
            let keep = (0..scan.len())
                .into_par_iter()
                .map(|at| {
                    let point = scan.positions[at];
                    sample.holds(point)
                        && parts.iter().any(|part| part.has_near(point))
                        && planes.iter().all(|plane| plane.is_beyond(point))
                })
                .collect();
            Cut {
                keep,
                low,
                high,
                planes,
            }
        })
        .collect()
}
