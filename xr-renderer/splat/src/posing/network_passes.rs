//! The passes that run a mesh's networks: from a pose's parameters to what is posed by them, in the pose's slot.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use renderer_vulkan::upload::Upload;

use super::checks::refused;
use super::dispatch::{GROUP, word};
use super::networks::{Layers, Networks};
use crate::error::RenderError;

/// The networks on the device. One pose is computed at a time.
pub(super) struct NetworkPasses {
    gpu: Arc<Gpu>,
    first: LayerPass,
    second: LayerPass,
    code: LayerPass,
    decode: ComputePipeline,
    fours: u32,
    fields: u32,
    unit: f32,
    values: Upload,
    scales: Upload,
    rest: Upload,
    controllers_first: LayerPass,
    controllers_second: LayerPass,
    /// What each layer hands to the next: of the mesh three times, of the controllers once.
    _between: [Buffer; 4],
}

/// Where a pose's numbers lie in its buffer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Places {
    pub(super) parameters: usize,
    pub(super) potentials: usize,
    pub(super) vertices: usize,
}

/// Layers beside one another.
struct LayerPass {
    pipeline: ComputePipeline,
    weights: Upload,
    bias: Upload,
    layers: u32,
    inputs: u32,
    pairs: u32,
    /// From one layer's inputs to the next one's.
    stride: u32,
}

impl LayerPass {
    fn new(
        gpu: &Arc<Gpu>,
        layers: &Layers,
        silu: bool,
        [from, to]: [&Buffer; 2],
    ) -> Result<Self, RenderError> {
        let weights = Upload::new(gpu, "weights of networks", &layers.weights)?;
        let bias = Upload::new(gpu, "biases of networks", &layers.bias)?;
        let resources = [weights.buffer(), bias.buffer(), from, to].map(Resource::Storage);
        let specialisation = Specialisation {
            constants: &[GROUP, u32::from(silu)],
            push_bytes: 24,
            ..Default::default()
        };
        let shader = shaders_spirv::DENSE.words;
        Ok(Self {
            pipeline: ComputePipeline::new(gpu, shader, specialisation, &resources)?,
            weights,
            bias,
            layers: layers.layers,
            inputs: layers.inputs,
            pairs: layers.pairs,
            // Their inputs are outputs of one layer, side by side.
            stride: layers.inputs,
        })
    }

    fn record(&self, commands: vk::CommandBuffer, first_input: u32, first_output: u32) {
        let push = [
            self.layers,
            self.inputs,
            self.pairs,
            first_input,
            self.stride,
            first_output,
        ];
        let groups = (self.layers * self.pairs).div_ceil(GROUP);
        self.pipeline.dispatch(commands, &push, [groups, 1, 1]);
    }
}

/// Refuses networks of which one layer's outputs do not fit a dispatch.
fn check_sizes(networks: &Networks, most: u32) -> Result<(), RenderError> {
    let layers = [
        &networks.first,
        &networks.second,
        &networks.code,
        &networks.controllers_first,
        &networks.controllers_second,
    ];
    let largest = layers.map(Layers::outputs).into_iter().max().unwrap_or(0);
    if largest / 2 > u64::from(most) || networks.fours > most {
        return Err(refused(format!(
            "a layer of its networks has {largest} outputs, and this device computes {} at most",
            2 * u64::from(most)
        )));
    }
    Ok(())
}

impl NetworkPasses {
    /// For poses that lie in `poses`, on a device that runs `most` invocations at a time.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        networks: &Networks,
        poses: &Buffer,
        most: u32,
    ) -> Result<Self, RenderError> {
        check_sizes(networks, most)?;
        let between = |layers: &Layers| Buffer::storage(gpu, "hidden units", 4 * layers.outputs());
        let hidden = between(&networks.first)?;
        let more = between(&networks.second)?;
        let code = between(&networks.code)?;
        let held = between(&networks.controllers_first)?;
        let values = Upload::new(gpu, "fields of the mesh", &networks.values)?;
        let scales = Upload::new(gpu, "scales of its fields", &networks.scales)?;
        let rest = Upload::new(gpu, "the mesh at rest", &networks.rest)?;
        let decoding = [
            values.buffer(),
            scales.buffer(),
            rest.buffer(),
            &code,
            poses,
        ];
        let decode = ComputePipeline::new(
            gpu,
            shaders_spirv::DECODE_VERTICES.words,
            Specialisation {
                constants: &[GROUP],
                push_bytes: 16,
                ..Default::default()
            },
            &decoding.map(Resource::Storage),
        )?;
        let layer = |layers, silu, from, to| LayerPass::new(gpu, layers, silu, [from, to]);
        Ok(Self {
            first: layer(&networks.first, true, poses, &hidden)?,
            second: layer(&networks.second, true, &hidden, &more)?,
            code: layer(&networks.code, false, &more, &code)?,
            controllers_first: layer(&networks.controllers_first, true, poses, &held)?,
            controllers_second: layer(&networks.controllers_second, false, &held, poses)?,
            decode,
            fours: networks.fours,
            fields: networks.fields,
            unit: networks.unit,
            values,
            scales,
            rest,
            _between: [hidden, more, code, held],
            gpu: Arc::clone(gpu),
        })
    }

    /// Records the upload of weights, once.
    pub(super) fn record_upload(&self, commands: vk::CommandBuffer) {
        for pass in self.layers() {
            pass.weights.record(commands);
            pass.bias.record(commands);
        }
        for upload in [&self.values, &self.scales, &self.rest] {
            upload.record(commands);
        }
    }

    /// Frees what only the upload needed. The device is idle and has it all.
    pub(super) fn free_staging(&mut self) {
        for pass in [
            &mut self.first,
            &mut self.second,
            &mut self.code,
            &mut self.controllers_first,
            &mut self.controllers_second,
        ] {
            pass.weights.free_staging();
            pass.bias.free_staging();
        }
        for upload in [&mut self.values, &mut self.scales, &mut self.rest] {
            upload.free_staging();
        }
    }

    /// Records one pose's networks; its parameters are visible, and what is computed of them is made so. Layers that do not wait for each
    /// other share a barrier.
    pub(super) fn record(&self, commands: vk::CommandBuffer, at: Places) {
        let parameters = word(at.parameters);
        self.controllers_first.record(commands, parameters, 0);
        self.first.record(commands, parameters, 0);
        barrier(&self.gpu, commands);
        self.controllers_second
            .record(commands, 0, word(at.potentials / 2));
        self.second.record(commands, 0, 0);
        barrier(&self.gpu, commands);
        self.code.record(commands, 0, 0);
        barrier(&self.gpu, commands);
        let push = [
            self.fours,
            self.fields,
            word(at.vertices / 4),
            self.unit.to_bits(),
        ];
        let groups = [self.fours.div_ceil(GROUP), 1, 1];
        self.decode.dispatch(commands, &push, groups);
        barrier(&self.gpu, commands);
    }

    fn layers(&self) -> [&LayerPass; 5] {
        [
            &self.first,
            &self.second,
            &self.code,
            &self.controllers_first,
            &self.controllers_second,
        ]
    }
}
