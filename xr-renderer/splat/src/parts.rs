//! The parts of a foreground, one after the other in the numbering of the Gaussians, each projected from where it lies.
//!
//! [`crate::engine`] checks that parts fit the renderer; the mesh's Gaussians come from [`crate::posing`].

use std::sync::Arc;

use ash::vk;
use glam::Affine3A;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use shaders_spirv::{PackedGaussian, PartParams};

use crate::error::RenderError;
use crate::limits::MOST_PARTS;
use crate::options::Filter;
use crate::order::{SortedForeground, SortedPart};
use crate::shared_buffers::SharedBuffers;
use crate::slot::ForegroundSlot;

/// Invocations per workgroup.
const GROUP: u32 = 64;
/// Where `shaders/project_foreground.comp` binds the Gaussians; what is counted of parts comes after them.
const GAUSSIANS: u32 = 7;
/// Bytes of [`PartParams`], of the 128 that every device takes.
const PUSH_BYTES: u32 = 64;
const _: () = assert!(PUSH_BYTES as usize == size_of::<PartParams>(), "whole");
/// Sets of resources, one for each part.
const SETS: u32 = 9;
const _: () = assert!(SETS as usize == MOST_PARTS, "one for each");

/// What is projected as the foreground. It may be changed only while the device is idle.
pub(crate) struct Parts {
    gpu: Arc<Gpu>,
    /// One set of resources for each part there may be.
    project: ComputePipeline,
    /// What the slots hold, one after the other, in the device's own memory; almost empty on a software driver, which
    /// reads the slots.
    copy: Buffer,
    places: [PartBinding; MOST_PARTS],
    /// How many of them there are.
    len: usize,
    /// Gaussians of all of them, and of those that come from slots.
    count: u32,
    from_slots: u32,
    sorted: SortedForeground,
}

/// What one part's set of resources was last used for.
#[derive(Default)]
struct PartBinding {
    /// The slot that is drawn, kept alive while the device may read it; none where the mesh is.
    slot: Option<Arc<Buffer>>,
    version: u64,
    /// Whether the device has its copy of this version, at the place that `params` say.
    copied: bool,
    /// The buffer that is bound.
    projected: vk::Buffer,
    params: PartParams,
}

impl Parts {
    /// Room for as many Gaussians from slots.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        capacity: u32,
        filter: Filter,
        shared: &SharedBuffers,
        costs: &Buffer,
    ) -> Result<Self, RenderError> {
        // Without one the shaders read the slots.
        let copied = if gpu.features().shares_memory {
            0
        } else {
            capacity
        };
        let bytes = u64::from(copied) * size_of::<PackedGaussian>() as u64;
        let copy = Buffer::storage(gpu, "foreground Gaussians", bytes)?;
        let specialisation = Specialisation {
            constants: &[GROUP, filter.is_mip()],
            push_bytes: PUSH_BYTES,
            more_sets: SETS - 1,
            ..Default::default()
        };
        let project = ComputePipeline::new(
            gpu,
            shaders_spirv::PROJECT_FOREGROUND.words,
            specialisation,
            &shared.projecting(&[&copy, costs]),
        )?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            project,
            places: std::array::from_fn(|_| PartBinding {
                projected: copy.handle(),
                ..PartBinding::default()
            }),
            copy,
            len: 0,
            count: 0,
            from_slots: 0,
            sorted: SortedForeground::default(),
        })
    }

    /// Gaussians of all parts.
    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    /// What the order depends on.
    pub(crate) fn sorted(&self) -> &SortedForeground {
        &self.sorted
    }

    /// Starts an empty list of parts; [`Self::end`] follows once all parts were added.
    pub(crate) fn begin(&mut self) {
        (self.len, self.count, self.from_slots) = (0, 0, 0);
        self.sorted = SortedForeground::default();
    }

    /// Adds what a slot holds, which fits.
    pub(crate) fn add_slot(&mut self, slot: &ForegroundSlot, world_from_part: Affine3A) {
        let Some(place) = self.places.get_mut(self.len) else {
            return;
        };
        let memory = slot.memory();
        let (source, binds) = if self.gpu.features().shares_memory {
            (0, &**memory)
        } else {
            (self.from_slots, &self.copy)
        };
        let held = place.slot.as_ref();
        let is_held = held.is_some_and(|held| Arc::ptr_eq(held, memory));
        if !is_held || (place.version, place.params.source) != (slot.version, source) {
            place.copied = false;
        }
        if !is_held {
            place.slot = Some(Arc::clone(memory));
        }
        place.version = slot.version;
        place.bind(&mut self.project, self.len, binds);
        self.from_slots += slot.count;
        self.add(
            source,
            SortedPart::new(slot.count, slot.motion, world_from_part),
        );
    }

    /// Adds the Gaussians of a buffer that is filled on the device.
    pub(crate) fn add_made(&mut self, made: &Buffer, part: SortedPart) {
        let Some(place) = self.places.get_mut(self.len) else {
            return;
        };
        (place.slot, place.copied) = (None, false);
        place.bind(&mut self.project, self.len, made);
        self.add(0, part);
    }

    fn add(&mut self, source: u32, part: SortedPart) {
        let Some(place) = self.places.get_mut(self.len) else {
            return;
        };
        let matrix = part.world_from_part.matrix3;
        let offset = part.world_from_part.translation;
        place.params = PartParams {
            world_from_part: [0, 1, 2]
                .map(|index| matrix.row(index).extend(offset[index]).to_array()),
            first: self.count,
            count: part.count,
            source,
            number: u32::try_from(self.len).unwrap_or_default(),
        };
        self.count += part.count;
        self.sorted.add(part);
        self.len += 1;
    }

    /// Releases the slots of parts that are no longer drawn: others may be copied to where theirs lie.
    pub(crate) fn end(&mut self) {
        for place in self.places.iter_mut().skip(self.len) {
            // The next one's handle may be the same.
            *place = PartBinding::default();
        }
    }

    fn drawn(&self) -> impl Iterator<Item = &PartBinding> {
        self.places.iter().take(self.len)
    }

    /// Records the copies of what the device has not yet.
    pub(crate) fn record_copies(&self, commands: vk::CommandBuffer) {
        if self.gpu.features().shares_memory {
            return;
        }
        let each = size_of::<PackedGaussian>() as u64;
        for place in self.drawn() {
            let PartParams { count, source, .. } = place.params;
            if let (Some(slot), false, 1..) = (&place.slot, place.copied, count) {
                let [start, bytes] = [source, count].map(|gaussians| u64::from(gaussians) * each);
                slot.record_copy_to(commands, &self.copy, start, bytes);
            }
        }
    }

    /// Takes note that the copies were made.
    pub(crate) fn copies_done(&mut self) {
        for place in self.places.iter_mut().take(self.len) {
            place.copied = place.slot.is_some();
        }
    }

    /// Records the projection of each part.
    pub(crate) fn record_project(&self, commands: vk::CommandBuffer) {
        for (set, place) in self.drawn().enumerate() {
            let push = bytemuck::cast_slice(std::slice::from_ref(&place.params));
            let groups = [place.params.count.div_ceil(GROUP), 1, 1];
            self.project.dispatch_with(commands, set, push, groups);
        }
    }
}

impl PartBinding {
    /// Makes the part's set read another buffer, which outlives its next use.
    fn bind(&mut self, pass: &mut ComputePipeline, set: usize, source: &Buffer) {
        if self.projected != source.handle() {
            self.projected = source.handle();
            pass.rebind(set, GAUSSIANS, Resource::Storage(source));
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use shaders_spirv::Gaussian;

    use super::*;
    use crate::camera::Camera;
    use crate::drawing::{Drawing, Foreground, Part};
    use crate::motion_bound::MotionBound;
    use crate::options::{BackEnd, RendererOptions};
    use crate::renderer::SplatRenderer;
    use crate::testing::open_gpu;

    fn write(slot: &mut ForegroundSlot, count: u8, y: f32) {
        for (step, place) in (0..count).zip(slot.gaussians_mut()) {
            *place = PackedGaussian::from(&Gaussian {
                position: [f32::from(step) * 0.1 - 1.0, y, 0.0],
                rotation: [0.0, 0.0, 0.0, 1.0],
                scale: [0.05, 0.2, 0.1],
                opacity: 0.8,
                colour: [0.5 + y, 0.5, 0.5 - y],
            });
        }
        slot.set(count.into(), MotionBound::new())
            .expect("they fit");
    }

    #[test]
    fn parts_that_move_within_the_copy_are_read_from_where_they_lie() {
        let camera = [Camera::look_at(
            Vec3::Z * 4.0,
            Vec3::ZERO,
            Vec3::Y,
            0.7,
            96,
            64,
        )];
        let mut pictures = Vec::new();
        for shares_memory in [true, false] {
            let Some(mut gpu) = open_gpu() else { return };
            // A GPU reads a copy both times.
            Arc::get_mut(&mut gpu)
                .expect("the only reference")
                .features_mut()
                .shares_memory &= shares_memory;
            let options = RendererOptions {
                back_end: Some(BackEnd::Tiles),
                ..RendererOptions::new(40, 96, 64, 1)
            };
            let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
            let mut slots = [(); 3].map(|()| renderer.foreground_slot_for(20).expect("memory"));
            for (slot, (count, y)) in slots.iter_mut().zip([(20, 0.3), (7, -0.3), (12, 0.0)]) {
                write(slot, count, y);
            }
            // The second lies at another place each time, and over it something else did in between.
            for (grown, present) in [
                (false, &[0, 1][..]),
                (false, &[1]),
                (false, &[0, 2]),
                (false, &[0, 1]),
                (false, &[2, 1]),
                (false, &[0]),
                (false, &[2, 1]),
                (true, &[2, 1]),
                (false, &[1, 2, 1]),
            ] {
                if grown {
                    write(&mut slots[2], 18, 0.1);
                }
                let parts: Vec<_> = (0u8..)
                    .zip(present)
                    .map(|(place, slot)| Part {
                        gaussians: Foreground::Slot(&slots[*slot]),
                        world_from_part: Affine3A::from_translation(
                            Vec3::Y * 0.2 * f32::from(place),
                        ),
                    })
                    .collect();
                for _ in 0..2 {
                    renderer
                        .draw_with(&Drawing::new(&camera, &parts))
                        .expect("a picture");
                    pictures.push(renderer.read_back(0).expect("one view"));
                }
            }
            drop((slots, renderer));
            assert_eq!(gpu.validation_messages(), 0, "validation messages");
        }
        let (shared, copied) = pictures.split_at(18);
        for (index, (shared, copied)) in shared.iter().zip(copied).enumerate() {
            assert!(shared == copied, "picture {index} differs");
        }
        assert!(shared[0] == shared[6], "the first two again");
        assert!(shared[8] == shared[12], "and the last two");
        assert!(shared[12] != shared[14], "written anew");
    }
}
