//! A large flat layer among points: a floor or a wall.

use super::sample::{Point, Sample};
use glam::{Vec2, Vec3};
use nalgebra::{Matrix3, SymmetricEigen};
use std::collections::BTreeSet;

/// Planes that are tried.
const TRIALS: usize = 600;
/// Points that each is tried on.
const TRIED_ON: usize = 6_000;
/// Half the thickness in which points count, in sizes of the scan.
const HALF_THICKNESS: f32 = 0.008;
/// Points whose normals lean farther from the plane's (by their cosine) are not of it.
const LEANS: f32 = 0.8;
/// A floor has at least this share of all that is left, by area.
const LEAST_SHARE: f32 = 0.08;
/// ... is in both directions as long as this share of the scan,
const LEAST_SPAN: f32 = 0.3;
/// ... and fills this share of its rectangle. A round one fills 0.78; the flat parts of a body fill less than a third of theirs.
const LEAST_FILLED: f32 = 0.45;
/// At most this share of the other points lies behind it.
const MOST_BEHIND: f32 = 0.12;

/// A plane with the thickness of what lies in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Of unit length.
    pub normal: Vec3,
    /// `normal . point` of its points.
    pub level: f32,
    /// How far from the plane its points may be.
    pub layer: f32,
}

impl Plane {
    fn height(&self, point: Vec3) -> f32 {
        self.normal.dot(point) - self.level
    }

    /// Whether a point lies in the plane's layer.
    #[must_use]
    pub fn takes(&self, point: Vec3) -> bool {
        self.height(point).abs() <= self.layer
    }

    /// Whether a point lies beyond the plane's layer, where the normal points.
    #[must_use]
    pub fn is_beyond(&self, point: Vec3) -> bool {
        self.height(point) > self.layer
    }

    /// The plane with its normal towards a point.
    #[must_use]
    pub fn towards(&self, point: Vec3) -> Self {
        let sign = if self.height(point) < 0.0 { -1.0 } else { 1.0 };
        Self {
            normal: self.normal * sign,
            level: self.level * sign,
            layer: self.layer,
        }
    }
}

/// The plane that most of the points `left` of a sample lie in, if it looks like a floor or a wall. `size` is the scan's.
#[must_use]
pub fn find_plane(sample: &Sample, left: &[usize], size: f32) -> Option<Plane> {
    let mut random = fastrand::Rng::with_seed(1);
    let step = left.len().div_ceil(TRIED_ON).max(1);
    let few: Vec<Point> = left
        .iter()
        .step_by(step)
        .map(|at| sample.points[*at])
        .collect();
    let half = HALF_THICKNESS * size;
    let is_of = |plane: &Plane, point: &Point, half: f32| {
        plane.height(point.position).abs() <= half
            && (point.normal == Vec3::ZERO || point.normal.dot(plane.normal).abs() >= LEANS)
    };
    let plane_at = |normal: Vec3, point: Vec3| Plane {
        normal,
        level: normal.dot(point),
        layer: half,
    };
    // Chosen by area: floors have few Gaussians, and large ones.
    let mut sums = Vec::with_capacity(few.len());
    let mut total = 0.0_f32;
    for point in &few {
        total += point.area;
        sums.push(total);
    }
    let mut best: Option<(f32, Plane)> = None;
    for trial in 0..TRIALS {
        let mut pick = || {
            let wanted = random.f32() * total;
            let at = sums.partition_point(|sum| *sum < wanted);
            few.get(at).or(few.last())
        };
        let first = pick()?;
        // By one point and its normal, or by three points: normals of scans are uncertain.
        let normal = if trial % 2 == 0 && first.normal != Vec3::ZERO {
            first.normal
        } else {
            let (a, b) = (
                pick()?.position - first.position,
                pick()?.position - first.position,
            );
            let Some(normal) = a.cross(b).try_normalize() else {
                continue;
            };
            normal
        };
        let plane = plane_at(normal, first.position);
        let members = few.iter().filter(|point| is_of(&plane, point, half));
        let area = members.map(|point| point.area).sum();
        if best.is_none_or(|(most, _)| area > most) {
            best = Some((area, plane));
        }
    }
    let (_, mut plane) = best?;
    // Points of all that are left, the plane moved to their mean, twice.
    let mut members: Vec<Vec3> = Vec::new();
    let mut area = 0.0;
    for _ in 0..3 {
        members.clear();
        area = 0.0;
        for point in left.iter().map(|at| &sample.points[*at]) {
            if is_of(&plane, point, half) {
                members.push(point.position);
                area += point.area;
            }
        }
        let (normal, middle) = principal(&members)?;
        plane = plane_at(normal, middle);
    }
    let all: f32 = left.iter().map(|at| sample.points[*at].area).sum();
    if area < LEAST_SHARE * all {
        return None;
    }
    let mut heights: Vec<f32> = members
        .iter()
        .map(|point| plane.height(*point).abs())
        .collect();
    heights.sort_unstable_by(f32::total_cmp);
    // Two thirds of a normal distribution are within one standard deviation.
    let spread = heights.get(heights.len() * 2 / 3).copied()?;
    plane.layer = (3.0 * spread).clamp(0.002 * size, 1.5 * half);
    looks_like_floor(sample, left, &plane, &members, size).then_some(plane)
}

#[expect(clippy::cast_precision_loss, reason = "shares of counts")]
fn looks_like_floor(
    sample: &Sample,
    left: &[usize],
    plane: &Plane,
    members: &[Vec3],
    size: f32,
) -> bool {
    if (members.len() as f32) < LEAST_SHARE * left.len() as f32 {
        return false;
    }
    let heights = left
        .iter()
        .map(|at| plane.height(sample.points[*at].position));
    let (mut above, mut below) = (0usize, 0usize);
    for height in heights {
        above += usize::from(height > plane.layer);
        below += usize::from(height < -plane.layer);
    }
    if above.min(below) as f32 > MOST_BEHIND * (above + below) as f32 {
        return false;
    }
    // Along the directions in which it is longest and shortest, its ends left out.
    let first = longest(members, plane.normal);
    let second = plane.normal.cross(first);
    let flat: Vec<Vec2> = members
        .iter()
        .map(|point| Vec2::new(point.dot(first), point.dot(second)))
        .collect();
    let ends = [0, 1].map(|axis| {
        let mut values: Vec<f32> = flat.iter().map(|point| point[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        let cut = values.len() / 50;
        let get = |at: usize| values.get(at).copied().unwrap_or_default();
        (get(cut), get(values.len().saturating_sub(1 + cut)))
    });
    let low = Vec2::new(ends[0].0, ends[1].0);
    let span = Vec2::new(ends[0].1, ends[1].1) - low;
    if span.min_element() < LEAST_SPAN * size {
        return false;
    }
    let cells = 24.0;
    let cell = span / cells;
    #[expect(clippy::cast_possible_truncation, reason = "between 0 and 24")]
    let filled: BTreeSet<(i32, i32)> = flat
        .iter()
        .map(|point| (*point - low) / cell)
        .filter(|at| at.min_element() >= 0.0 && at.max_element() < cells)
        .map(|at| (at.x as i32, at.y as i32))
        .collect();
    filled.len() as f32 >= LEAST_FILLED * cells * cells
}

/// Normal and middle of points that lie in a plane.
fn principal(points: &[Vec3]) -> Option<(Vec3, Vec3)> {
    if points.len() < 3 {
        return None;
    }
    let (eigen, middle) = moments(points);
    let least = eigen.eigenvalues.imin();
    let normal = eigen.eigenvectors.column(least);
    #[expect(clippy::cast_possible_truncation, reason = "a direction")]
    let normal = Vec3::new(normal[0] as f32, normal[1] as f32, normal[2] as f32).try_normalize()?;
    Some((normal, middle))
}

/// The direction across `normal` in which points spread most.
fn longest(points: &[Vec3], normal: Vec3) -> Vec3 {
    let (eigen, _) = moments(points);
    let column = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    #[expect(clippy::cast_possible_truncation, reason = "a direction")]
    let along = Vec3::new(column[0] as f32, column[1] as f32, column[2] as f32);
    along
        .reject_from_normalized(normal)
        .normalize_or(normal.any_orthonormal_vector())
}

#[expect(clippy::cast_precision_loss, reason = "means")]
fn moments(points: &[Vec3]) -> (SymmetricEigen<f64, nalgebra::U3>, Vec3) {
    let count = points.len().max(1) as f64;
    let middle = points
        .iter()
        .map(|point| point.as_dvec3())
        .sum::<glam::DVec3>()
        / count;
    let mut matrix = Matrix3::<f64>::zeros();
    for point in points {
        let away = point.as_dvec3() - middle;
        let away = nalgebra::Vector3::new(away.x, away.y, away.z);
        matrix += away * away.transpose();
    }
    (SymmetricEigen::new(matrix / count), middle.as_vec3())
}
