//! The CPU and the NPU, which work beside the GPU.

use crate::chip::Chip;
use crate::estimate::Estimate;
use serde::Serialize;

/// What of an avatar sets their times.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Person {
    /// Gaussians.
    pub gaussians: u64,
    /// Vertices of the skinned mesh.
    pub vertices: u64,
    /// Bases of each Gaussian's attributes.
    pub bases: u64,
    /// Weights of the networks alone, bytes as the package has them.
    pub network_bytes: u64,
    /// Weights of their fully connected layers, and outputs.
    pub weights: u64,
    /// See [`Self::weights`].
    pub outputs: u64,
    /// Inputs of F_mesh's layers, which wait for one another, together.
    pub depth: u64,
    /// Offset fields of F_mesh's last layer.
    pub fields: u64,
    /// Weights of the tail of F_attr: the bases.
    pub tail_bytes: u64,
}

/// Milliseconds of one person.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ProcessorTimes {
    /// The networks, and where it is so, linear blend skinning and F_attr's tail, for each motion frame.
    pub inference: Estimate,
    /// Skinning, F_attr's tail and F_m2g on the CPU, for each motion frame.
    pub bind: Estimate,
    /// Interpolation and packing on the CPU, for each picture.
    pub interpolate: Estimate,
}

impl Person {
    /// Where `whole`, F_attr's tail is in the graph; where `on_npu`, the NPU runs it, in half floats, else the CPU, in floats. What is bound by memory is reckoned by
    /// its bytes.
    #[must_use]
    pub fn times(&self, whole: bool, on_npu: bool, chip: &Chip) -> ProcessorTimes {
        let gaussians = self.gaussians as f64;
        let weights = self.network_bytes + if whole { self.tail_bytes } else { 0 };
        // Residuals, 14 floats each, or the tail's bases.
        let tail = if whole {
            56.0 * gaussians
        } else {
            self.tail_bytes as f64
        };
        // Binding and template are read, 14 floats of a state written.
        let bound = tail + gaussians * (40.0 + 56.0 + 56.0) + 36.0 * self.vertices as f64;
        // Two states of 14 floats, and 32 bytes written: as `bench kernels` counts.
        let between = gaussians * (2.0 * 56.0 + 32.0);
        let weights = weights as f64;
        ProcessorTimes {
            inference: if on_npu {
                Estimate::exactly(weights) / chip.npu_weights + chip.npu_call
            } else {
                Estimate::exactly(2.0 * weights) / chip.cpu_memory
            },
            bind: Estimate::exactly(bound) / chip.cpu_memory,
            interpolate: Estimate::exactly(between) / chip.cpu_memory,
        }
    }
}
