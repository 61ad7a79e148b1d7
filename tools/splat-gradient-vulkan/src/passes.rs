//! The shaders in their order, and what they are told of a scene.

use crate::buffers::{Buffers, GROUP};
use crate::pass::{Pass, Scan};
use crate::shaders;
use crate::sort::Sort;
use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::TILE_PIXELS;
use splat_gradient::View;
use std::sync::Arc;

// A tile is here what it is in the renderer, whose numbers size the buffers.
const _: () = assert!(
    shaders::TILE == TILE_PIXELS,
    "TILE in shaders/numbers.glsl is another than shaders-spirv's"
);

/// Invocations of a workgroup that makes lists; `local_size_x` in `shaders/lists.glsl`.
const LANES: u32 = 32;

/// All passes.
#[derive(Debug)]
pub(crate) struct Passes {
    gpu: Arc<Gpu>,
    project: Pass,
    sort: Sort,
    scan_places: Scan,
    bin: Pass,
    bin_lanes: Pass,
    scan_tiles: Scan,
    raster: Pass,
    raster_backward: Pass,
    pull_back: Pass,
}

impl Passes {
    pub(crate) fn new(gpu: &Arc<Gpu>, buffers: &Buffers) -> Result<Self, VulkanError> {
        let make = |words, push: usize, resources| {
            // A push constant has four bytes, and there are a few.
            let push_bytes = u32::try_from(4 * push).unwrap_or_default();
            Pass::new(gpu, words, &[], push_bytes, resources, buffers)
        };
        Ok(Self {
            gpu: Arc::clone(gpu),
            project: make(shaders::PROJECT, CAMERA, |b| {
                let attributes = b.attributes.buffer();
                let written = [&b.splats, &b.offsets, &b.depths, &b.items, &b.state];
                storage([attributes].into_iter().chain(written))
            })?,
            sort: Sort::new(gpu, buffers)?,
            scan_places: Scan::new(gpu, |b| &b.offsets, buffers)?,
            bin: make(shaders::BIN, LISTS, |b| {
                let read = [&b.order, &b.state, &b.splats];
                let written = [&b.table, &b.tile_starts, &b.offsets, &b.pairs, &b.places];
                storage(read.into_iter().chain(written))
            })?,
            bin_lanes: make(shaders::BIN_LANES, LISTS, |b| {
                storage([&b.table, &b.tile_starts])
            })?,
            scan_tiles: Scan::new(gpu, |b| &b.tile_starts, buffers)?,
            raster: make(shaders::RASTER, PICTURE, |b| storage(blended(b)))?,
            raster_backward: make(shaders::RASTER_BACKWARD, PICTURE, |b| {
                let more = [b.by_pixel.buffer(), &b.moments];
                storage(blended(b).into_iter().chain(more))
            })?,
            pull_back: make(shaders::PULL_BACK, CAMERA, |b| {
                let read = [b.attributes.buffer(), &b.offsets, &b.places, &b.moments];
                let written = [b.derivatives.buffer(), b.motions.buffer()];
                storage(read.into_iter().chain(written))
            })?,
        })
    }

    /// Binds other buffers, which outlive the passes' next use. The device is not using them.
    pub(crate) fn bind(&mut self, buffers: &Buffers) {
        for pass in [
            &mut self.project,
            &mut self.bin,
            &mut self.bin_lanes,
            &mut self.raster,
            &mut self.raster_backward,
            &mut self.pull_back,
        ] {
            pass.bind(buffers);
        }
        self.scan_places.bind(buffers);
        self.scan_tiles.bind(buffers);
        self.sort.bind(buffers);
    }

    /// Records the picture of Gaussians that were copied up, and the number of places it wants: if there are fewer, nothing is drawn.
    pub(crate) fn record_picture(
        &self,
        commands: vk::CommandBuffer,
        buffers: &Buffers,
        scene: &Scene,
    ) {
        let gpu = &*self.gpu;
        let device = gpu.device();
        let tiles = scene.tiles_x * scene.tiles_y;
        let cells = u64::from(tiles) * u64::from(buffers.lanes) * 4;
        self.sort.record_clear(gpu, commands, buffers);
        // SAFETY: the command buffer is being recorded; the table has a cell for every tile and lane.
        unsafe { device.cmd_fill_buffer(commands, buffers.table.handle(), 0, cells, 0) };
        barrier(gpu, commands);
        let camera = scene.camera();
        // One invocation more than Gaussians, for the end of their places.
        let groups = groups(scene.count + 1);
        self.project.dispatch(commands, &camera, [groups, 1, 1]);
        barrier(gpu, commands);
        self.scan_places.record(gpu, commands, scene.count + 1);
        self.sort.record(gpu, commands, buffers);
        let lanes = [buffers.lanes.div_ceil(LANES), 1, 1];
        self.bin.dispatch(commands, &scene.lists(buffers, 0), lanes);
        barrier(gpu, commands);
        let groups = [(tiles + 1).div_ceil(LANES), 1, 1];
        self.bin_lanes
            .dispatch(commands, &scene.lists(buffers, 0), groups);
        barrier(gpu, commands);
        self.scan_tiles.record(gpu, commands, tiles + 1);
        self.bin.dispatch(commands, &scene.lists(buffers, 1), lanes);
        barrier(gpu, commands);
        self.raster
            .dispatch(commands, &scene.picture(buffers), scene.groups());
        let end = [vk::BufferCopy::default()
            .src_offset(u64::from(scene.count) * 4)
            .size(4)];
        let (from, to) = (buffers.offsets.handle(), buffers.total.handle());
        // SAFETY: the command buffer is being recorded; the places have one more than there are Gaussians.
        unsafe { device.cmd_copy_buffer(commands, from, to, &end) };
        barrier(gpu, commands);
    }

    /// Records the derivatives by the Gaussians and the camera, of those by the picture that was drawn last, which were copied up.
    pub(crate) fn record_derivatives(
        &self,
        commands: vk::CommandBuffer,
        buffers: &Buffers,
        scene: &Scene,
    ) {
        self.raster_backward
            .dispatch(commands, &scene.picture(buffers), scene.groups());
        barrier(&self.gpu, commands);
        let groups = groups(scene.count);
        self.pull_back
            .dispatch(commands, &scene.camera(), [groups, 1, 1]);
        barrier(&self.gpu, commands);
    }
}

/// Workgroups of a pass over Gaussians.
#[expect(clippy::cast_possible_truncation, reason = "a workgroup is small")]
fn groups(gaussians: u32) -> u32 {
    gaussians.div_ceil(GROUP as u32)
}

fn storage<'a>(buffers: impl IntoIterator<Item = &'a Buffer>) -> Vec<Resource<'a>> {
    buffers.into_iter().map(Resource::Storage).collect()
}

/// What both passes over a tile's splats bind.
fn blended(b: &Buffers) -> [&Buffer; 6] {
    [
        &b.splats,
        &b.tile_starts,
        &b.pairs,
        &b.offsets,
        b.picture.buffer(),
        &b.through,
    ]
}

/// Numbers of the push constants.
const CAMERA: usize = 24;
const LISTS: usize = 6;
const PICTURE: usize = 5;

/// A view of so many Gaussians, as shaders are told of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene {
    view: View,
    width: u32,
    height: u32,
    tiles_x: u32,
    tiles_y: u32,
    count: u32,
}

impl Scene {
    /// Nothing where there are more Gaussians than a shader counts.
    pub(crate) fn new(view: &View, count: usize) -> Option<Self> {
        let [width, height] = view.size();
        let (width, height) = (u32::try_from(width).ok()?, u32::try_from(height).ok()?);
        Some(Self {
            view: *view,
            width,
            height,
            tiles_x: width.div_ceil(TILE_PIXELS),
            tiles_y: height.div_ceil(TILE_PIXELS),
            count: u32::try_from(count).ok().filter(|n| *n < u32::MAX)?,
        })
    }

    /// A workgroup a tile.
    fn groups(&self) -> [u32; 3] {
        [self.tiles_x, self.tiles_y, 1]
    }

    /// `Camera` in `shaders/seen.glsl`.
    fn camera(&self) -> [u32; CAMERA] {
        let lens = self.view.lens();
        let rows =
            (lens.rows.into_iter().zip(lens.shift)).flat_map(|([x, y, z], shift)| [x, y, z, shift]);
        let numbers = rows
            .chain(lens.focal)
            .chain(lens.centre)
            .chain(lens.least_slope)
            .chain(lens.most_slope)
            .map(f32::to_bits)
            .chain([self.width, self.height, self.tiles_x, self.count]);
        let mut camera = [0; CAMERA];
        for (place, number) in camera.iter_mut().zip(numbers) {
            *place = number;
        }
        camera
    }

    /// `Lists` in `shaders/lists.glsl`.
    fn lists(&self, buffers: &Buffers, emits: u32) -> [u32; LISTS] {
        let (lanes, capacity) = (buffers.lanes, capacity(buffers));
        [
            self.tiles_x,
            self.tiles_y,
            lanes,
            capacity,
            self.count,
            emits,
        ]
    }

    /// `Size` in `shaders/raster.glsl`.
    fn picture(&self, buffers: &Buffers) -> [u32; PICTURE] {
        let capacity = capacity(buffers);
        [self.width, self.height, self.tiles_x, capacity, self.count]
    }
}

/// Places that there are, as shaders count them; one less than a number holds at most, which stands for too many.
fn capacity(buffers: &Buffers) -> u32 {
    u32::try_from(buffers.room.pairs).map_or(u32::MAX - 1, |pairs| pairs.min(u32::MAX - 1))
}
