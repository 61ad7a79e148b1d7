//! From Gaussians and a view to a picture and back, on a device.

use crate::buffers::{Buffers, GROUP, Room};
use crate::passes::{Passes, Scene};
use renderer_vulkan::commands::{Commands, barrier};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use splat_gradient::attributes::ATTRIBUTES;
use splat_gradient::device::Derivable;
use splat_gradient::error::{GradientError, check_count};
use splat_gradient::view::Twist;
use splat_gradient::{Attributes, Picture, SplatDevice, View};
use std::sync::Arc;

/// Draws pictures and takes derivatives back on a Vulkan device; keeps its memory there from one to the next: 44 bytes for every tile of 16x16 pixels
/// that a Gaussian's rectangle has, 180 for every Gaussian and 36 for every pixel.
#[derive(Debug)]
pub struct VulkanSplatter {
    // Dropped first: waits for the device.
    commands: Commands,
    gpu: Arc<Gpu>,
    passes: Passes,
    buffers: Buffers,
    picture: Picture,
}

impl VulkanSplatter {
    /// Compiles the shaders.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self, GradientError> {
        let made = || {
            let buffers = Buffers::new(gpu, Room::LEAST)?;
            Ok(Self {
                gpu: Arc::clone(gpu),
                commands: Commands::new(gpu)?,
                passes: Passes::new(gpu, &buffers)?,
                buffers,
                picture: Picture::default(),
            })
        };
        made().map_err(failed)
    }

    /// Makes room, as far as there is not enough. The device is idle.
    fn reserve(&mut self, wanted: &Room) -> Result<(), VulkanError> {
        let room = self.buffers.room;
        if room.holds(wanted) {
            return Ok(());
        }
        // Nothing in the old ones is needed any more, and a device may have no memory for both.
        self.exchange(Buffers::new(&self.gpu, Room::LEAST)?);
        // With some more of what is too little, where the device has it.
        let buffers = Buffers::new(&self.gpu, room.grown(wanted, true))
            .or_else(|_| Buffers::new(&self.gpu, room.grown(wanted, false)))?;
        self.exchange(buffers);
        Ok(())
    }

    /// Frees the buffers, once others are bound: no set ever names a freed buffer.
    fn exchange(&mut self, buffers: Buffers) {
        self.passes.bind(&buffers);
        self.buffers = buffers;
    }

    fn form(
        &mut self,
        gaussians: &Attributes,
        scene: &Scene,
        room: Room,
    ) -> Result<(), VulkanError> {
        let mut room = room;
        // After an error the device may still be at work.
        self.commands.wait()?;
        loop {
            self.reserve(&room)?;
            let Self {
                commands,
                gpu,
                passes,
                buffers,
                picture,
            } = self;
            buffers.attributes.write(gaussians.numbers());
            let numbers = picture.numbers().len();
            commands.run("the picture of the Gaussians", |recorded| {
                buffers
                    .attributes
                    .record_up(recorded, gaussians.numbers().len());
                passes.record_picture(recorded, buffers, scene);
                buffers.picture.record_down(recorded, numbers);
                barrier(gpu, recorded);
            })?;
            let wanted = u64::from(buffers.total.read_one::<u32>());
            if wanted <= buffers.room.pairs {
                let drawn = buffers.picture.numbers(numbers);
                picture.numbers_mut().copy_from_slice(drawn);
                return Ok(());
            }
            // Nothing was drawn: the lists were too small.
            room.pairs = wanted;
        }
    }

    fn pull_back(
        &mut self,
        scene: &Scene,
        by_pixel: &Picture,
        gradients: &mut Attributes,
    ) -> Result<Twist, VulkanError> {
        let Self {
            commands,
            gpu,
            passes,
            buffers,
            ..
        } = self;
        commands.wait()?;
        buffers.by_pixel.write(by_pixel.numbers());
        let numbers = gradients.numbers().len();
        let motions = 6 * gradients.len().div_ceil(GROUP);
        commands.run("the derivatives by the Gaussians", |recorded| {
            let pixels = by_pixel.numbers().len();
            buffers.by_pixel.record_up(recorded, pixels);
            barrier(gpu, recorded);
            passes.record_derivatives(recorded, buffers, scene);
            buffers.derivatives.record_down(recorded, numbers);
            buffers.motions.record_down(recorded, motions);
            barrier(gpu, recorded);
        })?;
        let derivatives = buffers.derivatives.numbers(numbers);
        for (sum, more) in gradients.numbers_mut().iter_mut().zip(derivatives) {
            *sum += more;
        }
        let mut twist = [0.0; 6];
        for part in buffers.motions.numbers(motions).chunks_exact(6) {
            for (sum, more) in twist.iter_mut().zip(part) {
                *sum += f64::from(*more);
            }
        }
        Ok(twist)
    }
}

fn failed(why: VulkanError) -> GradientError {
    GradientError::Device(Box::new(why))
}

/// Refuses more Gaussians than a dispatch takes.
fn scene_of(gpu: &Gpu, view: &View, count: usize) -> Result<Scene, VulkanError> {
    let bytes = size_of::<[f32; ATTRIBUTES]>() as u64;
    let most = u64::from(gpu.limits().max_compute_work_group_count[0]) * GROUP as u64 - 1;
    let scene = Scene::new(view, count).filter(|_| count as u64 <= most);
    scene.ok_or(VulkanError::TooLarge {
        what: "Gaussians",
        bytes: bytes * count as u64,
        limit: bytes * most,
    })
}

impl SplatDevice for VulkanSplatter {
    fn draw<'a>(
        &'a mut self,
        gaussians: &'a Attributes,
        view: &View,
    ) -> Result<Box<dyn Derivable + 'a>, GradientError> {
        let (count, [width, height]) = (gaussians.len(), view.size());
        let scene = scene_of(&self.gpu, view, count).map_err(failed)?;
        if [self.picture.width(), self.picture.height()] != [width, height] {
            self.picture = Picture::transparent(width, height);
        }
        if gaussians.is_empty() {
            self.picture.clear();
        } else {
            let room = Room::of(count as u64, [width as u64, height as u64]);
            self.form(gaussians, &scene, room).map_err(failed)?;
        }
        Ok(Box::new(Drawn {
            splatter: self,
            count,
            scene,
        }))
    }
}

/// A picture, whose splats are still on the device.
struct Drawn<'a> {
    splatter: &'a mut VulkanSplatter,
    /// Gaussians.
    count: usize,
    scene: Scene,
}

impl Derivable for Drawn<'_> {
    fn picture(&self) -> &Picture {
        &self.splatter.picture
    }

    fn backward(
        &mut self,
        by_pixel: &Picture,
        gradients: &mut Attributes,
    ) -> Result<Twist, GradientError> {
        let picture = &self.splatter.picture;
        by_pixel.check_size("derivatives by pixels", [picture.width(), picture.height()])?;
        check_count("Gaussians", gradients.len(), self.count)?;
        if self.count == 0 {
            return Ok([0.0; 6]);
        }
        let (scene, splatter) = (&self.scene, &mut *self.splatter);
        splatter
            .pull_back(scene, by_pixel, gradients)
            .map_err(failed)
    }
}
