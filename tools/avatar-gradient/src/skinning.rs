//! Linear blend skinning of the canonical vertices, from at most four joints a vertex, and its derivatives.

use crate::planes::{RUN, for_each_run, planes, planes_mut};
use fearless_simd::{Level, dispatch};
use glam::{Affine3A, Vec3};
use rayon::prelude::*;
use spmm3::{JOINTS, SkinWeights};

/// A 3x4 matrix, column after column, each with a fourth number that is 0.
type Columns = [f32; 16];
/// The derivatives by all joints' 3x4 matrices, columns as in [`Columns`].
pub(crate) type ByJoints = [Columns; JOINTS];

/// No derivative.
pub(crate) const NO_JOINTS: ByJoints = [[0.0; 16]; JOINTS];

/// Joints' matrices as skinning reads them.
pub(crate) fn columns(posed_from_rest: &[Affine3A; JOINTS]) -> [Columns; JOINTS] {
    posed_from_rest.map(|matrix| {
        let numbers = matrix.to_cols_array();
        std::array::from_fn(|k| match k % 4 {
            3 => 0.0,
            row => numbers[k / 4 * 3 + row],
        })
    })
}

/// Posed vertices in the world, [3, N_v], of canonical ones; `root` is the root translation. As `app-kernels` skins.
pub(crate) fn forward(
    level: Level,
    skin: &[SkinWeights],
    matrices: &[Columns; JOINTS],
    root: Vec3,
    canonical: &[f32],
    posed: &mut [f32],
) {
    let canonical: [&[f32]; 3] = planes(canonical);
    for_each_run(planes_mut::<3>(posed), &|start, [out_x, out_y, out_z]| {
        dispatch!(level, simd => {
            let _ = simd;
            for at in 0..out_x.len() {
                let vertex = start + at;
                let blended = blend(&skin[vertex], matrices);
                let [x, y, z] = canonical.map(|plane| plane[vertex]);
                let mut sum = [0.0; 4];
                for row in 0..4 {
                    sum[row] = blended[row] * x + (blended[4 + row] * y + (blended[8 + row] * z + blended[12 + row]));
                }
                out_x[at] = sum[0] + root.x;
                out_y[at] = sum[1] + root.y;
                out_z[at] = sum[2] + root.z;
            }
        });
    });
}

#[inline(always)]
fn blend(skin: &SkinWeights, matrices: &[Columns; JOINTS]) -> Columns {
    let mut blended = [0.0; 16];
    for (joint, weight) in skin.joints.iter().zip(skin.weights) {
        let matrix = &matrices[usize::from(*joint)];
        for (sum, number) in blended.iter_mut().zip(matrix) {
            *sum += weight * number;
        }
    }
    blended
}

/// Adds the derivatives by the canonical vertices, of those by the posed ones, to `by_canonical`, and returns those by the joints' matrices
/// (with those by translations in the last columns). `parts` is memory for one result a run.
pub(crate) fn backward(
    level: Level,
    skin: &[SkinWeights],
    matrices: &[Columns; JOINTS],
    canonical: &[f32],
    by_posed: &[f32],
    by_canonical: &mut [f32],
    parts: &mut Vec<ByJoints>,
) -> ByJoints {
    let canonical: [&[f32]; 3] = planes(canonical);
    let by_posed: [&[f32]; 3] = planes(by_posed);
    for_each_run(
        planes_mut::<3>(by_canonical),
        &|start, [out_x, out_y, out_z]| {
            dispatch!(level, simd => {
                let _ = simd;
                for at in 0..out_x.len() {
                    let vertex = start + at;
                    let blended = blend(&skin[vertex], matrices);
                    let by = by_posed.map(|plane| plane[vertex]);
                    let along = |column: usize| {
                        let column = &blended[4 * column..4 * column + 3];
                        column[0] * by[0] + column[1] * by[1] + column[2] * by[2]
                    };
                    out_x[at] += along(0);
                    out_y[at] += along(1);
                    out_z[at] += along(2);
                }
            });
        },
    );
    parts.clear();
    parts.resize(skin.len().div_ceil(RUN), NO_JOINTS);
    parts
        .par_iter_mut()
        .zip(skin.par_chunks(RUN))
        .enumerate()
        .for_each(|(run, (sums, skin))| {
            dispatch!(level, simd => {
                let _ = simd;
                for (vertex, skin) in (run * RUN..).zip(skin) {
                    let [bx, by, bz] = by_posed.map(|plane| plane[vertex]);
                    let [x, y, z] = canonical.map(|plane| plane[vertex]);
                    let outer = [
                        bx * x, by * x, bz * x, 0.0,
                        bx * y, by * y, bz * y, 0.0,
                        bx * z, by * z, bz * z, 0.0,
                        bx, by, bz, 0.0,
                    ];
                    for (joint, weight) in skin.joints.iter().zip(skin.weights) {
                        if weight != 0.0 {
                            for (sum, number) in sums[usize::from(*joint)].iter_mut().zip(&outer) {
                                *sum += weight * number;
                            }
                        }
                    }
                }
            });
        });
    let mut total = NO_JOINTS;
    for part in parts.iter() {
        for (total, part) in total.as_flattened_mut().iter_mut().zip(part.as_flattened()) {
            *total += part;
        }
    }
    total
}
