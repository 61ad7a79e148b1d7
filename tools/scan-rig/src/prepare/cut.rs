//! Cuts what may be a person out of a scan: floors and walls taken off, the rest divided into what hangs together.

use super::clusters::{Cluster, clusters};
use super::plane::{Plane, find_plane};
use super::sample::Sample;
use crate::scan::Scan;
use glam::Vec3;
use rayon::prelude::*;

/// Gaussians that are looked at: of more, evenly spread ones.
const MOST_LOOKED_AT: usize = 250_000;
/// Planes that are taken off at most: a floor, a ceiling, four walls.
const MOST_PLANES: usize = 6;
/// A cluster with less than this share of the largest one's cells is not looked at.
const LEAST_SHARE: f64 = 0.02;
/// Clusters that are handed on at most.
const MOST_CLUSTERS: usize = 5;
/// Shares of a cluster's cells that a part of it has which does not touch it, such as glasses.
const PART: std::ops::Range<f64> = 0.003..0.2;

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
    let mut flat = planes(&sample, size);
    if flat.is_empty() && within.is_some() {
        // What a tight box leaves of a floor is too little to be found.
        let all = Sample::of(scan, None, MOST_LOOKED_AT);
        flat = (all.size()).map_or_else(Vec::new, |size| planes(&all, size));
    }
    let left: Vec<usize> = (0..sample.points.len())
        .filter(|at| {
            let place = sample.points[*at].position;
            flat.iter().all(|plane| !plane.takes(place))
        })
        .collect();
    let cell = sample.cell();
    let positions: Vec<Vec3> = left.iter().map(|at| sample.points[*at].position).collect();
    let found = clusters(&positions, cell);
    let most = found.first().map_or(0.0, cells);
    let large = found
        .iter()
        .filter(|cluster| cells(cluster) >= LEAST_SHARE * most);
    large
        .take(MOST_CLUSTERS)
        .map(|main| {
            let (low, high) = main.bounds();
            let margin = Vec3::splat(2.0 * cell);
            let parts: Vec<_> = found
                .iter()
                .filter(|part| {
                    let (a, b) = part.bounds();
                    let inside = a.cmpge(low - margin).all() && b.cmple(high + margin).all();
                    std::ptr::eq(*part, main)
                        || inside && PART.contains(&(cells(part) / cells(main)))
                })
                .collect();
            let planes: Vec<Plane> = flat
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

/// Floors and walls, the largest first. `size` is the sample's.
fn planes(sample: &Sample, size: f32) -> Vec<Plane> {
    let mut left: Vec<usize> = (0..sample.points.len()).collect();
    let mut planes: Vec<Plane> = Vec::new();
    while planes.len() < MOST_PLANES
        && let Some(plane) = find_plane(sample, &left, size)
    {
        left.retain(|at| !plane.takes(sample.points[*at].position));
        planes.push(plane);
    }
    planes
}

#[expect(clippy::cast_precision_loss, reason = "counts of cells")]
fn cells(cluster: &Cluster) -> f64 {
    cluster.cells() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    /// A closed surface of discs about `middle`, with these half axes.
    fn shell(scan: &mut Scan, middle: Vec3, half: Vec3, count: u16) {
        for index in 0..count {
            let share = (f32::from(index) + 0.5) / f32::from(count);
            let (y, angle) = (1.0 - 2.0 * share, f32::from(index) * 2.399_963);
            let ring = (1.0 - y * y).sqrt();
            let out = Vec3::new(ring * angle.cos(), y, ring * angle.sin());
            put(scan, middle + out * half, out, 0.015);
        }
    }

    fn put(scan: &mut Scan, at: Vec3, normal: Vec3, size: f32) {
        scan.positions.push(at);
        scan.rotations
            .push(Quat::from_rotation_arc(Vec3::Z, normal));
        scan.scales.push(Vec3::new(size, size, 0.002));
        scan.opacities.push(0.9);
        scan.colours.push(Vec3::ONE);
    }

    #[test]
    fn a_floor_and_strays_are_cut_away_and_two_things_are_told_apart() {
        let mut scan = Scan::default();
        shell(
            &mut scan,
            Vec3::new(-0.6, 0.8, 0.0),
            Vec3::new(0.2, 0.8, 0.2),
            9_000,
        );
        let first = scan.len();
        shell(
            &mut scan,
            Vec3::new(0.7, 0.5, 0.3),
            Vec3::new(0.2, 0.5, 0.2),
            5_000,
        );
        let both = scan.len();
        let mut random = fastrand::Rng::with_seed(2);
        for _ in 0..6_000 {
            let at = Vec3::new(
                3.0 * random.f32() - 1.5,
                0.004 * random.f32(),
                3.0 * random.f32() - 1.5,
            );
            put(&mut scan, at, Vec3::Y, 0.02);
        }
        for _ in 0..40 {
            let at = Vec3::new(random.f32(), random.f32(), random.f32()) * 30.0 - 15.0;
            put(&mut scan, at, Vec3::X, 0.5);
        }
        let turn = Quat::from_rotation_x(1.1) * Quat::from_rotation_z(0.4);
        scan.transform(5.0, turn, Vec3::new(3.0, 8.0, -2.0));
        let found = cut(&scan, None);
        assert_eq!(found.len(), 2, "things");
        let counts = found.iter().map(|part| {
            let count = |range: std::ops::Range<usize>| {
                part.keep[range].iter().filter(|keep| **keep).count()
            };
            [count(0..first), count(first..both), count(both..scan.len())]
        });
        let counts: Vec<[usize; 3]> = counts.collect();
        assert!(
            counts[0][0] > 8_600 && counts[0][1] == 0 && counts[0][2] < 20,
            "{counts:?}"
        );
        assert!(
            counts[1][0] == 0 && counts[1][1] > 4_600 && counts[1][2] < 20,
            "{counts:?}"
        );
        for part in &found {
            let [plane] = part.planes[..] else {
                panic!("{:?}", part.planes)
            };
            let up = turn * Vec3::Y;
            assert!(plane.normal.angle_between(up) < 0.01, "{plane:?} is not up");
        }
    }

    #[test]
    fn a_box_and_numbers_that_are_none_leave_what_is_inside() {
        let mut scan = Scan::default();
        shell(&mut scan, Vec3::ZERO, Vec3::splat(0.5), 4_000);
        shell(&mut scan, Vec3::X * 3.0, Vec3::splat(0.5), 4_000);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            put(&mut scan, Vec3::splat(bad), Vec3::X, 0.1);
        }
        let found = cut(
            &scan,
            Some([Vec3::new(2.0, -1.0, 1.0), Vec3::new(4.0, 1.0, -1.0)]),
        );
        let [part] = &found[..] else {
            panic!("{} things", found.len())
        };
        let kept: Vec<usize> = (0..scan.len()).filter(|at| part.keep[*at]).collect();
        assert!(
            kept.len() > 3_900 && kept.iter().all(|at| (4_000..8_000).contains(at)),
            "{}",
            kept.len()
        );
        assert!(cut(&Scan::default(), None).is_empty(), "nothing");
        let far = [Vec3::splat(50.0), Vec3::splat(51.0)];
        assert!(cut(&scan, Some(far)).is_empty(), "nothing in the box");
    }
}
