//! What is seen of Gaussians along short lines, each drawn from its own direction: the colour of a surface without a picture of it.
//!
//! Along its line each Gaussian is blended as a splat of an orthographic view in the line's direction, front to back by its centre's depth.

use crate::scan::Scan;
use glam::{DVec3, IVec3, Mat3, Vec2, Vec3};
use rayon::prelude::*;
use renderer_splat::gaussian::ALPHA_CUT;
use std::collections::HashMap;

/// Edge of a cell of the index, metres: doubled until there are no more entries than [`MOST_ENTRIES`].
const CELL: f32 = 0.012;

/// A Gaussian has an entry in each cell that it reaches, of 16 bytes.
const MOST_ENTRIES: usize = 1 << 25;

/// Gaussians are looked for no farther from their centre than this, metres: what reaches farther is no surface.
const REACH: f32 = 0.06;

/// Variance that each splat gains, square metres: what a pixel of a close picture adds.
const PIXEL: f32 = 0.0003 * 0.0003;

/// A line that a viewer looks along.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// The point that is looked at, metres.
    pub(crate) point: DVec3,
    /// Unit direction from the point towards the viewer.
    pub(crate) towards_viewer: DVec3,
    /// How far before the point Gaussians count, metres.
    pub(crate) before: f32,
    /// How far behind the point Gaussians count, metres.
    pub(crate) behind: f32,
}

/// What a line shows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Seen {
    /// Mean colour of what covers the line, weighted as it is blended.
    pub(crate) colour: Vec3,
    /// How much of the background is covered, 0..=1.
    pub(crate) coverage: f32,
    /// Mean height of what is seen over the point, towards the viewer, metres.
    pub(crate) height: f32,
}

/// Gaussians, found by place.
#[derive(Debug)]
pub(crate) struct Lines<'a> {
    scan: &'a Scan,
    /// Axes times standard deviations, as columns.
    axes: Vec<Mat3>,
    /// Edge of a cell, metres.
    edge: f32,
    cells: HashMap<IVec3, (u32, u32)>,
    members: Vec<u32>,
}

impl<'a> Lines<'a> {
    /// The Gaussians of `scan` that `take` chooses. What is not finite is left out.
    #[must_use]
    pub(crate) fn new(scan: &'a Scan, take: impl Fn(usize) -> bool + Sync) -> Self {
        let axes: Vec<Mat3> = (0..scan.len())
            .into_par_iter()
            .map(|at| Mat3::from_quat(scan.rotations[at]) * Mat3::from_diagonal(scan.scales[at]))
            .collect();
        // Centres and half sides of the boxes that Gaussians reach; none of those that do not count.
        let boxes: Vec<Option<(Vec3, Vec3)>> = (0..scan.len())
            .into_par_iter()
            .map(|at| {
                if !take(at) || scan.opacities[at] <= ALPHA_CUT {
                    return None;
                }
                let rows = axes[at].transpose();
                let deviations = Vec3::new(
                    rows.x_axis.length(),
                    rows.y_axis.length(),
                    rows.z_axis.length(),
                );
                let reach = (2.0 * (scan.opacities[at] / ALPHA_CUT).ln()).sqrt();
                let half = (deviations * reach).min(Vec3::splat(REACH));
                let centre = scan.positions[at];
                let finite =
                    centre.is_finite() && half.is_finite() && centre.abs().max_element() < 100.0;
                finite.then_some((centre, half))
            })
            .collect();
        let mut edge = CELL;
        while entries_of(&boxes, edge) > MOST_ENTRIES && edge < REACH {
            edge *= 2.0;
        }
        let mut entries: Vec<(IVec3, u32)> = (boxes.par_iter().enumerate())
            .filter_map(|(at, of)| Some((u32::try_from(at).ok()?, (*of)?)))
            .flat_map_iter(|(at, (centre, half))| {
                let (low, high) = (cell_of(centre - half, edge), cell_of(centre + half, edge));
                (low.x..=high.x).flat_map(move |x| {
                    (low.y..=high.y)
                        .flat_map(move |y| (low.z..=high.z).map(move |z| (IVec3::new(x, y, z), at)))
                })
            })
            .collect();
        entries.par_sort_unstable_by_key(|(cell, at)| (cell.to_array(), *at));
        let mut cells: HashMap<IVec3, (u32, u32)> = HashMap::new();
        for (k, (cell, _)) in entries.iter().enumerate() {
            let k = u32::try_from(k).unwrap_or(u32::MAX);
            let range = cells.entry(*cell).or_insert((k, k));
            range.1 = k + 1;
        }
        let members = entries.into_iter().map(|(_, at)| at).collect();
        Self {
            scan,
            axes,
            edge,
            cells,
            members,
        }
    }

    /// What each line shows of the Gaussians for which `counts(line, Gaussian)` is true.
    pub(crate) fn look(
        &self,
        lines: &[Line],
        counts: impl Fn(usize, usize) -> bool + Sync,
    ) -> Vec<Seen> {
        lines
            .par_iter()
            .enumerate()
            .map_init(Default::default, |found, (at, line)| {
                self.along(line, found, |g| counts(at, g))
            })
            .collect()
    }

    fn along(&self, line: &Line, found: &mut Found, counts: impl Fn(usize) -> bool) -> Seen {
        let Found { candidates, splats } = found;
        candidates.clear();
        splats.clear();
        let point = line.point.as_vec3();
        let towards = line.towards_viewer.as_vec3();
        if !point.is_finite() || !towards.is_normalized() {
            return Seen::default();
        }
        let (right, up) = towards.any_orthonormal_pair();
        let mut last = None;
        let mut height = -line.behind;
        while height <= line.before {
            let cell = cell_of(point + towards * height, self.edge);
            if last != Some(cell) {
                last = Some(cell);
                if let Some((first, end)) = self.cells.get(&cell) {
                    candidates.extend_from_slice(&self.members[*first as usize..*end as usize]);
                }
            }
            height += 0.4 * self.edge;
        }
        candidates.sort_unstable();
        candidates.dedup();
        for at in candidates.iter().copied() {
            let gaussian = at as usize;
            let away = self.scan.positions[gaussian] - point;
            let height = away.dot(towards);
            if height > line.before || height < -line.behind || !counts(gaussian) {
                continue;
            }
            let axes = &self.axes[gaussian];
            let (mut a, mut b, mut c) = (PIXEL, 0.0, PIXEL);
            for axis in [axes.x_axis, axes.y_axis, axes.z_axis] {
                let flat = Vec2::new(axis.dot(right), axis.dot(up));
                a += flat.x * flat.x;
                b += flat.x * flat.y;
                c += flat.y * flat.y;
            }
            let (x, y) = (away.dot(right), away.dot(up));
            let determinant = a * c - b * b;
            let power = -0.5 * (c * x * x - 2.0 * b * x * y + a * y * y) / determinant;
            let alpha = (self.scan.opacities[gaussian] * power.exp()).min(0.99);
            if determinant > 0.0 && alpha >= ALPHA_CUT {
                splats.push((height, at, alpha));
            }
        }
        splats.sort_unstable_by(|p, q| q.0.total_cmp(&p.0).then(p.1.cmp(&q.1)));
        let mut seen = Seen::default();
        let mut left = 1.0_f32;
        for (height, at, alpha) in splats.iter() {
            let weight = left * alpha;
            seen.colour += weight * self.scan.colours[*at as usize];
            seen.height += weight * height;
            left -= weight;
            if left < 1e-3 {
                break;
            }
        }
        seen.coverage = 1.0 - left;
        if seen.coverage > 1e-6 {
            seen.colour /= seen.coverage;
            seen.height /= seen.coverage;
        }
        seen
    }
}

/// What is found along one line, kept from line to line.
#[derive(Debug, Default)]
struct Found {
    candidates: Vec<u32>,
    /// Height, Gaussian, opacity.
    splats: Vec<(f32, u32, f32)>,
}

fn cell_of(point: Vec3, edge: f32) -> IVec3 {
    (point / edge).floor().as_ivec3()
}

/// How many cells of that edge all boxes reach, each counted for itself.
fn entries_of(boxes: &[Option<(Vec3, Vec3)>], edge: f32) -> usize {
    (boxes.par_iter().flatten())
        .map(|(centre, half)| {
            let span = cell_of(*centre + *half, edge) - cell_of(*centre - *half, edge) + IVec3::ONE;
            span.to_array()
                .map(|cells| usize::try_from(cells).unwrap_or(0))
                .iter()
                .product::<usize>()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    /// A red disc of 4 mm deviation before a large blue one, looked at along z.
    fn discs() -> Scan {
        Scan {
            positions: vec![Vec3::new(0.0, 0.0, 0.005), Vec3::new(0.001, 0.0, 0.0)],
            rotations: vec![Quat::IDENTITY, Quat::from_rotation_z(0.5)],
            scales: vec![Vec3::new(0.004, 0.004, 0.001), Vec3::new(0.01, 0.01, 0.001)],
            opacities: vec![0.5, 0.8],
            colours: vec![Vec3::X, Vec3::Z],
        }
    }

    #[test]
    fn a_line_blends_what_it_crosses_front_to_back() {
        let scan = discs();
        let lines = Lines::new(&scan, |_| true);
        let line = |x: f64, towards_viewer: DVec3| Line {
            point: DVec3::new(x, 0.0, 0.0),
            towards_viewer,
            before: 0.02,
            behind: 0.02,
        };
        let seen = lines.look(
            &[
                line(0.004, DVec3::Z),
                line(0.0, -DVec3::Z),
                line(0.2, DVec3::Z),
            ],
            |_, _| true,
        );
        // By hand: alpha = o exp(-d^2 / 2 s^2) with s^2 + the pixel's variance.
        let red = 0.5 * (-0.5 * 16e-6 / (16e-6 + 0.09e-6_f64)).exp();
        let blue = 0.8 * (-0.5 * 9e-6 / (100e-6 + 0.09e-6_f64)).exp();
        let covered = red + (1.0 - red) * blue;
        assert!(
            (f64::from(seen[0].coverage) - covered).abs() < 1e-5,
            "{:?}",
            seen[0]
        );
        assert!(
            (f64::from(seen[0].colour.x) - red / covered).abs() < 1e-5,
            "{:?}",
            seen[0]
        );
        assert!(
            seen[1].colour.z > 0.8,
            "from behind, blue is in front: {:?}",
            seen[1]
        );
        assert_eq!(seen[2], Seen::default(), "nothing there");
    }
}
