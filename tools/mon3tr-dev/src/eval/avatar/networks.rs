//! Distances that networks judge: LPIPS of two pictures, and features for the Frechet distance. Both networks are the user's own ONNX files.

use super::canvas::Canvas;
use anyhow::{Context, bail, ensure};
use npu_runtime::{Outputs, ProviderKind, Runtime, Session, TensorSpec};
use onnx_schema::ValueInfo;
use prost::Message;
use std::path::{Path, PathBuf};

/// The largest network file, bytes.
const MOST_BYTES: u64 = 1 << 30;

/// The longest side of a network's input, pixels.
const MOST_SIDE: usize = 4096;

/// A network that takes pictures `[1, 3, height, width]`.
#[derive(Debug)]
struct Network {
    path: PathBuf,
    session: Session,
    outputs: Outputs,
    /// Width and height.
    size: [usize; 2],
}

/// A float tensor's name and static shape.
fn spec(port: &ValueInfo) -> anyhow::Result<TensorSpec> {
    let name = port.name.as_deref().unwrap_or_default();
    let shape = (port.r#type.as_ref())
        .and_then(|of| of.tensor_type.as_ref())
        .and_then(|tensor| tensor.shape.as_ref())
        .with_context(|| format!("`{name}` has no shape"))?;
    let sides: Option<Vec<usize>> = (shape.dim.iter())
        .map(|side| usize::try_from(side.dim_value?).ok().filter(|s| *s > 0))
        .collect();
    let sides = sides.with_context(|| {
        format!(
            "`{name}` has an open side: export the network with static shapes and one picture a run"
        )
    })?;
    Ok(TensorSpec::new(name, &sides))
}

impl Network {
    /// Opens a network of so many inputs `[1, 3, height, width]` of one size, and one output.
    fn open(path: &Path, runtime: &Runtime, pictures: usize) -> anyhow::Result<Self> {
        let read = || -> anyhow::Result<Vec<u8>> {
            let size = std::fs::metadata(path)?.len();
            ensure!(
                size <= MOST_BYTES,
                "it has {size} bytes; {MOST_BYTES} are the most"
            );
            Ok(std::fs::read(path)?)
        };
        let file = read().with_context(|| format!("cannot read the network {}", path.display()))?;
        let open = || -> anyhow::Result<(Session, [usize; 2])> {
            let graph = onnx_schema::Model::decode(&file[..])
                .context("it is no ONNX file")?
                .graph
                .context("it has no graph")?;
            // Older exports list stored weights among the inputs.
            let stored = |port: &&ValueInfo| {
                let stored = graph
                    .initializer
                    .iter()
                    .any(|tensor| tensor.name == port.name);
                !stored
            };
            let inputs: Vec<TensorSpec> =
                (graph.input.iter().filter(stored).map(spec)).collect::<Result<_, _>>()?;
            let outputs: Vec<TensorSpec> =
                graph.output.iter().map(spec).collect::<Result<_, _>>()?;
            let Some(first) = inputs.first() else {
                bail!("it has no input");
            };
            let &[1, 3, height, width] = &first.shape[..] else {
                bail!(
                    "its input `{}` has the shape {:?}; [1, 3, height, width] is needed",
                    first.name,
                    first.shape
                );
            };
            ensure!(
                inputs.len() == pictures && inputs.iter().all(|input| input.shape == first.shape),
                "{pictures} inputs of one shape are needed, not {}",
                inputs.len()
            );
            ensure!(
                height.max(width) <= MOST_SIDE,
                "its input has {width} x {height} pixels; {MOST_SIDE} a side are the most"
            );
            ensure!(
                outputs.len() == 1,
                "one output is needed, not {}",
                outputs.len()
            );
            let provider =
                ProviderKind::Cpu.with_threads(mon3tr::device_options::DeviceOptions::threads());
            let session = Session::new(runtime, &file, provider, &inputs, &outputs)?;
            Ok((session, [width, height]))
        };
        let cannot = || format!("cannot use the network {}", path.display());
        let (session, size) = open().with_context(cannot)?;
        Ok(Self {
            path: path.to_owned(),
            outputs: session.outputs().with_context(cannot)?,
            session,
            size,
        })
    }

    /// The output for pictures resampled from their `part`, each value by `scaled`.
    fn run(
        &mut self,
        pictures: &[&Canvas],
        part: [usize; 4],
        scaled: impl Fn(f32) -> f32,
    ) -> anyhow::Result<&[f32]> {
        for (index, picture) in pictures.iter().enumerate() {
            let resampled = picture.resampled(part, self.size);
            let planes = self.session.input_mut(index);
            let area = self.size[0] * self.size[1];
            for (channel, plane) in planes.chunks_exact_mut(area).enumerate() {
                for (to, pixel) in plane.iter_mut().zip(&resampled.pixels) {
                    *to = scaled(pixel[channel]);
                }
            }
        }
        let failed = || format!("the network {} failed", self.path.display());
        self.session.run(&mut self.outputs).with_context(failed)?;
        let values = self.outputs.get(0);
        ensure!(
            !values.is_empty() && values.iter().all(|value| value.is_finite()),
            "the network {} gave a number that is not finite",
            self.path.display()
        );
        Ok(values)
    }
}

/// LPIPS (Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", 2018): a network of two pictures
/// `[1, 3, height, width]` with values -1..=1, whose one output is their distance.
#[derive(Debug)]
pub(super) struct Lpips(Network);

impl Lpips {
    pub(super) fn open(path: &Path, runtime: &Runtime) -> anyhow::Result<Self> {
        Ok(Self(Network::open(path, runtime, 2)?))
    }

    /// The distance of two pictures' `part`.
    pub(super) fn distance(
        &mut self,
        a: &Canvas,
        b: &Canvas,
        part: [usize; 4],
    ) -> anyhow::Result<f64> {
        let values = self.0.run(&[a, b], part, |value| 2.0 * value - 1.0)?;
        let &[distance] = values else {
            let count = values.len();
            bail!(
                "LPIPS is one number, but the network {} gives {count}",
                self.0.path.display()
            );
        };
        Ok(f64::from(distance))
    }
}

/// The features of the Frechet inception distance: a network of one picture `[1, 3, height, width]` with values 0..=1, whose one output is its
/// features (Inception's last pooling: 2048).
#[derive(Debug)]
pub(super) struct Features(Network);

impl Features {
    pub(super) fn open(path: &Path, runtime: &Runtime) -> anyhow::Result<Self> {
        Ok(Self(Network::open(path, runtime, 1)?))
    }

    /// The features of a picture's `part`.
    pub(super) fn of(&mut self, picture: &Canvas, part: [usize; 4]) -> anyhow::Result<Vec<f32>> {
        Ok(self.0.run(&[picture], part, |value| value)?.to_vec())
    }
}
