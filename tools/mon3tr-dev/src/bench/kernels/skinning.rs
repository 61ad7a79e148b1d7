//! Linear blend skinning, against the bytes it touches and against ONNX Runtime's operators.

use super::sessions::Sessions;
use super::turns::{Comparison, Touching, by_turns, differences};
use app_kernels::Skinner;
use spmm3::networks::GraphParts;
use spmm3::{Avatar, SkinningTransforms};

pub(super) fn compare(
    avatar: &Avatar,
    sessions: &mut Sessions,
    runs: u32,
) -> anyhow::Result<Vec<Comparison>> {
    let mut skinner = Skinner::new(&avatar.template);
    sessions.run(GraphParts::Networks)?;
    let canonical = sessions.output(GraphParts::Networks, 0).to_vec();
    let mut posed = vec![0.0; canonical.len()];
    let transforms = SkinningTransforms::default();
    let vertices = size_of_val(&canonical[..]);
    let mut bytes = Touching::new(skinner.table_bytes() + vertices, vertices);
    let [ours, once] = by_turns(
        runs,
        [
            &mut || Ok(skinner.skin(&canonical, &transforms, &mut posed)?),
            &mut || {
                bytes.touch();
                Ok(())
            },
        ],
    )?;
    let (skinned, networks) = sessions.by_turns(GraphParts::Skinned, GraphParts::Networks, runs)?;
    let operators = differences(&skinned, &networks);
    Ok(vec![
        Comparison::new(
            ("skinning".into(), ours.clone()),
            ("its bytes, once".into(), once),
            bytes.bytes(),
        ),
        Comparison::new(
            ("skinning".into(), ours),
            ("ONNX operators".into(), operators),
            0,
        ),
    ])
}
