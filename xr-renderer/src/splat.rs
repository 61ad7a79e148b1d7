//! From Gaussians and cameras to finished pictures: the order of the stages, and their times.
//!
//! Image formation is that of 3D Gaussian Splatting (Kerbl et al., 2023): EWA projection with 0.3 px^2
//! added to the covariance's diagonal, alpha = min(0.99, opacity exp(-q/2)) cut at 1/255, front to back
//! by depth. Colours are blended as display values.

use std::sync::Arc;

use ash::vk;
use bytemuck::Zeroable;
use shaders_spirv::{FrameParams, PackedGaussian};

use crate::back_ends::{Again, BackEndTrial, BackEnds};
use crate::camera::{Camera, head_depth_plane};
use crate::commands::{Commands, barrier};
use crate::error::RenderError;
use crate::front::Front;
use crate::gpu::Gpu;
use crate::options::{BackEnd, RendererOptions};
use crate::order::{KEPT_FOREGROUND_MOVE, KEPT_MOVE, KEPT_TURN, Order};
use crate::picture::Image;
use crate::read_back::ReadBack;
use crate::target::Target;
use crate::timestamps::{StageTimes, Timestamps};

/// Widest and highest picture: a tile's column and row are 8 bits each.
const MOST_PIXELS: u32 = 4096;

/// Draws Gaussians into one or two views, sorted once for both: a foreground that changes, and a background that
/// does not.
pub struct SplatRenderer {
    // Dropped first: waits for the device.
    commands: Commands,
    gpu: Arc<Gpu>,
    back_ends: BackEnds,
    front: Front,
    target: Target,
    read_back: ReadBack,
    timestamps: Option<Timestamps<6>>,
    times: StageTimes,
    order: Order,
    /// Milliseconds the host took to write the foreground that is not drawn yet.
    host_upload: f64,
    options: RendererOptions,
}

impl std::fmt::Debug for SplatRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SplatRenderer")
            .field("gpu", &self.gpu)
            .field("max_foreground", &self.options.max_foreground)
            .field("width", &self.target.width)
            .field("height", &self.target.height)
            .field("views", &self.target.layers)
            .finish_non_exhaustive()
    }
}

impl SplatRenderer {
    /// A renderer for pictures of one size with one or two views. All memory is taken here, except that
    /// the tiles' lists grow when Gaussians are larger on the screen than a person's are; the background is uploaded.
    ///
    /// # Errors
    /// A size out of range, or more memory than the device has.
    pub fn new(gpu: Arc<Gpu>, options: &RendererOptions) -> Result<Self, RenderError> {
        let RendererOptions {
            max_foreground,
            width,
            height,
            views,
            ..
        } = *options;
        let sizes = 1..=MOST_PIXELS;
        if !sizes.contains(&width) || !sizes.contains(&height) || !(1..=2).contains(&views) {
            return Err(RenderError::PictureSize {
                width,
                height,
                views,
            });
        }
        let background = options.background.as_deref();
        let target = Target::new(&gpu, width, height, views, options.depth)?;
        let mut front = Front::new(&gpu, max_foreground, background, options.filter, views)?;
        let back_ends = BackEnds::new(&gpu, &front, &target, options.back_end)?;
        // Made last and so dropped first after an error: its drop waits for the device, which uses the rest.
        let mut commands = Commands::new(&gpu)?;
        commands.run("the first clear", |commands| {
            clear(&gpu, commands, &target);
            front.record_background(commands);
        })?;
        front.background_is_there();
        Ok(Self {
            commands,
            back_ends,
            front,
            read_back: ReadBack::new(&gpu, &target)?,
            timestamps: Timestamps::new(&gpu)?,
            target,
            times: StageTimes::default(),
            order: Order::default(),
            host_upload: 0.0,
            options: options.clone(),
            gpu,
        })
    }

    /// Takes another foreground (world space) for the pictures that follow; at first there is none.
    ///
    /// Gaussians with a number that is not finite are left out, as are those behind a near plane.
    ///
    /// # Errors
    /// Too many Gaussians, or a device that fails.
    pub fn set_foreground(&mut self, gaussians: &[PackedGaussian]) -> Result<(), RenderError> {
        let limit = self.options.max_foreground;
        let count = u32::try_from(gaussians.len())
            .ok()
            .filter(|count| *count <= limit)
            .ok_or(RenderError::TooManyGaussians {
                count: gaussians.len(),
                limit,
            })?;
        // The device may still be reading the last picture's input after an error.
        self.commands.settle()?;
        self.order.foreground_changed(gaussians);
        self.host_upload = self.front.write_foreground(gaussians, count);
        Ok(())
    }

    /// Draws foreground and background as each camera sees them, and waits until they are drawn.
    ///
    /// The Gaussians are sorted anew only where the head or the foreground moved enough to change the order.
    ///
    /// # Errors
    /// Cameras that do not fit the renderer, more splats than the tiles' lists can hold, or a device that fails.
    pub fn draw(&mut self, cameras: &[Camera]) -> Result<(), RenderError> {
        self.check(cameras)?;
        // The device may still be reading the last picture's cameras after an error.
        self.commands.settle()?;
        let needs_order = !self.order.serves(cameras);
        if needs_order {
            // Made below: what fails on the way must not leave the old note beside a new order.
            self.order.forget();
        }
        let mut sorts = needs_order;
        loop {
            let mut frame = self.frame_params(cameras, sorts);
            self.back_ends.describe(&mut frame);
            self.front.write_frame(&frame);
            self.record_and_run(sorts)?;
            if self.back_ends.has_grown(&self.front, &self.target)? {
                continue;
            }
            self.times = self.read_times()?;
            match self.back_ends.took(self.times.bin + self.times.raster) {
                Again::No => break,
                // The order of the first attempt serves all.
                Again::ForComparison => sorts = false,
                Again::ForShowing => sorts = needs_order,
            }
        }
        if needs_order {
            self.order.made(cameras);
        }
        self.front.foreground_is_there();
        self.host_upload = 0.0;
        Ok(())
    }

    /// Opens the device again after it was lost and makes the renderer as it was, the background from the host's copy.
    /// The foreground is to be set again. Returns the new device.
    ///
    /// # Errors
    /// No device any more, or as [`Self::new`].
    pub fn recover(&mut self) -> Result<Arc<Gpu>, RenderError> {
        let gpu = self.gpu.reopen()?;
        *self = Self::new(Arc::clone(&gpu), &self.options)?;
        Ok(gpu)
    }

    /// Makes the next picture sort its Gaussians, whether they moved or not.
    pub fn forget_order(&mut self) {
        self.order.forget();
    }

    /// The back end that draws the next picture.
    pub fn back_end(&self) -> BackEnd {
        self.back_ends.present()
    }

    /// How the two back ends compared on the first picture; nothing before it, where one was asked for, or where the
    /// device has no clock.
    pub fn back_end_trial(&self) -> Option<BackEndTrial> {
        self.back_ends.trial()
    }

    /// What the renderer was made for.
    pub fn options(&self) -> &RendererOptions {
        &self.options
    }

    /// How long the stages of the last picture took.
    pub fn stage_times(&self) -> StageTimes {
        self.times
    }

    /// (Gaussian, tile) pairs in the last picture, all views together; 0 where quads drew it.
    pub fn tile_pairs(&self) -> u32 {
        self.back_ends.tile_pairs()
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
        self.check_view(view)?;
        self.read_back
            .read(&self.gpu, &mut self.commands, &self.target, view)
    }

    /// The last picture's depth in metres times its alpha, row by row from the top: divided by alpha, where that is
    /// not 0, it is the mean depth along the view's axis of what the pixel shows.
    ///
    /// # Errors
    /// A renderer that was not made to draw depth, no such view, or a device that fails.
    pub fn read_back_depth(&mut self, view: u32) -> Result<Vec<f32>, RenderError> {
        self.check_view(view)?;
        if !self.target.has_depth() {
            return Err(RenderError::NoDepth);
        }
        self.read_back
            .read_depth(&self.gpu, &mut self.commands, &self.target, view)
    }

    /// Where the pictures lie on the device.
    pub(crate) fn target(&self) -> &Target {
        &self.target
    }

    /// The device it draws on.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    fn check_view(&self, view: u32) -> Result<(), RenderError> {
        let views = self.target.layers;
        if view < views {
            Ok(())
        } else {
            Err(RenderError::NoSuchView { view, views })
        }
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

    fn frame_params(&self, cameras: &[Camera], sorts: bool) -> FrameParams {
        let mut frame = FrameParams::zeroed();
        for (params, camera) in frame.views.iter_mut().zip(cameras) {
            *params = camera.params();
        }
        frame.depth_plane = head_depth_plane(cameras);
        frame.foreground_count = self.front.foreground_count();
        frame.total_count = self.front.total_count();
        frame.view_count = self.target.layers;
        frame.width = self.target.width;
        frame.height = self.target.height;
        frame.sorts = u32::from(sorts);
        frame.guard_turn = KEPT_TURN;
        frame.guard_move = KEPT_MOVE + KEPT_FOREGROUND_MOVE;
        frame
    }

    fn record_and_run(&mut self, sorts: bool) -> Result<(), RenderError> {
        let (front, back_ends, target) = (&self.front, &self.back_ends, &self.target);
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
            front.record_upload(commands, sorts);
            point(commands, 1);
            front.record_project(commands);
            point(commands, 2);
            if sorts {
                front.record_sort(commands);
            }
            point(commands, 3);
            back_ends.record_bin(commands, target);
            point(commands, 4);
            back_ends.record_draw(commands, target);
            point(commands, 5);
        })
    }

    fn read_times(&self) -> Result<StageTimes, RenderError> {
        let Some(timestamps) = &self.timestamps else {
            return Ok(StageTimes {
                upload: self.host_upload,
                ..Default::default()
            });
        };
        let [start, uploaded, projected, sorted, binned, drawn] = timestamps.read()?;
        Ok(StageTimes {
            upload: self.host_upload + uploaded - start,
            project: projected - uploaded,
            sort: sorted - projected,
            bin: binned - sorted,
            raster: drawn - binned,
        })
    }
}

/// Makes a new target transparent.
fn clear(gpu: &Gpu, commands: vk::CommandBuffer, target: &Target) {
    // SAFETY: the command buffer is being recorded; the buffers can be a copy's target.
    unsafe {
        let device = gpu.device();
        device.cmd_fill_buffer(commands, target.buffer.handle(), 0, vk::WHOLE_SIZE, 0);
        device.cmd_fill_buffer(commands, target.depth.handle(), 0, vk::WHOLE_SIZE, 0);
    }
    barrier(gpu, commands);
}
