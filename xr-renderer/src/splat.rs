//! From Gaussians and cameras to finished pictures: the order of the stages, and their times.
//!
//! Image formation is that of 3D Gaussian Splatting (Kerbl et al., 2023): EWA projection with 0.3 px^2
//! added to the covariance's diagonal, alpha = min(0.99, opacity exp(-q/2)) cut at 1/255, front to back
//! by depth. Colours are blended as display values.

use std::sync::Arc;

use ash::vk;
use bytemuck::Zeroable;
use shaders_spirv::{FrameParams, PackedGaussian};

use crate::camera::{Camera, head_depth_plane};
use crate::commands::{Commands, barrier};
use crate::error::RenderError;
use crate::front::Front;
use crate::gpu::Gpu;
use crate::picture::Image;
use crate::read_back::ReadBack;
use crate::target::Target;
use crate::tiles::Tiles;
use crate::timestamps::{StageTimes, Timestamps};

/// Widest and highest picture: a tile's column and row are 8 bits each.
const MOST_PIXELS: u32 = 4096;

/// Draws Gaussians into one or two views, sorted once for both.
pub struct SplatRenderer {
    // Dropped first: waits for the device.
    commands: Commands,
    gpu: Arc<Gpu>,
    tiles: Tiles,
    front: Front,
    target: Target,
    read_back: ReadBack,
    timestamps: Option<Timestamps<6>>,
    times: StageTimes,
    max_gaussians: u32,
}

impl std::fmt::Debug for SplatRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SplatRenderer")
            .field("gpu", &self.gpu)
            .field("max_gaussians", &self.max_gaussians)
            .field("width", &self.target.width)
            .field("height", &self.target.height)
            .field("views", &self.target.layers)
            .finish_non_exhaustive()
    }
}

impl SplatRenderer {
    /// A renderer for pictures of one size with one or two views. All memory is taken here, except that
    /// the tiles' lists grow when Gaussians are larger on the screen than a person's are.
    ///
    /// # Errors
    /// A size out of range, or more memory than the device has.
    pub fn new(
        gpu: Arc<Gpu>,
        max_gaussians: u32,
        width: u32,
        height: u32,
        views: u32,
    ) -> Result<Self, RenderError> {
        let sizes = 1..=MOST_PIXELS;
        if !sizes.contains(&width) || !sizes.contains(&height) || !(1..=2).contains(&views) {
            return Err(RenderError::PictureSize {
                width,
                height,
                views,
            });
        }
        let target = Target::new(&gpu, width, height, views)?;
        let front = Front::new(&gpu, max_gaussians, views)?;
        let tiles = Tiles::new(&gpu, &front, &target, max_gaussians)?;
        // Made last and so dropped first after an error: its drop waits for the device, which uses the rest.
        let mut commands = Commands::new(&gpu)?;
        commands.run("the first clear", |commands| clear(&gpu, commands, &target))?;
        Ok(Self {
            commands,
            tiles,
            front,
            read_back: ReadBack::new(&gpu, &target)?,
            timestamps: Timestamps::new(&gpu)?,
            target,
            times: StageTimes::default(),
            max_gaussians,
            gpu,
        })
    }

    /// Draws `gaussians` (world space) as each camera sees them, and waits until they are drawn.
    ///
    /// Gaussians with a number that is not finite are left out, as are those behind a near plane.
    ///
    /// # Errors
    /// Too many Gaussians, cameras that do not fit the renderer, more splats than the tiles' lists can
    /// hold, or a device that fails.
    pub fn render(
        &mut self,
        gaussians: &[PackedGaussian],
        cameras: &[Camera],
    ) -> Result<(), RenderError> {
        let count = u32::try_from(gaussians.len())
            .ok()
            .filter(|count| *count <= self.max_gaussians)
            .ok_or(RenderError::TooManyGaussians {
                count: gaussians.len(),
                limit: self.max_gaussians,
            })?;
        self.check(cameras)?;
        // The device may still be reading the last picture's input after an error.
        self.commands.settle()?;
        let mut frame = self.frame_params(count, cameras);
        let host_upload = self.front.write_gaussians(gaussians);
        loop {
            self.tiles.describe(&mut frame);
            self.front.write_frame(&frame);
            self.draw(count)?;
            let wanted = self.tiles.pairs_wanted();
            if wanted <= self.tiles.pair_capacity() {
                break;
            }
            self.tiles.grow(wanted, &self.front, &self.target)?;
        }
        self.times = self.read_times(host_upload)?;
        Ok(())
    }

    /// How long the stages of the last picture took.
    pub fn stage_times(&self) -> StageTimes {
        self.times
    }

    /// (Gaussian, tile) pairs in the last picture, all views together.
    pub fn tile_pairs(&self) -> u32 {
        self.tiles.pairs_wanted()
    }

    /// How many views a picture has.
    pub fn views(&self) -> u32 {
        self.target.layers
    }

    /// The last picture of a view; all transparent before the first.
    ///
    /// # Errors
    /// No such view, or a device that fails.
    pub fn read_back(&mut self, view: u32) -> Result<Image, RenderError> {
        if view >= self.target.layers {
            return Err(RenderError::NoSuchView {
                view,
                views: self.target.layers,
            });
        }
        self.read_back
            .read(&self.gpu, &mut self.commands, &self.target, view)
    }

    /// Where the pictures lie on the device.
    pub(crate) fn target(&self) -> &Target {
        &self.target
    }

    /// The device it draws on.
    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    fn check(&self, cameras: &[Camera]) -> Result<(), RenderError> {
        let Target {
            width,
            height,
            layers,
            ..
        } = self.target;
        if cameras.len() != layers as usize {
            let problem = format!("{} cameras for {layers} view(s)", cameras.len());
            return Err(RenderError::Camera { view: 0, problem });
        }
        for (view, camera) in cameras.iter().enumerate() {
            if let Some(problem) = camera.problem() {
                return Err(RenderError::Camera { view, problem });
            }
            if (camera.width, camera.height) != (width, height) {
                let problem = format!(
                    "it makes pictures of {}x{} pixels, the renderer of {width}x{height}",
                    camera.width, camera.height
                );
                return Err(RenderError::Camera { view, problem });
            }
        }
        Ok(())
    }

    fn frame_params(&self, count: u32, cameras: &[Camera]) -> FrameParams {
        let mut frame = FrameParams::zeroed();
        for (params, camera) in frame.views.iter_mut().zip(cameras) {
            *params = camera.params();
        }
        frame.depth_plane = head_depth_plane(cameras);
        frame.gaussian_count = count;
        frame.view_count = self.target.layers;
        frame.width = self.target.width;
        frame.height = self.target.height;
        frame
    }

    fn draw(&mut self, count: u32) -> Result<(), RenderError> {
        let (front, tiles, target) = (&self.front, &self.tiles, &self.target);
        let timestamps = self.timestamps.as_ref();
        let point = |commands: vk::CommandBuffer, index: usize| {
            if let Some(timestamps) = timestamps {
                timestamps.record_point(commands, index);
            }
        };
        self.commands.run("drawing", |commands| {
            if let Some(timestamps) = timestamps {
                timestamps.record_reset(commands);
            }
            point(commands, 0);
            front.record_upload(commands, count);
            point(commands, 1);
            front.record_project(commands, count);
            point(commands, 2);
            front.record_sort(commands, count);
            point(commands, 3);
            tiles.record_bin(commands, target);
            point(commands, 4);
            tiles.record_raster(commands);
            point(commands, 5);
        })
    }

    fn read_times(&self, host_upload: f64) -> Result<StageTimes, RenderError> {
        let Some(timestamps) = &self.timestamps else {
            return Ok(StageTimes {
                upload: host_upload,
                ..Default::default()
            });
        };
        let [start, uploaded, projected, sorted, binned, drawn] = timestamps.read()?;
        Ok(StageTimes {
            upload: host_upload + uploaded - start,
            project: projected - uploaded,
            sort: sorted - projected,
            bin: binned - sorted,
            raster: drawn - binned,
        })
    }
}

/// Makes a new target transparent.
fn clear(gpu: &Gpu, commands: vk::CommandBuffer, target: &Target) {
    // SAFETY: the command buffer is being recorded; the buffer can be a copy's target.
    unsafe {
        gpu.device()
            .cmd_fill_buffer(commands, target.buffer.handle(), 0, vk::WHOLE_SIZE, 0);
    }
    barrier(gpu, commands);
}
