//! The deform graph's parts on ONNX Runtime, against reading their weights once.

use super::turns::{Comparison, Touching, by_turns};
use mon3tr::device_options::DeviceOptions;
use npu_runtime::{Outputs, Provider, Runtime, Session, TensorSpec};
use spmm3::networks::{Dialect, GraphParts, Port};
use spmm3::{Avatar, JOINTS, SkinningTransforms};

const PARTS: [(GraphParts, &str); 3] = [
    (GraphParts::Whole, "session: the whole graph"),
    (GraphParts::Skinned, "session: without F_attr's tail"),
    (GraphParts::Networks, "session: the networks"),
];

/// A session of each part.
pub(super) struct Sessions {
    sessions: [Part; 3],
}

/// One of them, with its last results.
struct Part {
    session: Session,
    outputs: Outputs,
    /// Of its weights, as ONNX Runtime holds them: widened to 32 bits.
    bytes: usize,
}

impl Sessions {
    pub(super) fn new(runtime: &Runtime, avatar: &Avatar) -> anyhow::Result<Self> {
        let sizes = avatar.graph_sizes()?;
        let open = |parts: GraphParts| -> anyhow::Result<Part> {
            let ports = parts.ports(&sizes);
            let spec = |(name, shape): &Port| TensorSpec::new(name, shape);
            let mut session = Session::new(
                runtime,
                &*avatar.graph(parts, Dialect::Package)?,
                Provider::Cpu {
                    threads: DeviceOptions::threads(),
                },
                &ports.inputs.iter().map(spec).collect::<Vec<_>>(),
                &ports.outputs.iter().map(spec).collect::<Vec<_>>(),
            )?;
            session.input_mut(0).fill(0.1);
            if parts != GraphParts::Networks {
                let rest = SkinningTransforms::default();
                session.input_mut(1).copy_from_slice(&rest.0);
            }
            Ok(Part {
                outputs: session.outputs()?,
                session,
                bytes: weight_bytes(avatar, parts)?,
            })
        };
        let [whole, skinned, networks] = PARTS.map(|(parts, _)| open(parts));
        Ok(Self {
            sessions: [whole?, skinned?, networks?],
        })
    }

    fn part(&mut self, parts: GraphParts) -> &mut Part {
        let [whole, skinned, networks] = &mut self.sessions;
        match parts {
            GraphParts::Whole => whole,
            GraphParts::Skinned => skinned,
            GraphParts::Networks => networks,
        }
    }

    pub(super) fn run(&mut self, parts: GraphParts) -> anyhow::Result<()> {
        let part = self.part(parts);
        Ok(part.session.run(&mut part.outputs)?)
    }

    /// Result `index` of the last run of `parts`.
    pub(super) fn output(&mut self, parts: GraphParts, index: usize) -> &[f32] {
        self.part(parts).outputs.get(index)
    }

    /// Milliseconds of both, which run by turns.
    pub(super) fn by_turns(
        &mut self,
        first: GraphParts,
        second: GraphParts,
        runs: u32,
    ) -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
        let sessions = std::cell::RefCell::new(self);
        let [first, second] = by_turns(
            runs,
            [&mut || sessions.borrow_mut().run(first), &mut || {
                sessions.borrow_mut().run(second)
            }],
        )?;
        Ok((first, second))
    }

    /// Each session against its weights.
    pub(super) fn compare(&mut self, runs: u32) -> anyhow::Result<Vec<Comparison>> {
        let rows = self.sessions.iter_mut().zip(PARTS);
        rows.map(|(part, (_, what))| {
            let mut weights = Touching::new(part.bytes, 0);
            let [ours, once] = by_turns(
                runs,
                [
                    &mut || Ok(part.session.run(&mut part.outputs)?),
                    &mut || {
                        weights.touch();
                        Ok(())
                    },
                ],
            )?;
            Ok(Comparison::new(
                (what.into(), ours),
                ("its weights, once".into(), once),
                part.bytes,
            ))
        })
        .collect()
    }
}

fn weight_bytes(avatar: &Avatar, parts: GraphParts) -> anyhow::Result<usize> {
    let (mesh, attributes) = (avatar.mesh_network()?, avatar.attribute_network()?);
    let layers = [&mesh.first, &mesh.second, &mesh.code, &attributes.first];
    let mut numbers: usize = layers
        .iter()
        .map(|layer| layer.weights().len() + layer.bias().len())
        .sum();
    numbers += mesh.decoder.values().len() + mesh.decoder.mean().len();
    numbers += attributes.second.len() + attributes.second_bias.len();
    if parts != GraphParts::Networks {
        numbers += JOINTS * avatar.template.vertices().len();
    }
    if parts == GraphParts::Whole {
        // Bases, and for each Gaussian three neighbours and masses.
        numbers += attributes.bases.values().len() + 6 * avatar.gaussians.len();
    }
    Ok(numbers * size_of::<f32>())
}
