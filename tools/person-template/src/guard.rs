//! What keeps a dressed body in order: how far the surface may grow before it meets another part of the body, and no face turned inside out.

use crate::body::{Body, Canonical};
use glam::DVec3;
use rayon::prelude::*;
use scan_rig::nearest::Nearest;

/// Clothes are no thicker, metres.
const THICKEST: f64 = 0.15;

/// Steps in which the way outwards is searched, metres.
const STEP: f64 = 0.01;

/// A vertex of another part this near to the way outwards is met, metres: vertices of thighs are nearly twice as far apart.
const MET: f64 = 0.03;

/// The share of the way to what is met that a vertex may go: a little less than half, so that two that meet do not touch.
const SHARE: f64 = 0.45;

/// Least cosine between a face's normal before and after.
const TURNED: f64 = 0.15;

/// Rounds in which the displacement around inside-out faces is evened out, then those in which it is halved as well; after them it is given up there: the
/// bare body is not inside out.
const EVEN_ROUNDS: usize = 16;
const HALVING_ROUNDS: usize = 8;

/// `[N_v]` how far each vertex may go along its normal in T-pose, metres: half of the way to what faces it (the other leg, the flank below an arm).
pub(crate) fn room(body: &Body, bare: &Canonical) -> Vec<f64> {
    let normals = bare.normals(body);
    let free: Vec<usize> = (0..bare.vertices.len()).filter(|v| body.free[*v]).collect();
    let places: Vec<[f32; 3]> = (free.iter())
        .map(|v| bare.vertices[*v].as_vec3().to_array())
        .collect();
    let tree = Nearest::new(&places);
    (0..bare.vertices.len())
        .into_par_iter()
        .map(|v| {
            if !body.free[v] {
                return 0.0;
            }
            let mut near = [(0.0_f32, 0_u32); 6];
            let mut out = 2.0 * STEP;
            while out <= 2.0 * THICKEST {
                let place = bare.vertices[v] + normals[v] * out;
                let count = tree.some(&place.as_vec3().to_array(), &mut near);
                let met = (near[..count].iter())
                    .filter(|(squared, _)| f64::from(*squared) < MET * MET)
                    .map(|(_, at)| free[*at as usize])
                    .filter(|other| normals[*other].dot(normals[v]) < -0.2)
                    .map(|other| (bare.vertices[other] - bare.vertices[v]).dot(normals[v]))
                    // What is behind is the vertex' own part.
                    .filter(|along| *along > 0.3 * out)
                    .fold(f64::INFINITY, f64::min);
                if met.is_finite() {
                    return SHARE * met;
                }
                out += STEP;
            }
            THICKEST
        })
        .collect()
}

/// Shrinks displacements until no outer face of the displaced mesh is turned against the bare body's; how many vertices were changed.
pub(crate) fn turn_outwards(body: &Body, bare: &Canonical, displacement: &mut [DVec3]) -> usize {
    let count = displacement.len();
    let own = |face: &&[u32; 3]| face.iter().all(|v| (*v as usize) < count);
    let faces: Vec<[u32; 3]> = (body.model.faces.iter().filter(own)).copied().collect();
    let before: Vec<DVec3> = (faces.iter())
        .map(|face| normal(face.map(|v| bare.vertices[v as usize])))
        .collect();
    let mut changed = vec![false; count];
    // Every round that gives up leaves fewer displaced vertices.
    for round in 0..EVEN_ROUNDS + HALVING_ROUNDS + count {
        let mut wrong = vec![false; count];
        for (face, before) in faces.iter().zip(&before) {
            let after = normal(face.map(|v| bare.vertices[v as usize] + displacement[v as usize]));
            // A face without an area has no outside.
            if *before != DVec3::ZERO && after.dot(*before) < TURNED {
                face.iter().for_each(|v| wrong[*v as usize] = true);
            }
        }
        if !wrong.contains(&true) {
            break;
        }
        let given = displacement.to_vec();
        let kept = match round {
            _ if round < EVEN_ROUNDS => 1.0,
            _ if round < EVEN_ROUNDS + HALVING_ROUNDS => 0.5,
            _ => 0.0,
        };
        for v in (0..count).filter(|v| wrong[*v]) {
            let around = body.model.neighbours.of(v);
            let mean = around.iter().map(|n| given[*n as usize]).sum::<DVec3>()
                / around.len().max(1) as f64;
            displacement[v] = given[v].lerp(mean, 0.7) * kept;
            changed[v] = true;
            if kept < 1.0 {
                for n in around {
                    displacement[*n as usize] *= kept;
                    changed[*n as usize] = true;
                }
            }
        }
    }
    changed.iter().filter(|c| **c).count()
}

fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}
