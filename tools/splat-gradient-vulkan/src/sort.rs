//! The order from front to back: the renderer's counting sort, by its shaders.

use crate::buffers::{BINS, Buffers};
use crate::pass::{Pass, Scan};
use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::{
    QUADS_PER_INSTANCE, SORT_COUNT, SORT_CROWDED, SORT_PLAN, SORT_RANK, SORT_SCATTER, SortState,
};
use std::mem::offset_of;
use std::sync::Arc;

// What `State` in shaders/project.comp has of the state.
const _: () = assert!(
    offset_of!(SortState, count) == 0
        && offset_of!(SortState, least) == 4
        && offset_of!(SortState, greatest) == 8
        && offset_of!(SortState, fine_least) == 12
        && offset_of!(SortState, fine_greatest) == 16,
    "State in shaders/project.comp begins otherwise than shaders-spirv's SortState"
);

/// Invocations of a workgroup over items.
const ITEMS: u32 = 256;

/// The sort's passes.
#[derive(Debug)]
pub(crate) struct Sort {
    plan: Pass,
    count: Pass,
    scan: Scan,
    scatter: Pass,
    rank: Pass,
    /// Each with where the state says how many workgroups it has.
    crowded: Vec<(Pass, usize)>,
}

impl Sort {
    pub(crate) fn new(gpu: &Arc<Gpu>, buffers: &Buffers) -> Result<Self, VulkanError> {
        let make = |shader: shaders_spirv::Shader, constants: &[u32], resources| {
            Pass::new(gpu, shader.words, constants, 0, resources, buffers)
        };
        Ok(Self {
            plan: make(SORT_PLAN, &[ITEMS, QUADS_PER_INSTANCE, BINS], |b| {
                vec![Resource::Storage(&b.state)]
            })?,
            count: make(SORT_COUNT, &[ITEMS], |b| sorted(b, 4))?,
            scan: Scan::new(gpu, |b| &b.bins, buffers)?,
            scatter: make(SORT_SCATTER, &[ITEMS], |b| sorted(b, 6))?,
            rank: make(SORT_RANK, &[ITEMS], |b| sorted(b, 8))?,
            crowded: SORT_CROWDED
                .into_iter()
                .map(|(shader, groups)| Ok((make(shader, &[ITEMS], |b| sorted(b, 10))?, groups)))
                .collect::<Result<_, VulkanError>>()?,
        })
    }

    pub(crate) fn bind(&mut self, buffers: &Buffers) {
        for pass in [
            &mut self.plan,
            &mut self.count,
            &mut self.scatter,
            &mut self.rank,
        ] {
            pass.bind(buffers);
        }
        for (pass, _) in &mut self.crowded {
            pass.bind(buffers);
        }
        self.scan.bind(buffers);
    }

    /// Records the clearing of bins and state, to be made visible before items are collected.
    pub(crate) fn record_clear(&self, gpu: &Gpu, commands: vk::CommandBuffer, buffers: &Buffers) {
        let device = gpu.device();
        let empty = bytemuck::bytes_of(&SortState::EMPTY);
        // SAFETY: the command buffer is being recorded; the buffers can be a copy's target, and one holds a state.
        unsafe {
            device.cmd_update_buffer(commands, buffers.state.handle(), 0, empty);
            device.cmd_fill_buffer(commands, buffers.bins.handle(), 0, vk::WHOLE_SIZE, 0);
        }
    }

    /// Records the sort of the collected items and makes the order visible.
    pub(crate) fn record(&self, gpu: &Gpu, commands: vk::CommandBuffer, buffers: &Buffers) {
        let items = offset_of!(SortState, items_groups) as u64;
        let state = &buffers.state;
        self.plan.dispatch(commands, &[], [1; 3]);
        barrier(gpu, commands);
        self.count.dispatch_indirect(commands, state, items);
        barrier(gpu, commands);
        self.scan.record(gpu, commands, BINS);
        self.scatter.dispatch_indirect(commands, state, items);
        barrier(gpu, commands);
        self.rank.dispatch_indirect(commands, state, items);
        barrier(gpu, commands);
        for (pass, groups) in &self.crowded {
            pass.dispatch_indirect(commands, state, *groups as u64);
            barrier(gpu, commands);
        }
    }
}

/// The first of the sort's buffers.
fn sorted(buffers: &Buffers, count: usize) -> Vec<Resource<'_>> {
    let [values, items] = &buffers.placed;
    let all = [
        &buffers.depths,
        &buffers.items,
        &buffers.state,
        &buffers.bins,
        values,
        items,
        &buffers.order,
        &buffers.crowded,
        &buffers.spans,
        &buffers.parts,
    ];
    all.into_iter().take(count).map(Resource::Storage).collect()
}
