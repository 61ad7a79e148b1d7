//! L_normal: vertex normals against those of a registered mesh.

use crate::error::{ModelError, check_count};
use crate::planes::planes;
use glam::Vec3;
use spmm3::Template;

/// The square of a sum of crossed edges (square metres) below which a vertex has no normal.
const LEAST_SQUARE: f32 = 1e-24;

/// Normals of a mesh's vertices: the sum of the triangles' cross products, which weighs them by area, at length 1.
#[derive(Debug, Clone)]
pub struct VertexNormals {
    faces: Vec<[u32; 3]>,
    /// Sums of cross products, before they are normalised, and derivatives by them.
    sums: Vec<Vec3>,
    by_sums: Vec<Vec3>,
}

impl VertexNormals {
    /// Of a template's triangles.
    #[must_use]
    pub fn new(template: &Template) -> Self {
        let vertices = template.vertices().len();
        Self {
            faces: template.faces().to_vec(),
            sums: vec![Vec3::ZERO; vertices],
            by_sums: vec![Vec3::ZERO; vertices],
        }
    }

    /// Normals of vertices (row-major [3, N_v]), `[N_v]`; 0 where triangles collapse or cancel.
    ///
    /// # Errors
    /// Another number of vertices.
    pub fn normals(&mut self, vertices: &[f32]) -> Result<Vec<Vec3>, ModelError> {
        self.add_up(vertices)?;
        let normal = |sum: &Vec3| unit(*sum).map_or(Vec3::ZERO, |(normal, _)| normal);
        Ok(self.sums.iter().map(normal).collect())
    }

    /// The paper's L_normal (section IV-A): |n - n_wanted|_1 summed over all vertices. A vertex without a normal has no derivative.
    ///
    /// # Errors
    /// Arrays of another number of vertices.
    pub fn l1(
        &mut self,
        vertices: &[f32],
        wanted: &[Vec3],
        weight: f32,
        by_vertices: &mut [f32],
    ) -> Result<f64, ModelError> {
        check_count("wanted normals", wanted.len(), self.sums.len())?;
        check_count("derivatives by vertices", by_vertices.len(), vertices.len())?;
        self.add_up(vertices)?;
        let mut loss = 0.0;
        for ((sum, wanted), by_sum) in self.sums.iter().zip(wanted).zip(&mut self.by_sums) {
            let (normal, inverse) = unit(*sum).unwrap_or((Vec3::ZERO, 0.0));
            let difference = normal - *wanted;
            loss += f64::from(difference.abs().element_sum());
            let sign = difference
                .to_array()
                .map(|x| if x == 0.0 { 0.0 } else { x.signum() });
            let by = weight * Vec3::from_array(sign);
            *by_sum = (by - normal * normal.dot(by)) * inverse;
        }
        let planes: [&[f32]; 3] = planes(vertices);
        let count = self.sums.len();
        for corners in &self.faces {
            let [a, b, c] = corners.map(|corner| point(&planes, corner));
            let by = corners.map(|corner| self.by_sums[corner as usize]);
            let by = by[0] + by[1] + by[2];
            let (by_b, by_c) = ((c - a).cross(by), by.cross(b - a));
            for (corner, by) in corners.iter().zip([-(by_b + by_c), by_b, by_c]) {
                for (axis, number) in by.to_array().into_iter().enumerate() {
                    by_vertices[axis * count + *corner as usize] += number;
                }
            }
        }
        Ok(f64::from(weight) * loss)
    }

    fn add_up(&mut self, vertices: &[f32]) -> Result<(), ModelError> {
        check_count("vertex coordinates", vertices.len(), 3 * self.sums.len())?;
        let planes: [&[f32]; 3] = planes(vertices);
        self.sums.fill(Vec3::ZERO);
        for corners in &self.faces {
            let [a, b, c] = corners.map(|corner| point(&planes, corner));
            let crossed = (b - a).cross(c - a);
            for corner in corners {
                self.sums[*corner as usize] += crossed;
            }
        }
        Ok(())
    }
}

fn point(planes: &[&[f32]; 3], corner: u32) -> Vec3 {
    let corner = corner as usize;
    Vec3::new(planes[0][corner], planes[1][corner], planes[2][corner])
}

/// A vector at length 1, and 1 / its length, where it has one.
fn unit(sum: Vec3) -> Option<(Vec3, f32)> {
    let square = sum.length_squared();
    (square > LEAST_SQUARE).then(|| {
        let inverse = 1.0 / square.sqrt();
        (sum * inverse, inverse)
    })
}
