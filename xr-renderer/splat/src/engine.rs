//! The renderer's parts on one device: the order of the stages, and their times.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;
use bytemuck::Zeroable;
use renderer_vulkan::clock::{HostClock, HostTimes};
use renderer_vulkan::commands::{Commands, barrier};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::timestamps::Timestamps;
use shaders_spirv::{FrameParams, PackedGaussian};

use crate::back_ends::{BackEndTrial, BackEnds, Redraw};
use crate::camera::{Camera, head_depth_plane, is_rigid};
use crate::cost::dearest;
use crate::drawing::{Drawing, Foreground, Part};
use crate::error::RenderError;
use crate::external_images::{ExternalImages, describe_visible};
use crate::geometry_pass::GeometryPass;
use crate::interrupt::Interrupt;
use crate::limits::MOST_PARTS;
use crate::lists::{self, TileLists};
use crate::motion_bound::{KEPT_FOREGROUND_MOVE, MotionBound};
use crate::options::RendererOptions;
use crate::order::{KEPT_MOVE, KEPT_TURN, Order};
use crate::picture::Image;
use crate::posing::{PosedInput, StateId};
use crate::read_back::ReadBack;
use crate::slot::ForegroundSlot;
use crate::target::Target;
use crate::times::{PictureTime, StageSpans, StageTimes};

/// The renderer's parts on one device.
pub(crate) struct Engine {
    // Dropped first: waits for the device.
    commands: Commands,
    gpu: Arc<Gpu>,
    pub(crate) back_ends: BackEnds,
    geometry: GeometryPass,
    pub(crate) target: Target,
    /// Whether the last picture is in the target.
    is_kept: bool,
    read_back: ReadBack,
    timestamps: Option<Timestamps<10>>,
    clock: HostClock,
    pub(crate) times: StageTimes,
    pub(crate) picture_time: Option<PictureTime>,
    pub(crate) order: Order,
    /// The foreground that `set_foreground` took, rather than a slot of the caller's.
    own: Option<ForegroundSlot>,
    /// Milliseconds the host took to write it, or poses, while they are not drawn yet.
    host_upload: f64,
    max_foreground: u32,
    interrupt: Option<Interrupt>,
}

impl Engine {
    /// Takes all its memory and uploads background and mesh. The sizes are within range.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        options: &RendererOptions,
        trial: Option<BackEndTrial>,
    ) -> Result<Self, RenderError> {
        let RendererOptions {
            width,
            height,
            views,
            ..
        } = *options;
        let target = Target::new(gpu, width, height, views, options.depth)?;
        let mut geometry = GeometryPass::new(gpu, options)?;
        let back_ends = BackEnds::new(gpu, &geometry, &target, options.back_end, trial)?;
        // Made last and so dropped first after an error: its drop waits for the device, which uses the rest.
        let mut commands = Commands::new(gpu)?;
        commands.run("the first clear", |commands| {
            target.record_clear(gpu, commands);
            barrier(gpu, commands);
            geometry.record_static_upload(commands);
        })?;
        geometry.static_upload_done();
        Ok(Self {
            commands,
            back_ends,
            geometry,
            read_back: ReadBack::new(gpu, &target)?,
            timestamps: Timestamps::new(gpu)?,
            target,
            is_kept: true,
            clock: HostClock::new(gpu),
            times: StageTimes::default(),
            picture_time: None,
            order: Order::default(),
            own: None,
            host_upload: 0.0,
            max_foreground: options.max_foreground,
            interrupt: options.interrupt.clone(),
            gpu: Arc::clone(gpu),
        })
    }

    /// See [`crate::renderer::SplatRenderer::set_foreground`].
    pub(crate) fn set_foreground(
        &mut self,
        gaussians: &[PackedGaussian],
    ) -> Result<(), RenderError> {
        // The device may still be reading the last picture's input after an error.
        self.commands.wait()?;
        let slot = match &mut self.own {
            Some(slot) => slot,
            none => none.insert(ForegroundSlot::new(&self.gpu, self.max_foreground)?),
        };
        let start = Instant::now();
        let room = slot.gaussians_mut();
        let too_many = RenderError::TooManyGaussians {
            count: gaussians.len(),
            limit: self.max_foreground,
        };
        let Some(room) = room.get_mut(..gaussians.len()) else {
            return Err(too_many);
        };
        room.copy_from_slice(gaussians);
        let count = u32::try_from(gaussians.len()).map_err(|_| too_many)?;
        slot.set(count, MotionBound::new())?;
        self.host_upload = start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// See [`crate::renderer::SplatRenderer::push_state`].
    pub(crate) fn push_state(&mut self, input: &PosedInput<'_>) -> Result<StateId, RenderError> {
        // The device may still be reading the last poses after an error.
        self.commands.wait()?;
        let start = Instant::now();
        let id = self.geometry.push_state(input)?;
        self.host_upload += start.elapsed().as_secs_f64() * 1e3;
        Ok(id)
    }

    /// See [`crate::renderer::SplatRenderer::draw_with`] and [`crate::renderer::SplatRenderer::draw_onto`].
    pub(crate) fn draw(
        &mut self,
        drawing: &Drawing<'_>,
        mut images: Option<&mut dyn ExternalImages>,
    ) -> Result<(), RenderError> {
        let cameras = drawing.cameras;
        self.check(cameras)?;
        self.check_parts(drawing.foreground)?;
        // The device may still be reading the last picture's cameras and foreground after an error.
        self.commands.wait()?;
        self.geometry.show(drawing.foreground, self.own.as_ref())?;
        if let [camera, ..] = cameras {
            self.target.resize(camera.width, camera.height);
        }
        if let Some(images) = images.as_deref_mut() {
            self.back_ends
                .prepare(&self.geometry, &self.target, images)?;
        }
        let foreground = *self.geometry.sorted();
        let keeps = drawing.keep_order && self.order.is_of(&foreground);
        let needs_order = !keeps && !self.order.serves(cameras, &foreground);
        if needs_order {
            // Noted below: an error in between must not leave the old note beside a new order.
            self.order.forget();
        }
        let mut sorts = needs_order;
        loop {
            let mut frame = self.frame_params(cameras, sorts);
            describe_visible(&mut frame, images.as_deref(), &self.target);
            self.back_ends.describe(&mut frame, &self.target);
            self.geometry.write_frame(&frame);
            self.record_and_run(sorts, images.as_deref())?;
            self.geometry.costs.check()?;
            self.is_kept = !self.back_ends.draws_into(images.as_deref());
            let grown = self.back_ends.has_grown(&self.geometry, &self.target);
            if grown.map_err(|error| self.blame(error))? {
                continue;
            }
            self.read_times()?;
            match self
                .back_ends
                .record_time(self.times.bin + self.times.raster)
            {
                Redraw::No => break,
                // What was drawn is a whole picture. The comparison goes on with the next one.
                _ if self.is_interrupted() => break,
                // The order of the first attempt serves all.
                Redraw::ForComparison => sorts = false,
                Redraw::ForShowing => sorts = needs_order,
            }
        }
        if needs_order {
            self.order.made(cameras, foreground);
        }
        if let Some(images) = images {
            images.finished(!self.is_kept);
        }
        self.geometry.foreground_done();
        self.host_upload = 0.0;
        Ok(())
    }

    /// Where the tiles' lists would be too long, the part that could be left out, if there is one.
    fn blame(&self, error: RenderError) -> RenderError {
        match (error, dearest(&self.geometry.costs.of_parts())) {
            (RenderError::TooManyPairs { limit, .. }, (part, pairs @ 1..)) => {
                RenderError::CostlyPart { part, pairs, limit }
            }
            (error, _) => error,
        }
    }

    /// See [`crate::renderer::SplatRenderer::part_pairs`].
    pub(crate) fn part_pairs(&self) -> [u64; MOST_PARTS] {
        self.geometry.costs.of_parts()
    }

    fn is_interrupted(&self) -> bool {
        (self.interrupt.as_ref()).is_some_and(Interrupt::is_raised)
    }

    /// The last picture of a view, which exists.
    pub(crate) fn read_back(&mut self, view: u32) -> Result<Image, RenderError> {
        self.check_kept()?;
        Ok(self
            .read_back
            .read(&self.gpu, &mut self.commands, &self.target, view)?)
    }

    /// The last depths of a view, which exists.
    pub(crate) fn read_back_depth(&mut self, view: u32) -> Result<Vec<f32>, RenderError> {
        self.check_kept()?;
        Ok(self
            .read_back
            .read_depth(&self.gpu, &mut self.commands, &self.target, view)?)
    }

    /// See [`crate::renderer::SplatRenderer::read_back_lists`].
    pub(crate) fn read_back_lists(&mut self) -> Result<Option<TileLists>, RenderError> {
        self.check_kept()?;
        let Some(tiles) = self.back_ends.tiles() else {
            return Ok(None);
        };
        let (commands, geometry, target) = (&mut self.commands, &self.geometry, &self.target);
        Ok(Some(lists::read(
            &self.gpu, commands, geometry, tiles, target,
        )?))
    }

    fn check_kept(&self) -> Result<(), RenderError> {
        if self.is_kept {
            Ok(())
        } else {
            Err(RenderError::NotKept)
        }
    }

    fn check(&self, cameras: &[Camera]) -> Result<(), RenderError> {
        let Target { layers, most, .. } = self.target;
        if cameras.len() != layers as usize {
            let problem = format!("{} cameras for {layers} view(s)", cameras.len());
            return Err(RenderError::Camera { view: 0, problem });
        }
        for (view, camera) in cameras.iter().enumerate() {
            if let Some(problem) = camera.problem() {
                return Err(RenderError::Camera { view, problem });
            }
            let (width, height) = (camera.width, camera.height);
            let first = cameras.first().map(|camera| (camera.width, camera.height));
            let fits = (1..=most.width).contains(&width) && (1..=most.height).contains(&height);
            if !fits || first != Some((width, height)) {
                let problem = format!(
                    "it makes pictures of {width}x{height} pixels, the renderer of at most {}x{}, all views of one size",
                    most.width, most.height
                );
                return Err(RenderError::Camera { view, problem });
            }
        }
        Ok(())
    }

    /// Whether these parts can be drawn, except for states that are not there.
    fn check_parts(&self, parts: &[Part<'_>]) -> Result<(), RenderError> {
        if parts.len() > MOST_PARTS {
            return Err(RenderError::TooManyParts { parts: parts.len() });
        }
        let limit = self.max_foreground;
        let (mut count, mut posed) = (0, 0);
        for (index, part) in parts.iter().enumerate() {
            if !is_rigid(&part.world_from_part) {
                return Err(RenderError::PartNotRigid { part: index });
            }
            let slot = match part.gaussians {
                Foreground::Set => self.own.as_ref(),
                Foreground::Slot(slot) => Some(slot),
                Foreground::Posed { .. } => {
                    posed += 1;
                    None
                }
            };
            if slot.is_some_and(|slot| !slot.memory().is_on(&self.gpu)) {
                return Err(RenderError::ForeignSlot);
            }
            count += slot.map_or(0, |slot| slot.len() as usize);
        }
        if posed > 1 {
            return Err(RenderError::PosedTwice);
        }
        if count > limit as usize {
            return Err(RenderError::TooManyGaussians { count, limit });
        }
        Ok(())
    }

    fn frame_params(&self, cameras: &[Camera], sorts: bool) -> FrameParams {
        let mut frame = FrameParams::zeroed();
        for (params, camera) in frame.views.iter_mut().zip(cameras) {
            *params = camera.params();
        }
        frame.depth_plane = head_depth_plane(cameras);
        frame.foreground_count = self.geometry.foreground_count();
        frame.total_count = self.geometry.total_count();
        frame.view_count = self.target.layers;
        frame.width = self.target.width;
        frame.height = self.target.height;
        frame.sorts = u32::from(sorts);
        frame.guard_turn = KEPT_TURN;
        frame.guard_move = KEPT_MOVE + KEPT_FOREGROUND_MOVE;
        frame
    }

    fn record_and_run(
        &mut self,
        sorts: bool,
        images: Option<&dyn ExternalImages>,
    ) -> Result<(), VulkanError> {
        let (geometry, back_ends, target) = (&self.geometry, &self.back_ends, &self.target);
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
            geometry.record_upload(commands, sorts);
            point(commands, 1);
            geometry.record_networks(commands);
            point(commands, 2);
            geometry.record_skin(commands);
            point(commands, 3);
            geometry.record_attributes(commands);
            point(commands, 4);
            geometry.record_interpolation(commands);
            point(commands, 5);
            geometry.record_project(commands);
            point(commands, 6);
            if sorts {
                geometry.record_sort(commands);
            }
            point(commands, 7);
            back_ends.record_bin(commands, target);
            point(commands, 8);
            back_ends.record_draw(commands, target, images);
            point(commands, 9);
        })
    }

    /// Reads when the stages of the picture that was just drawn began and ended.
    fn read_times(&mut self) -> Result<(), RenderError> {
        let run = self.commands.last_run();
        let [submitted, finished] = run;
        self.times = StageTimes {
            upload: self.host_upload,
            ..Default::default()
        };
        let mut stages = None;
        if let Some(timestamps) = &self.timestamps {
            let ticks = timestamps.read()?;
            let stage = |index: usize| self.gpu.nanoseconds(ticks[index], ticks[index + 1]) * 1e-6;
            self.times = StageTimes {
                upload: self.host_upload + stage(0),
                networks: stage(1),
                skin: stage(2),
                attributes: stage(3),
                interpolate: stage(4),
                project: stage(5),
                sort: stage(6),
                bin: stage(7),
                raster: stage(8),
            };
            let HostTimes { at, within } = self.clock.to_host(ticks, run)?;
            let span = |index: usize| [at[index], at[index + 1]];
            stages = Some(StageSpans {
                upload: span(0),
                networks: span(1),
                skin: span(2),
                attributes: span(3),
                interpolate: span(4),
                project: span(5),
                sort: span(6),
                bin: span(7),
                raster: span(8),
                within,
            });
        }
        self.picture_time = Some(PictureTime {
            submitted,
            finished,
            stages,
        });
        Ok(())
    }
}
