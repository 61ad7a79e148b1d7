//! The tile back end: lists the splats of each 16x16 tile in order, then blends each tile by itself.
//!
//! A person is drawn many times over: blending stops as soon as what lies behind no longer shows, which
//! is where this wins over drawing quads.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use shaders_spirv::{FrameParams, TILE_PIXELS};

use crate::error::RenderError;
use crate::geometry_pass::GeometryPass;
use crate::limits::{MOST_LISTING_BYTES, MOST_LISTING_LANES};
use crate::scan::Scan;
use crate::target::Target;

/// Invocations per workgroup of the listing passes: small, since there are few lanes.
const LANE_GROUP: u32 = 32;
/// Invocations per workgroup of the pass over tiles.
const TILE_GROUP: u32 = 64;
/// The same on a software driver.
const CPU_LANE_GROUP: u32 = 8;
/// Lanes there: a row of the table for each costs more than cores gain that have work already, but no core may wait for another's long run.
const CPU_LANES: std::ops::RangeInclusive<u32> = 32..=128;
/// Splats that one lane there walks.
const CPU_RUN: u32 = 8192;

/// Invocations per workgroup of the passes by lane.
fn lane_group(gpu: &Gpu) -> u32 {
    if gpu.info().is_cpu {
        CPU_LANE_GROUP
    } else {
        LANE_GROUP
    }
}

/// A picture's tiles.
#[derive(Debug, Clone, Copy)]
struct Layout {
    tiles_x: u32,
    tiles_y: u32,
    views: u32,
}

impl Layout {
    fn new(width: u32, height: u32, views: u32) -> Self {
        Self {
            tiles_x: width.div_ceil(TILE_PIXELS),
            tiles_y: height.div_ceil(TILE_PIXELS),
            views,
        }
    }

    /// Those of the target's picture as it is now.
    fn of(target: &Target) -> Self {
        Self::new(target.width, target.height, target.layers)
    }

    /// Invocations that share the sorted splats among them.
    fn lanes(self, gpu: &Gpu, capacity: u32) -> u32 {
        let mut lanes = if gpu.info().is_cpu {
            let wanted = capacity.div_ceil(CPU_RUN).next_power_of_two();
            wanted.clamp(*CPU_LANES.start(), *CPU_LANES.end())
        } else {
            MOST_LISTING_LANES
        };
        let limit = MOST_LISTING_BYTES.min(u64::from(gpu.limits().max_storage_buffer_range));
        let row = u64::from(self.lists()) * 4;
        while lanes > lane_group(gpu) && row * u64::from(lanes) > limit {
            lanes /= 2;
        }
        lanes
    }

    fn tiles(self) -> u32 {
        self.tiles_x * self.tiles_y
    }

    /// Lists there are: one per tile and view.
    fn lists(self) -> u32 {
        self.tiles() * self.views
    }
}

/// The passes and the buffers between them.
pub(crate) struct Tiles {
    gpu: Arc<Gpu>,
    lanes: u32,
    count: ComputePipeline,
    sum_lanes: ComputePipeline,
    scan: Scan,
    emit: ComputePipeline,
    raster: ComputePipeline,
    table: Buffer,
    tile_starts: Buffer,
    pairs: Buffer,
    total: Buffer,
}

impl Tiles {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        geometry: &GeometryPass,
        target: &Target,
    ) -> Result<Self, VulkanError> {
        let vk::Extent2D { width, height } = target.most;
        let layout = Layout::new(width, height, target.layers);
        let lanes = layout.lanes(gpu, geometry.capacity());
        let table = Buffer::storage(
            gpu,
            "tile counts",
            u64::from(layout.lists()) * u64::from(lanes) * 4,
        )?;
        // One more than there are lists: the end of the last, which is the number of all pairs.
        let tile_starts = Buffer::storage(gpu, "tile lists", (u64::from(layout.lists()) + 1) * 4)?;
        let total = Buffer::new(
            gpu,
            "pair count",
            4,
            vk::BufferUsageFlags::empty(),
            MemoryUsage::ReadBack,
        )?;
        let pairs = pair_list(gpu, first_capacity(gpu, geometry.capacity(), layout))?;
        let resources = binning(geometry, &table, &tile_starts, &pairs);
        let make = |shader, group, resources: &[Resource<'_>]| {
            let specialisation = Specialisation {
                constants: &[group],
                ..Default::default()
            };
            ComputePipeline::new(gpu, shader, specialisation, resources)
        };
        let size = gpu.subgroup_size();
        let shader = if gpu.features().broadcasts {
            shaders_spirv::RASTER_BROADCAST.words
        } else {
            shaders_spirv::RASTER.words
        };
        let raster = ComputePipeline::new(
            gpu,
            shader,
            Specialisation {
                constants: &[size, u32::from(target.has_depth())],
                fixed_subgroups: true,
                ..Default::default()
            },
            &rastering(geometry, &tile_starts, &pairs, target),
        )?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            lanes,
            count: make(
                shaders_spirv::BIN_COUNT.words,
                lane_group(gpu),
                &resources[..7],
            )?,
            sum_lanes: make(shaders_spirv::BIN_LANES.words, TILE_GROUP, &resources[..8])?,
            scan: Scan::new(gpu, &tile_starts, layout.lists() + 1)?,
            emit: make(shaders_spirv::BIN_EMIT.words, lane_group(gpu), &resources)?,
            raster,
            table,
            tile_starts,
            pairs,
            total,
        })
    }

    /// Pairs of Gaussian and tile that the lists have room for.
    pub(crate) fn pair_capacity(&self) -> u32 {
        u32::try_from(self.pairs.size() / 4).unwrap_or(u32::MAX)
    }

    /// Pairs of the last picture: more than the capacity if the lists were too small and nothing was drawn.
    pub(crate) fn pairs_wanted(&self) -> u32 {
        self.total.read_one()
    }

    /// The lists of one view.
    pub(crate) fn list_count(&self, target: &Target) -> u32 {
        Layout::of(target).tiles()
    }

    /// Where each list begins among the pairs, view after view, and where the last ends.
    pub(crate) fn starts(&self) -> &Buffer {
        &self.tile_starts
    }

    /// All lists, one after the other.
    pub(crate) fn pairs(&self) -> &Buffer {
        &self.pairs
    }

    /// Makes room for `wanted` pairs and some more. The device is idle.
    pub(crate) fn grow(
        &mut self,
        wanted: u32,
        geometry: &GeometryPass,
        target: &Target,
    ) -> Result<(), RenderError> {
        let limit = pair_limit(&self.gpu);
        if wanted > limit {
            return Err(RenderError::TooManyPairs {
                pairs: wanted,
                limit,
            });
        }
        let roomy = wanted.saturating_add(wanted / 4).min(limit);
        log::debug!("tile lists grow to {roomy} pairs");
        // The old list is freed only after the new one is bound: no set ever names a freed buffer.
        let pairs = pair_list(&self.gpu, roomy)?;
        let _old = std::mem::replace(&mut self.pairs, pairs);
        self.emit.bind(&binning(
            geometry,
            &self.table,
            &self.tile_starts,
            &self.pairs,
        ));
        self.raster
            .bind(&rastering(geometry, &self.tile_starts, &self.pairs, target));
        Ok(())
    }

    /// Records the filling of the tiles' lists, and clears the picture, of which only touched tiles are drawn.
    pub(crate) fn record_bin(&self, commands: vk::CommandBuffer, target: &Target) {
        let device = self.gpu.device();
        let layout = Layout::of(target);
        target.record_clear(&self.gpu, commands);
        let counted = u64::from(layout.lists()) * u64::from(self.lanes) * 4;
        for (buffer, bytes) in [(&self.table, counted), (&self.tile_starts, vk::WHOLE_SIZE)] {
            // SAFETY: the command buffer is being recorded; the buffers can be a copy's target, and the table has room
            // for the counts of a larger picture.
            unsafe { device.cmd_fill_buffer(commands, buffer.handle(), 0, bytes, 0) };
        }
        barrier(&self.gpu, commands);
        let by_lane = [self.lanes.div_ceil(lane_group(&self.gpu)), layout.views, 1];
        self.count.dispatch(commands, &[], by_lane);
        barrier(&self.gpu, commands);
        let by_tile = [layout.tiles().div_ceil(TILE_GROUP), layout.views, 1];
        self.sum_lanes.dispatch(commands, &[], by_tile);
        barrier(&self.gpu, commands);
        // Over the lists of the largest picture: those that this one lacks were cleared and add nothing.
        self.scan.record(commands);
        self.emit.dispatch(commands, &[], by_lane);
        let region = [vk::BufferCopy {
            src_offset: u64::from(layout.lists()) * 4,
            dst_offset: 0,
            size: 4,
        }];
        // SAFETY: the source ends with that element, the target holds one.
        unsafe {
            device.cmd_copy_buffer(
                commands,
                self.tile_starts.handle(),
                self.total.handle(),
                &region,
            );
        }
        barrier(&self.gpu, commands);
    }

    /// Records the blending of all tiles of all views into the cleared picture.
    pub(crate) fn record_raster(&self, commands: vk::CommandBuffer, target: &Target) {
        let Layout {
            tiles_x,
            tiles_y,
            views,
        } = Layout::of(target);
        // Each workgroup draws a tile, or one of its blocks: 16x8 pixels by the widest subgroups, 8x8 by all others.
        let tile_groups = match (self.gpu.features().broadcasts, self.gpu.subgroup_size()) {
            (true, _) => 1,
            (false, ..=64) => 4,
            (false, _) => 2,
        };
        let groups = [tiles_x * tile_groups, tiles_y, views];
        self.raster.dispatch(commands, &[], groups);
        barrier(&self.gpu, commands);
    }

    /// Fills in what the passes read of sizes.
    pub(crate) fn describe(&self, frame: &mut FrameParams, target: &Target) {
        let layout = Layout::of(target);
        frame.tiles_x = layout.tiles_x;
        frame.tiles_y = layout.tiles_y;
        frame.lane_count = self.lanes;
        frame.pair_capacity = self.pair_capacity();
    }
}

fn binning<'a>(
    geometry: &'a GeometryPass,
    table: &'a Buffer,
    tile_starts: &'a Buffer,
    pairs: &'a Buffer,
) -> [Resource<'a>; 9] {
    let shared = geometry.shared_buffers();
    let [left, right] = &shared.splats;
    [
        Resource::Uniform(&shared.frame),
        Resource::Storage(geometry.order()),
        Resource::Storage(&shared.state),
        Resource::Storage(&shared.rects),
        Resource::Storage(table),
        Resource::Storage(left),
        Resource::Storage(right),
        Resource::Storage(tile_starts),
        Resource::Storage(pairs),
    ]
}

fn rastering<'a>(
    geometry: &'a GeometryPass,
    tile_starts: &'a Buffer,
    pairs: &'a Buffer,
    target: &'a Target,
) -> [Resource<'a>; 7] {
    let shared = geometry.shared_buffers();
    let [left, right] = &shared.splats;
    [
        Resource::Uniform(&shared.frame),
        Resource::Storage(left),
        Resource::Storage(right),
        Resource::Storage(tile_starts),
        Resource::Storage(pairs),
        Resource::Storage(&target.buffer),
        Resource::Storage(&target.depth),
    ]
}

fn pair_list(gpu: &Arc<Gpu>, capacity: u32) -> Result<Buffer, VulkanError> {
    Buffer::storage(gpu, "tile lists", u64::from(capacity) * 4)
}

/// The most pairs one buffer holds.
fn pair_limit(gpu: &Gpu) -> u32 {
    gpu.limits().max_storage_buffer_range / 4
}

/// A person's Gaussians touch about four tiles each; more makes the list grow.
fn first_capacity(gpu: &Gpu, max_gaussians: u32, layout: Layout) -> u32 {
    max_gaussians
        .saturating_mul(8)
        .saturating_mul(layout.views)
        .clamp(1 << 16, 1 << 24)
        .min(pair_limit(gpu))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;
    use shaders_spirv::{Gaussian, PackedGaussian};

    use crate::camera::Camera;
    use crate::options::{BackEnd, RendererOptions};
    use crate::renderer::SplatRenderer;
    use crate::testing::open_gpu;

    #[test]
    fn splats_handed_round_by_broadcasts_or_through_memory_make_the_same_picture() {
        let mut pictures = Vec::new();
        for broadcasts in [true, false] {
            let Some(mut gpu) = open_gpu() else { return };
            // A device without broadcasts draws through memory both times.
            Arc::get_mut(&mut gpu)
                .expect("the only reference")
                .features_mut()
                .broadcasts &= broadcasts;
            let options = RendererOptions {
                back_end: Some(BackEnd::Tiles),
                ..RendererOptions::new(500, 130, 90, 1)
            };
            let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
            // A spiral of overlapping splats of every hue.
            let spiral: Vec<PackedGaussian> = (0u8..250)
                .map(|step| {
                    let turn = f32::from(step) * 0.2;
                    PackedGaussian::from(&Gaussian {
                        position: [turn.cos(), turn.sin(), -turn / 25.0],
                        rotation: glam::Quat::from_rotation_z(turn).to_array(),
                        scale: [0.3, 0.05, 0.1],
                        opacity: 0.8,
                        colour: [0.5 + 0.5 * turn.sin(), 0.5, 0.5 + 0.5 * turn.cos()],
                    })
                })
                .collect();
            renderer.set_foreground(&spiral).expect("it fits");
            let camera = Camera::look_at(Vec3::Z * 4.0, Vec3::ZERO, Vec3::Y, 0.7, 130, 90);
            renderer.draw(&[camera]).expect("a picture");
            pictures.push(renderer.read_back(0).expect("one view"));
            drop(renderer);
            assert_eq!(gpu.validation_messages(), 0, "validation messages");
        }
        let drawn = pictures[0].pixels().iter().filter(|pixel| pixel[3] > 0.5);
        assert!(drawn.count() > 1_000, "a spiral");
        assert!(pictures[0] == pictures[1], "the pictures differ");
    }
}
