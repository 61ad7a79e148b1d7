//! Memory for one foreground, which is written while the device draws another.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::PackedGaussian;

use crate::error::RenderError;
use crate::motion_bound::MotionBound;

/// Room for one foreground in memory that the device reads, written by any thread.
///
/// A slot may be written while it is not drawn: [`SplatRenderer::draw_with`](crate::renderer::SplatRenderer::draw_with) borrows it and
/// returns once the device has read it. Three of them in a triple buffer let one be written, one wait and one be drawn. A slot
/// fits every renderer on its device, and keeps that device open: make new ones after
/// [`SplatRenderer::recover`](crate::renderer::SplatRenderer::recover).
pub struct ForegroundSlot {
    memory: Arc<Buffer>,
    capacity: u32,
    pub(crate) count: u32,
    pub(crate) motion: MotionBound,
    /// Counts the writes: a version that the device has already is not copied again.
    pub(crate) version: u64,
}

impl std::fmt::Debug for ForegroundSlot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ForegroundSlot")
            .field("capacity", &self.capacity)
            .field("count", &self.count)
            .field("motion", &self.motion)
            .finish_non_exhaustive()
    }
}

impl ForegroundSlot {
    /// Room for `capacity` Gaussians; it holds none yet.
    pub(crate) fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self, RenderError> {
        let bytes = u64::from(capacity) * size_of::<PackedGaussian>() as u64;
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let memory = Buffer::new(gpu, "a foreground slot", bytes, usage, MemoryUsage::Upload)?;
        Ok(Self {
            memory: Arc::new(memory),
            capacity,
            count: 0,
            motion: MotionBound::NONE,
            version: 0,
        })
    }

    /// All the room there is, to be written from the start, world space; then call [`Self::set`].
    ///
    /// Write whole Gaussians and do not read them: where the device is a GPU the memory is likely not cached, and reading
    /// is a hundred times as slow as writing.
    pub fn gaussians_mut(&mut self) -> &mut [PackedGaussian] {
        // SAFETY: the memory was mapped for as many Gaussians, of which any bits are some. The renderer shares the buffer
        // to keep it alive, but only the slot reaches its memory from the host.
        unsafe { self.memory.mapped_slice(self.capacity as usize) }
    }

    /// States that the first `count` Gaussians were written, and how far they have moved: see [`MotionBound`].
    ///
    /// # Errors
    /// More than there is room for.
    pub fn set(&mut self, count: u32, motion: MotionBound) -> Result<(), RenderError> {
        if count > self.capacity {
            return Err(RenderError::TooManyGaussians {
                count: count as usize,
                limit: self.capacity,
            });
        }
        self.count = count;
        self.motion = motion;
        self.version += 1;
        Ok(())
    }

    /// The number of Gaussians it holds.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.count
    }

    /// Whether it holds none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    pub(crate) fn memory(&self) -> &Arc<Buffer> {
        &self.memory
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use glam::Vec3;
    use shaders_spirv::Gaussian;

    use super::*;
    use crate::camera::Camera;
    use crate::drawing::{Drawing, Foreground, Part};
    use crate::options::{BackEnd, RendererOptions};
    use crate::renderer::SplatRenderer;
    use crate::testing::open_gpu;

    #[test]
    fn slots_make_the_same_pictures_where_shaders_read_them_and_where_they_read_a_copy() {
        let camera = Camera::look_at(Vec3::Z * 4.0, Vec3::ZERO, Vec3::Y, 0.7, 96, 64);
        let row = |count: u8, y: f32| {
            (0..count).map(move |step| {
                PackedGaussian::from(&Gaussian {
                    position: [f32::from(step) * 0.1 - 1.0, y, 0.0],
                    rotation: [0.0, 0.0, 0.0, 1.0],
                    scale: [0.05, 0.2, 0.1],
                    opacity: 0.8,
                    colour: [0.5 + y, 0.5, 0.5 - y],
                })
            })
        };
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
                ..RendererOptions::new(20, 96, 64, 1)
            };
            let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
            let mut slots = [(); 2].map(|()| renderer.foreground_slot().expect("memory"));
            // One slot after the other, one again, and one written anew.
            let (more, fewer) = ((20, 0.3), (10, -0.3));
            for (slot, written) in [
                (0, Some(more)),
                (1, Some(fewer)),
                (0, None),
                (0, Some(fewer)),
            ] {
                if let Some((count, y)) = written {
                    let room = slots[slot].gaussians_mut();
                    room.fill(PackedGaussian::zeroed());
                    for (place, gaussian) in room.iter_mut().zip(row(count, y)) {
                        *place = gaussian;
                    }
                    let motion = MotionBound::new();
                    slots[slot].set(u32::from(count), motion).expect("they fit");
                }
                for _ in 0..2 {
                    renderer
                        .draw_with(&Drawing::new(
                            &[camera],
                            &[Part::here(Foreground::Slot(&slots[slot]))],
                        ))
                        .expect("a picture");
                    pictures.push(renderer.read_back(0).expect("one view"));
                }
            }
            drop((slots, renderer));
            assert_eq!(gpu.validation_messages(), 0, "validation messages");
        }
        let (shared, copied) = pictures.split_at(8);
        assert!(shared == copied, "the pictures differ");
        // Two of each: of 20, of 10, of 20 again, of 10.
        assert!(shared[0] == shared[1], "drawn twice");
        assert!(shared[0] != shared[2], "another slot");
        assert!(shared[0] == shared[4], "the first slot again");
        assert!(shared[2] == shared[6], "written anew");
    }

    #[test]
    fn a_slot_goes_from_thread_to_thread() {
        fn assert_send<T: Send>() {}
        assert_send::<ForegroundSlot>();
    }
}
