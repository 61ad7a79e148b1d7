//! Two states to packed Gaussians, against copying as many bytes.

use super::super::measure::short_count;
use super::turns::{Comparison, Copying, GOAL, by_turns};
use app_kernels::Blend;
use app_kernels::state::{GaussianState, STATE_PLANES, plane};
use bytemuck::Zeroable;
use renderer_splat::gaussian::PackedGaussian;

pub(super) fn compare(gaussians: usize, runs: u32) -> anyhow::Result<Comparison> {
    let states = [1, 2].map(|seed| likely_state(gaussians, seed));
    let [from, to] = &states;
    let mut packed = vec![PackedGaussian::zeroed(); gaussians];
    let bytes = gaussians * (2 * STATE_PLANES * size_of::<f32>() + size_of::<PackedGaussian>());
    let mut copying = Copying::new(bytes);
    let mut alpha = 0.0f32;
    let [ours, copied] = by_turns(
        runs,
        [
            &mut || {
                alpha = (alpha + 0.37).fract();
                Blend::new(from, to, alpha)?.pack(0..gaussians, &mut packed)?;
                std::hint::black_box(&mut packed);
                Ok(())
            },
            &mut || {
                copying.copy();
                Ok(())
            },
        ],
    )?;
    let what = format!("interpolate {} Gaussians", short_count(gaussians));
    Ok(
        Comparison::new((what, ours), ("memcpy of the bytes".into(), copied), bytes)
            .aiming_at(GOAL),
    )
}

/// Numbers such as a person's; every rotation another.
fn likely_state(gaussians: usize, seed: u64) -> GaussianState {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut state = GaussianState::new(gaussians);
    for number in 0..STATE_PLANES {
        for value in state.plane_mut(number) {
            let spread = random.f32() - 0.5;
            *value = match number {
                p if plane::LOG2_SCALE.contains(&p) => 2.0 * spread - 7.0,
                p if plane::ROTATION.contains(&p) => spread,
                _ => spread + 0.5,
            };
        }
    }
    for i in 0..gaussians {
        let length = plane::ROTATION
            .map(|p| state.plane(p)[i].powi(2))
            .sum::<f32>()
            .sqrt();
        for p in plane::ROTATION {
            state.plane_mut(p)[i] /= length;
        }
    }
    state
}
