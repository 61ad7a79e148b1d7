//! F_mesh of a scanned person: the linear expression basis and nothing else, exactly, because silu(x) - silu(-x) = x.

use glam::Vec3;
use spmm3::networks::{Dense, MeshNetwork, QuantisedDecoder};
use spmm3::{BODY, EXPRESSION, PARAMS, PersonError};

/// The network that adds `fields` (offsets in T-pose at coefficient 1, metres, `[N_v]` each), weighed by the first expression
/// coefficients. There is at least one field, if only of zeros.
///
/// # Errors
/// If a field has another length than `vertices`, or offsets are not finite.
pub fn linear(fields: &[Vec<Vec3>], vertices: usize) -> Result<MeshNetwork, PersonError> {
    let used = fields.len().min(EXPRESSION);
    let rank = used.max(1);
    let hidden = 2 * rank;
    let mut first = vec![0.0f32; PARAMS * hidden];
    let mut second = vec![0.0f32; hidden * hidden];
    let mut code = vec![0.0f32; hidden * rank];
    for e in 0..used {
        let (plus, minus) = (2 * e, 2 * e + 1);
        first[(BODY + e) * hidden + plus] = 1.0;
        first[(BODY + e) * hidden + minus] = -1.0;
        for (to, sign) in [(plus, 1.0), (minus, -1.0)] {
            second[plus * hidden + to] = sign;
            second[minus * hidden + to] = -sign;
        }
        code[plus * rank + e] = 1.0;
        code[minus * rank + e] = -1.0;
    }
    let mut planes = Vec::with_capacity(rank * 3 * vertices);
    for field in fields.iter().take(used) {
        for axis in 0..3 {
            planes.extend(field.iter().map(|offset| offset[axis]));
        }
    }
    if used == 0 {
        planes.resize(3 * vertices, 0.0);
    }
    Ok(MeshNetwork {
        first: Dense::new(PARAMS, hidden, &first, vec![0.0; hidden])?,
        second: Dense::new(hidden, hidden, &second, vec![0.0; hidden])?,
        code: Dense::new(hidden, rank, &code, vec![0.0; rank])?,
        decoder: QuantisedDecoder::quantise(rank, &planes, vec![0.0; 3 * vertices])?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use reconstruct::fit::MeshRunner;
    use spmm3::MotionParams;

    #[test]
    fn expressions_move_the_mesh_in_proportion_to_their_coefficients() {
        let mut rng = fastrand::Rng::with_seed(4);
        let mut number = || rng.f32() * 0.02 - 0.01;
        let fields: Vec<Vec<Vec3>> = (0..3)
            .map(|_| {
                (0..50)
                    .map(|_| Vec3::new(number(), number(), number()))
                    .collect()
            })
            .collect();
        let network = linear(&fields, 50).unwrap_or_else(|e| panic!("{e}"));
        let runner = MeshRunner::new(&network);
        for coefficients in [[0.0; 3], [1.0, 0.0, 0.0], [-2.0, 0.3, 5.0]] {
            let mut motion = MotionParams::default();
            motion.expression_mut()[..3].copy_from_slice(&coefficients);
            // What else a person does moves nothing.
            motion.values_mut()[7] = 0.4;
            let moved = runner.offsets(&motion);
            for (vertex, offset) in moved.iter().enumerate() {
                let pairs = fields.iter().zip(coefficients);
                let expected: Vec3 = pairs.map(|(f, c)| f[vertex] * c).sum();
                let error = (*offset - expected).length();
                assert!(
                    error < 8e-4,
                    "vertex {vertex}: {error} m at {coefficients:?}"
                );
            }
        }
        assert!(linear(&[], 4).is_ok(), "a face that does not move");
        assert!(linear(&fields, 7).is_err(), "another mesh");
    }
}
