//! Flat Gaussians on the quads of a mesh: a regular grid of cells on each, so that neither holes nor clumps appear.

use glam::{DMat2, DMat3, DVec2, DVec3, Quat};
use spmm3::triangle_frame;

/// Standard deviation over cell size: neighbours overlap without blurring what is painted on them.
const SIGMA_OF_CELL: f64 = 0.62;

/// Thickness of a Gaussian over its smaller deviation.
const THICKNESS: f64 = 0.2;

/// Deviations, metres: from the finest that can be stored to what still looks like a surface.
const DEVIATION: (f64, f64) = (4e-5, 0.03);

/// Cells along an edge of a quad at most.
const MOST_CELLS: f64 = 48.0;

/// A cell of a quad.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    /// Its middle, metres.
    pub(crate) point: DVec3,
    /// Unit normal.
    pub(crate) normal: DVec3,
    /// Turns the Gaussian's axes into the mesh's space.
    pub(crate) rotation: Quat,
    /// Standard deviations, metres; the third is along the normal.
    pub(crate) deviations: DVec3,
    /// The triangle that the middle is on.
    pub(crate) triangle: u32,
    /// Shares of the triangle's corners in the middle.
    pub(crate) shares: [f64; 3],
}

impl Cell {
    /// The cell on the same triangle in another pose, where the triangle's corners are `to` instead of `from`. As large as it was.
    #[must_use]
    pub(crate) fn carried(&self, from: [DVec3; 3], to: [DVec3; 3]) -> Self {
        let frame = |corners: [DVec3; 3]| triangle_frame(corners.map(|c| c.as_vec3()));
        let to_from = Quat::from_mat3(&(frame(to) * frame(from).transpose())).normalize();
        Self {
            point: to.iter().zip(self.shares).map(|(p, s)| *p * s).sum(),
            normal: (to_from.as_dquat() * self.normal).normalize(),
            rotation: (to_from * self.rotation).normalize(),
            ..*self
        }
    }
}

/// A quad, halved into triangles 012 and 023, and how far poses stretch it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patch {
    /// Corners, metres, in the order of the quad.
    pub(crate) corners: [DVec3; 4],
    /// Factors, 1 or more, by which the edges 01 and 03 are longest.
    pub(crate) stretch: DVec2,
    /// The first of its two triangles.
    pub(crate) first_triangle: u32,
}

impl Patch {
    /// Mean lengths of opposite edges: along 01 and along 03, metres.
    #[must_use]
    pub(crate) fn edges(corners: [DVec3; 4]) -> DVec2 {
        let [a, b, c, d] = corners;
        0.5 * DVec2::new(a.distance(b) + d.distance(c), a.distance(d) + b.distance(c))
    }

    /// Its cells, which are `spacing` metres wide where the quad is stretched most. Gaussians do not grow with the mesh: they are made for
    /// the widest pose, and overlap in others.
    pub(crate) fn cells(self, spacing: f64, into: &mut Vec<Cell>) {
        let lengths = Self::edges(self.corners) * self.stretch;
        if !lengths.is_finite() || spacing <= 0.0 {
            return;
        }
        let count = |length: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "clamped to few cells")]
            let count = (length / spacing).round().clamp(1.0, MOST_CELLS) as u32;
            count
        };
        let (n_u, n_v) = (count(lengths.x), count(lengths.y));
        for j in 0..n_v {
            for i in 0..n_u {
                let size = DVec2::new(1.0 / f64::from(n_u), 1.0 / f64::from(n_v));
                let middle = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) * size;
                into.extend(self.cell(middle, size));
            }
        }
    }

    /// Which half a point of the quad is on, and the shares of its corners.
    fn half(middle: DVec2) -> (u32, [f64; 3]) {
        let (u, v) = (middle.x, middle.y);
        if v <= u {
            (0, [1.0 - u, u - v, v])
        } else {
            (1, [1.0 - v, u, v - u])
        }
    }

    fn cell(&self, middle: DVec2, size: DVec2) -> Option<Cell> {
        let [a, b, c, d] = self.corners;
        let (u, v) = (middle.x, middle.y);
        let (half, shares) = Self::half(middle);
        let triangle = if half == 0 { [a, b, c] } else { [a, c, d] };
        let point = triangle.iter().zip(shares).map(|(p, s)| *p * s).sum();
        let along_u = ((b - a) * (1.0 - v) + (c - d) * v) * size.x;
        let along_v = ((d - a) * (1.0 - u) + (c - b) * u) * size.y;
        let normal = (triangle[1] - triangle[0])
            .cross(triangle[2] - triangle[0])
            .try_normalize()
            .or_else(|| along_u.cross(along_v).try_normalize())?;
        let x = (along_u - normal * along_u.dot(normal)).try_normalize()?;
        let y = normal.cross(x);
        let flat = |v: DVec3| DVec2::new(v.dot(x), v.dot(y));
        let cell = DMat2::from_cols(
            flat(along_u) * self.stretch.x,
            flat(along_v) * self.stretch.y,
        );
        let covariance = cell * cell.transpose();
        let (p, q, r) = (
            covariance.x_axis.x,
            covariance.x_axis.y,
            covariance.y_axis.y,
        );
        let turn = 0.5 * (2.0 * q).atan2(p - r);
        let spread = (0.25 * (p - r) * (p - r) + q * q).sqrt();
        let deviation = |square: f64| SIGMA_OF_CELL * square.max(0.0).sqrt();
        let major = deviation(0.5 * (p + r) + spread).clamp(DEVIATION.0, DEVIATION.1);
        let minor =
            deviation(0.5 * (p + r) - spread).clamp((0.15 * major).max(DEVIATION.0), DEVIATION.1);
        let axis = x * turn.cos() + y * turn.sin();
        let turned = DMat3::from_cols(axis, normal.cross(axis), normal);
        Some(Cell {
            point,
            normal,
            rotation: glam::DQuat::from_mat3(&turned).normalize().as_quat(),
            deviations: DVec3::new(major, minor, (THICKNESS * minor).max(DEVIATION.0)),
            triangle: self.first_triangle + half,
            shares,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_cover_a_stretched_quad_evenly_and_lie_on_its_triangles() {
        let corners = [
            DVec3::ZERO,
            DVec3::new(0.01, 0.0, 0.001),
            DVec3::new(0.011, 0.006, 0.0),
            DVec3::new(0.001, 0.005, 0.0),
        ];
        let patch = Patch {
            corners,
            stretch: DVec2::new(1.0, 3.0),
            first_triangle: 40,
        };
        let mut cells = Vec::new();
        patch.cells(0.001, &mut cells);
        assert_eq!(
            cells.len(),
            10 * 17,
            "10 mm by 5.6 mm stretched to three times that"
        );
        for cell in &cells {
            let triangle = if cell.triangle == 40 {
                [0, 1, 2]
            } else {
                [0, 2, 3]
            };
            let point: DVec3 = triangle
                .iter()
                .zip(cell.shares)
                .map(|(k, s)| corners[*k] * s)
                .sum();
            assert!(point.distance(cell.point) < 1e-12, "beside its triangle");
            assert!(
                cell.shares.iter().all(|s| *s >= 0.0),
                "outside of its triangle"
            );
            assert!(
                (cell.deviations.x - 0.00062).abs() < 2e-4,
                "{}",
                cell.deviations
            );
            let turned = cell.rotation.as_dquat() * DVec3::Z;
            assert!(turned.dot(cell.normal) > 0.999_999, "not flat on the quad");
        }
    }
}
