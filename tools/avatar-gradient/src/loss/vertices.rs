//! L_vert: vertices against those of a registered mesh.

use crate::error::{ModelError, check_count};

/// The paper's L_vert (section IV-A): |x - x_wanted|_1 summed over all vertices, metres. Row-major [3, N_v] all three, canonical or posed.
///
/// # Errors
/// Arrays of different sizes.
pub fn vertex_l1(
    vertices: &[f32],
    wanted: &[f32],
    weight: f32,
    by_vertices: &mut [f32],
) -> Result<f64, ModelError> {
    check_count("wanted vertices", wanted.len(), vertices.len())?;
    check_count("derivatives by vertices", by_vertices.len(), vertices.len())?;
    let mut sum = 0.0;
    for ((x, wanted), by) in vertices.iter().zip(wanted).zip(by_vertices) {
        let difference = x - wanted;
        sum += f64::from(difference.abs());
        if difference != 0.0 {
            *by += weight * difference.signum();
        }
    }
    Ok(f64::from(weight) * sum)
}
