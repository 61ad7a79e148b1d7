//! A described network with its memory.

use super::decode::{Decoded, Look, decode};
use super::description::{Beyond, Colours, Description, Layout, Measure, Sight};
use super::graph;
use super::orders::Part;
use super::plan::Plan;
use crate::TrackerError;
use crate::crop::{Border, Crop, Region, turned_box};
use crate::picture::PictureView;
use glam::Vec2;
use npu_runtime::{Outputs, Provider, Runtime, Session, TensorSpec};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The largest file that is read: protobuf ends there.
const MOST_BYTES: u64 = 2 << 30;

/// A network that several models use one after the other.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    pub(super) plan: Arc<Plan>,
    network: Arc<Mutex<Network>>,
}

#[derive(Debug)]
struct Network {
    path: PathBuf,
    session: Session,
    outputs: Outputs,
    crop: Crop,
    planes: Vec<f32>,
    /// Whether there was a warning that its numbers are not finite.
    has_warned: bool,
}

impl Shared {
    /// Loads the network that is described at `path`.
    pub(super) fn open(
        path: &Path,
        part: Part,
        runtime: &Runtime,
        provider: Provider,
    ) -> Result<Self, TrackerError> {
        let (description, toml, onnx) = Description::read(path)?;
        let refuse = |reason: String| TrackerError::Description {
            path: toml.clone(),
            reason,
        };
        let file = read(&onnx)
            .map_err(|why| refuse(format!("cannot read the network {}: {why}", onnx.display())))?;
        let [width, height] = description.input.sides();
        let shape = match description.input.layout {
            Layout::Nchw => [1, 3, height, width],
            Layout::Nhwc => [1, height, width, 3],
        };
        let wanted: Vec<&str> = description
            .outputs
            .iter()
            .map(|output| output.name())
            .collect();
        let of_network = |why: String| refuse(format!("the network {}: {why}", onnx.display()));
        let graph = graph::narrow(
            &file,
            TensorSpec::new(&description.input.name, &shape),
            &wanted,
        )
        .map_err(of_network)?;
        drop(file);
        let lengths: Vec<usize> = graph
            .outputs
            .iter()
            .map(|spec| spec.shape.iter().product())
            .collect();
        let plan = Plan::new(description, part, &lengths).map_err(of_network)?;
        let fail = |source| TrackerError::Custom {
            path: onnx.clone(),
            source,
        };
        let session = Session::new(
            runtime,
            &graph.onnx,
            provider,
            std::slice::from_ref(&graph.input),
            &graph.outputs,
        )
        .map_err(fail)?;
        let size = width.max(height);
        let crop = Crop {
            size,
            border: match plan.description.crop.border {
                Beyond::Black => Border::Zero,
                Beyond::Edge => Border::Replicate,
            },
            black: plan.description.input.range[0],
            white: plan.description.input.range[1],
        };
        Ok(Self {
            plan: Arc::new(plan),
            network: Arc::new(Mutex::new(Network {
                outputs: session.outputs().map_err(fail)?,
                path: onnx.clone(),
                session,
                crop,
                planes: vec![0.0; 3 * size * size],
                has_warned: false,
            })),
        })
    }

    /// What the network sees in `region`.
    pub(super) fn look(
        &self,
        picture: PictureView<'_>,
        look: Look<'_>,
    ) -> Result<Option<Decoded>, TrackerError> {
        // What another model's panic left is overwritten.
        let mut network = self.network.lock().unwrap_or_else(PoisonError::into_inner);
        let Network {
            path,
            session,
            outputs,
            crop,
            planes,
            has_warned,
        } = &mut *network;
        crop.fill(picture, look.region, planes);
        fill(
            &self.plan,
            planes,
            crop.size,
            look.mirrored,
            session.input_mut(0),
        );
        session
            .run(outputs)
            .map_err(|source| TrackerError::Custom {
                path: path.clone(),
                source,
            })?;
        let seen = decode(&self.plan, |at| outputs.get(at), look);
        if seen.is_none() && !*has_warned {
            let count = self.plan.description.outputs.len();
            let finite = (0..count).all(|at| outputs.get(at).iter().all(|v| v.is_finite()));
            if !finite {
                *has_warned = true;
                log::warn!(
                    "the network {} gives numbers that are none; such pictures are left out",
                    path.display()
                );
            }
        }
        Ok(seen)
    }

    /// The square about `points` that the description asks for, turned by `radians` if it asks for that.
    pub(super) fn region(
        &self,
        points: impl IntoIterator<Item = Vec2>,
        radians: f32,
    ) -> Option<Region> {
        let rule = &self.plan.description.crop;
        let radians = if rule.turned { radians } else { 0.0 };
        let (centre, found) = turned_box(points, radians);
        let [width, height] = self.plan.description.input.sides();
        let aspect = rule.aspect.unwrap_or(width as f32 / height as f32);
        let size = match rule.measure {
            Measure::Longer => {
                let wide = found.x.max(found.y * aspect);
                let high = found.y.max(found.x / aspect);
                wide.max(high)
            }
            Measure::Mean => (found.x + found.y) * 0.5,
        };
        Region::new(centre, size * rule.scale, radians)
    }

    /// Along which pixel the network saw what it saw in `region`.
    pub(super) fn sight(&self, region: &Region) -> Option<Vec2> {
        (self.plan.description.crop.sight == Sight::Crop).then(|| region.centre())
    }
}

/// Writes the middle of `planes` (red, green and blue, `size` x `size` each) as the description wants it.
fn fill(plan: &Plan, planes: &[f32], size: usize, mirrored: bool, to: &mut [f32]) {
    let input = &plan.description.input;
    let [width, height] = input.sides();
    let (left, top) = ((size - width) / 2, (size - height) / 2);
    let area = width * height;
    for channel in 0..3 {
        let plane = match input.colours {
            Colours::Rgb => channel,
            Colours::Bgr => 2 - channel,
        };
        let (mean, scale) = (input.mean[channel], 1.0 / input.deviation[channel]);
        for y in 0..height {
            let first = plane * size * size + (top + y) * size + left;
            let Some(row) = planes.get(first..first + width) else {
                return;
            };
            for x in 0..width {
                let from = if mirrored { width - 1 - x } else { x };
                let at = match input.layout {
                    Layout::Nchw => channel * area + y * width + x,
                    Layout::Nhwc => (y * width + x) * 3 + channel,
                };
                if let (Some(to), Some(from)) = (to.get_mut(at), row.get(from)) {
                    *to = (from - mean) * scale;
                }
            }
        }
    }
}

fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    let file = std::fs::File::open(path)?;
    let length = file.metadata()?.len();
    if length >= MOST_BYTES {
        return Err(std::io::Error::other(
            "it has more than 2 GiB; store its weights as 16-bit floats",
        ));
    }
    let mut bytes = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}
