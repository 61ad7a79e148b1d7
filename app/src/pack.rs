//! From the person's Gaussians to the renderer's layout.

use rayon::prelude::*;
use shaders_spirv::PackedGaussian;
use spmm3::{GaussianSet, SH_C0};

/// Gaussians per task.
const CHUNK: usize = 4096;

/// Activates opacity, scale and colour and writes every Gaussian into `out`, which must be as long as `gaussians`
/// (the shorter of the two is written).
pub fn pack(gaussians: &GaussianSet, out: &mut [PackedGaussian]) {
    out.par_chunks_mut(CHUNK)
        .enumerate()
        .for_each(|(chunk, out)| {
            let start = chunk * CHUNK;
            for (k, packed) in out
                .iter_mut()
                .enumerate()
                .take(gaussians.len().saturating_sub(start))
            {
                let i = start + k;
                let colour = gaussians.colours[i] * SH_C0 + 0.5;
                *packed = PackedGaussian::new(
                    gaussians.positions[i].to_array(),
                    gaussians.rotations[i].to_array(),
                    (gaussians.log_scales[i] * std::f32::consts::LOG2_E).to_array(),
                    1.0 / (1.0 + (-gaussians.opacity_logits[i]).exp()),
                    colour.to_array(),
                );
            }
        });
}
