//! One network with its input's and its outputs' memory.

use super::NetworkSet;
use crate::TrackerError;
use crate::crop::{Border, Crop, Region};
use crate::picture::PictureView;
use npu_runtime::{Outputs, Provider, RuntimeError, Session, TensorSpec};
use std::time::Instant;

/// What a network takes and gives, as its user knows it.
#[derive(Debug, Clone, Copy)]
pub struct Signature {
    /// The file's name without its ending.
    pub name: &'static str,
    /// Pixels along the input's side.
    pub size: usize,
    /// The outputs that are wanted, by their places in the file, and how many numbers each has.
    pub outputs: &'static [(usize, usize)],
    /// What lies beyond a picture's edge.
    pub border: Border,
    /// What black becomes; white becomes 1.
    pub black: f32,
}

/// A network whose input is a square region of a picture.
#[derive(Debug)]
pub struct Network {
    name: &'static str,
    session: Session,
    outputs: Outputs,
    crop: Crop,
}

impl Network {
    /// Loads the network that `signature` describes, to be run by `provider`.
    ///
    /// # Errors
    /// [`TrackerError::Read`] and [`TrackerError::Convert`] if its file is damaged, [`TrackerError::Runtime`] if the runtime refuses it, [`TrackerError::Shape`] if it is not as
    /// `signature` says.
    pub fn open(
        set: &NetworkSet,
        signature: &Signature,
        provider: Provider,
    ) -> Result<Self, TrackerError> {
        let fail = |source| runtime_error(signature.name, source);
        let places: Vec<usize> = signature.outputs.iter().map(|(place, _)| *place).collect();
        let graph = set.onnx(signature.name, &places)?;
        let size = signature.size;
        let input = graph.inputs.iter().map(|port| port.shape.as_slice());
        let lengths = graph
            .outputs
            .iter()
            .map(|port| port.shape.iter().product::<usize>());
        let expected = signature.outputs.iter().map(|(_, length)| *length);
        if !input.eq([[1, 3, size, size].as_slice()]) || !lengths.eq(expected) {
            let list = |ports: &[TensorSpec]| {
                let shapes: Vec<_> = ports.iter().map(|p| format!("{:?}", p.shape)).collect();
                shapes.join(", ")
            };
            return Err(TrackerError::Shape {
                network: signature.name.to_owned(),
                got: format!("{} -> {}", list(&graph.inputs), list(&graph.outputs)),
                expected: format!(
                    "[1, 3, {size}, {size}] -> {:?} numbers",
                    signature
                        .outputs
                        .iter()
                        .map(|(_, length)| *length)
                        .collect::<Vec<_>>()
                ),
            });
        }
        let session = Session::new(
            set.runtime(),
            &graph.onnx,
            provider,
            &graph.inputs,
            &graph.outputs,
        )
        .map_err(fail)?;
        Ok(Self {
            name: signature.name,
            outputs: session.outputs().map_err(fail)?,
            session,
            crop: Crop {
                size,
                border: signature.border,
                black: signature.black,
                white: 1.0,
            },
        })
    }

    /// Pixels along the input's side.
    #[must_use]
    pub fn size(&self) -> usize {
        self.crop.size
    }

    /// Samples `region` into the network's input.
    fn fill(&mut self, picture: PictureView<'_>, region: &Region) {
        self.crop.fill(picture, region, self.session.input_mut(0));
    }

    /// Runs the network on what [`Self::fill`] left.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if it fails.
    fn infer(&mut self) -> Result<(), TrackerError> {
        self.session
            .run(&mut self.outputs)
            .map_err(|source| runtime_error(self.name, source))
    }

    /// Runs the network on `region` of `picture`.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if it fails.
    pub fn run(&mut self, picture: PictureView<'_>, region: &Region) -> Result<(), TrackerError> {
        let start = Instant::now();
        self.fill(picture, region);
        let filled = start.elapsed();
        self.infer()?;
        let all = start.elapsed();
        log::trace!(
            "{}: crop {:.3} ms, network {:.3} ms",
            self.name,
            filled.as_secs_f64() * 1e3,
            (all - filled).as_secs_f64() * 1e3
        );
        Ok(())
    }

    /// The wanted output `index`, in the order of [`Signature::outputs`], of the last run: as long as that says, or empty before the
    /// first run. Any number may be infinite or no number.
    #[must_use]
    pub fn output(&self, index: usize) -> &[f32] {
        self.outputs.get(index)
    }

    /// The first number of output `index`; no number if there is none.
    #[must_use]
    pub fn number(&self, index: usize) -> f32 {
        self.output(index).first().copied().unwrap_or(f32::NAN)
    }
}

fn runtime_error(network: &str, source: RuntimeError) -> TrackerError {
    TrackerError::Runtime {
        network: network.to_owned(),
        source,
    }
}
