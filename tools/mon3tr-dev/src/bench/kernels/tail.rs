//! F_attr's tail, alone and fused with F_m2g, against the bytes of its tables and against ONNX Runtime's operators.

use super::sessions::Sessions;
use super::turns::{Comparison, GOAL, Touching, by_turns, differences};
use app_kernels::state::{GaussianState, STATE_PLANES};
use app_kernels::{Attributes, PoseInputs, Poser};
use glam::Vec3;
use spmm3::networks::GraphParts;
use spmm3::{ATTRIBUTES, Avatar};

pub(super) fn compare(
    avatar: &Avatar,
    sessions: &mut Sessions,
    runs: u32,
) -> anyhow::Result<Vec<Comparison>> {
    let poser = Poser::with_tail(avatar)?;
    let gaussians = poser.gaussians();
    sessions.run(GraphParts::Skinned)?;
    let (vertices, potentials) = (
        sessions.output(GraphParts::Skinned, 0).to_vec(),
        sessions.output(GraphParts::Skinned, 1).to_vec(),
    );
    let mut residuals = vec![0.0; ATTRIBUTES * gaussians];
    let states = [(); 2].map(|()| GaussianState::new(gaussians));
    let [before, mut state] = states;
    let (bound, tail) = poser.table_bytes();
    let written = STATE_PLANES * gaussians * size_of::<f32>();
    let mut tail_bytes = Touching::new(tail, written);
    // The state before is read to tell how far Gaussians went.
    let compared = 7 * gaussians * size_of::<f32>();
    let mut all_bytes = Touching::new(bound + tail + compared, written);
    let inputs = PoseInputs {
        vertices: &vertices,
        attributes: Attributes::Potentials(&potentials),
        root: Vec3::ZERO,
    };
    let [alone, alone_bytes, fused, fused_bytes] = by_turns(
        runs,
        [
            &mut || Ok(poser.residuals(&potentials, &mut residuals)?),
            &mut || {
                tail_bytes.touch();
                Ok(())
            },
            &mut || {
                poser.pose(&inputs, 0..gaussians, Some(&before), &mut state)?;
                Ok(())
            },
            &mut || {
                all_bytes.touch();
                Ok(())
            },
        ],
    )?;
    let (whole, skinned) = sessions.by_turns(GraphParts::Whole, GraphParts::Skinned, runs)?;
    let operators = differences(&whole, &skinned);
    let what = |text: &str| text.to_owned();
    let once = |bytes: Vec<f64>| (what("its bytes, once"), bytes);
    Ok(vec![
        Comparison::new(
            (what("F_attr's tail"), alone.clone()),
            once(alone_bytes),
            tail_bytes.bytes(),
        )
        .aiming_at(GOAL),
        Comparison::new(
            (what("F_attr's tail"), alone),
            (what("ONNX operators"), operators),
            0,
        ),
        Comparison::new(
            (what("F_attr's tail with F_m2g"), fused),
            once(fused_bytes),
            all_bytes.bytes(),
        )
        .aiming_at(GOAL),
    ])
}
