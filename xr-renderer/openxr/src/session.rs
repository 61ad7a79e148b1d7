//! A headset's session: its events, its frames, and the pictures in them.
//!
//! A frame goes `poll`, `wait`, `locate_views`, `canvas`, which is drawn onto, then `show`; or `skip`. All of it on one thread, which waits
//! for the headset in `wait`.

use std::sync::Arc;
use std::time::Duration;

use ash::vk::{self, Handle};
use glam::Affine3A;
use openxr::{
    EnvironmentBlendMode, Event, EventDataBuffer, FrameStream, FrameWaiter, Instance, Vulkan,
};
use renderer_splat::visible_tiles::VisibleTiles;
use renderer_vulkan::gpu::Gpu;

use crate::canvas::Canvas;
use crate::error::{XrContext, XrError};
use crate::ext::FrameTiming;
use crate::ext::depth::DepthRange;
use crate::ext::eye_tracking::Gaze;
use crate::ext::foveation::Foveation;
use crate::ext::or_without;
use crate::ext::passthrough::Passthrough;
use crate::ext::performance::{self, Thermal};
use crate::ext::refresh_rate::{DEFAULT_HZ, RefreshRate};
use crate::ext::threads::{self, Role};
use crate::ext::visibility_mask::VisibilityMask;
use crate::eyes::{EyeImages, EyePicture, FAR, NEAR, RenderPath, Surround, Written};
use crate::frame::{Eyes, Frame, XrClock};
use crate::headset::{Headset, VIEWS};
use crate::input::{Controls, Input};
use crate::layers::{FrameLayers, PlacedPanel};
use crate::panel::{Panel, PanelImage};
use crate::space::{Floor, FloorSpace};
use crate::state::{Lifecycle, SessionAction, SessionState};
use crate::wearer::{Wearer, WearerTrackers};

/// The options of a session.
#[derive(Debug, Clone, Copy)]
pub struct SessionOptions {
    /// Whether the viewer's own room is shown behind the person, where the headset can show it.
    pub room: bool,
    /// Whether eyes' pictures will be read back.
    pub read_back: bool,
    /// The display's rate that is asked for, and kept, Hz; without it 72, and more where frames keep up.
    pub display_hz: Option<f32>,
}

/// What the runtime reported since the last poll.
#[derive(Debug, Clone, Copy, Default)]
pub struct PollResult {
    /// The viewer recentred: their place in floor space is another one now.
    pub recentred: bool,
    /// How the session ended, if it did.
    pub end: Option<SessionEnd>,
}

/// What the headset tracks of the viewer besides the head.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tracks {
    /// Bare hands.
    pub hands: bool,
    /// Foveation follows the viewer's gaze.
    pub foveation_follows_gaze: bool,
}

/// How a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SessionEnd {
    /// It was lost: open the headset again.
    Lost,
    /// The viewer or this program ended it.
    Exited,
}

/// A session of a headset.
pub struct Session {
    // Dropped before the session that it was made with.
    images: EyeImages,
    panel: Option<(Panel, PlacedPanel)>,
    room: Option<Passthrough>,
    input: Input,
    wearer: WearerTrackers,
    refresh: Option<RefreshRate>,
    depth: Option<DepthRange>,
    space: FloorSpace,
    stream: FrameStream<Vulkan>,
    waiter: FrameWaiter,
    session: openxr::Session<Vulkan>,
    instance: Instance,
    gpu: Arc<Gpu>,
    events: EventDataBuffer,
    clock: XrClock,
    lifecycle: Lifecycle,
    blend: EnvironmentBlendMode,
    extent: vk::Extent2D,
    eyes: Option<Eyes>,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session")
            .field("life", &self.lifecycle)
            .field("eyes", &self.eyes)
            .finish_non_exhaustive()
    }
}

impl Session {
    /// A session, which begins when the runtime says so.
    ///
    /// # Errors
    /// If the runtime or the device fails, or the runtime has no images that can be drawn.
    pub fn new(headset: &Headset, options: SessionOptions) -> Result<Self, XrError> {
        let gpu = Arc::clone(headset.gpu());
        let instance = headset.instance.clone();
        let info = openxr::vulkan::SessionCreateInfo {
            instance: gpu.instance().handle().as_raw() as _,
            physical_device: gpu.physical_device().as_raw() as _,
            device: gpu.device().handle().as_raw() as _,
            queue_family_index: gpu.queue_family(),
            queue_index: 0,
        };
        // The session keeps the device alive, which destroying the session may still use.
        let guard = Box::new(Arc::clone(&gpu));
        let (session, waiter, stream) = gpu
            .with_queue(|_| {
                // SAFETY: instance, device and queue were made by this runtime for this system, and live as long as the session.
                unsafe {
                    instance.create_session_with_guard::<Vulkan>(headset.system, &info, guard)
                }
            })
            .during("xrCreateSession")?;
        let extensions = headset.extensions();
        let room = options
            .room
            .then(|| or_without("passthrough", Passthrough::new(&session, headset.system)))
            .flatten();
        let blends = instance
            .enumerate_environment_blend_modes(headset.system, VIEWS)
            .during("xrEnumerateEnvironmentBlendModes")?;
        let sees_through = options.room && room.is_none();
        let blend = if sees_through && blends.contains(&EnvironmentBlendMode::ALPHA_BLEND) {
            EnvironmentBlendMode::ALPHA_BLEND
        } else {
            blends
                .first()
                .copied()
                .unwrap_or(EnvironmentBlendMode::OPAQUE)
        };
        let extent = headset.eye();
        let enabled = extensions.set();
        let depth = or_without("depth", DepthRange::new(&instance, NEAR, FAR));
        let with_depth = depth.is_some();
        or_without("sustained clocks", performance::sustain(&session));
        let foveation = or_without(
            "foveation",
            Foveation::new(&session, headset.system, gpu.features().density_maps),
        );
        let read_back = options.read_back;
        let mask = or_without("a lens' mask", VisibilityMask::new(&session));
        let mut images = EyeImages::new(&gpu, &session, foveation, extent, with_depth, read_back)?;
        images.mask = mask;
        Ok(Self {
            space: FloorSpace::new(&session, enabled.ext_local_floor)?,
            clock: XrClock::new(enabled.khr_convert_timespec_time),
            input: Input::new(&session, headset.system)?,
            wearer: WearerTrackers::new(&session, headset.system)?,
            refresh: or_without(
                "a choice of rates",
                match options.display_hz {
                    Some(hz) => RefreshRate::fixed(&session, hz),
                    None => RefreshRate::new(&session, DEFAULT_HZ),
                },
            ),
            depth,
            room,
            images,
            panel: None,
            stream,
            waiter,
            session,
            instance,
            gpu,
            events: EventDataBuffer::new(),
            lifecycle: Lifecycle::default(),
            blend,
            extent,
            eyes: None,
        })
    }

    /// Whether depth is shown to the compositor where the renderer draws it.
    #[must_use]
    pub fn takes_depth(&self) -> bool {
        self.images.depth.is_some()
    }

    /// The images, for tests to look at.
    #[cfg(test)]
    pub(crate) fn images(&self) -> &EyeImages {
        &self.images
    }

    /// How the last picture was written into the headset's images; none before the first.
    #[must_use]
    pub fn render_path(&self) -> Option<RenderPath> {
        self.images.render_path()
    }

    /// How much of the left and the right picture the lenses show, 0 to 1, where the runtime tells: of the last picture, whose hidden part was not
    /// drawn.
    #[must_use]
    pub fn lenses_show(&self) -> Option<[f64; 2]> {
        let tiles = self.images.mask.as_ref()?.visible_tiles()?;
        Some(tiles.each_ref().map(VisibleTiles::share))
    }

    /// Whether the viewer's own room is behind what is transparent.
    #[must_use]
    pub fn shows_room(&self) -> bool {
        self.room.is_some() || self.blend == EnvironmentBlendMode::ALPHA_BLEND
    }

    /// The display's rate where the headset lets us choose it, Hz.
    #[must_use]
    pub fn refresh_hz(&self) -> Option<f32> {
        self.refresh.as_ref().map(RefreshRate::now_hz)
    }

    /// Whether bare hands are tracked, and whether foveation follows the gaze.
    #[must_use]
    pub fn tracks(&self) -> Tracks {
        Tracks {
            hands: self.input.tracks_hands(),
            foveation_follows_gaze: self.images.follows_gaze(),
        }
    }

    /// How the floor is known.
    #[must_use]
    pub fn floor(&self) -> Floor {
        self.space.kind()
    }

    /// The session's states so far.
    #[must_use]
    pub fn lifecycle(&self) -> &Lifecycle {
        &self.lifecycle
    }

    /// Takes all events there are, and begins and ends the session accordingly.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn poll(&mut self) -> Result<PollResult, XrError> {
        let mut result = PollResult::default();
        while let Some(event) = self
            .instance
            .poll_event(&mut self.events)
            .during("xrPollEvent")?
        {
            match event {
                Event::SessionStateChanged(change) => match self.lifecycle.enter(change.state()) {
                    SessionAction::None => {}
                    SessionAction::Begin => {
                        self.session.begin(VIEWS).during("xrBeginSession")?;
                        or_without(
                            "a thread of rank",
                            threads::register(&self.session, Role::RendererMain),
                        );
                        self.lifecycle.begun();
                    }
                    SessionAction::End => {
                        self.session.end().during("xrEndSession")?;
                        self.lifecycle.ended();
                    }
                    SessionAction::Recreate => result.end = Some(SessionEnd::Lost),
                    SessionAction::Exit => result.end = Some(SessionEnd::Exited),
                },
                Event::InstanceLossPending(_) => result.end = Some(SessionEnd::Lost),
                Event::ReferenceSpaceChangePending(_) => {
                    self.space.moved();
                    self.wearer.moved();
                    result.recentred = true;
                }
                Event::DisplayRefreshRateChangedFB(change) => {
                    if let Some(refresh) = &mut self.refresh {
                        refresh.changed(change.to_display_refresh_rate());
                    }
                }
                Event::PerfSettingsEXT(event) => match Thermal::of(&event) {
                    Some(thermal) if thermal.worsens() => log::warn!("{thermal}"),
                    Some(thermal) => log::info!("{thermal}"),
                    None => {}
                },
                Event::VisibilityMaskChangedKHR(change) => {
                    let ours = change.view_configuration_type() == VIEWS;
                    if let Some(mask) = self.images.mask.as_mut().filter(|_| ours) {
                        mask.renew(change.view_index());
                    }
                }
                Event::EventsLost(lost) => {
                    log::warn!(
                        "the OpenXR runtime dropped {} events",
                        lost.lost_event_count()
                    );
                }
                _ => {}
            }
        }
        if let Some(room) = &mut self.room {
            room.show(matches!(
                self.lifecycle.now(),
                SessionState::Visible | SessionState::Focused
            ));
        }
        Ok(result)
    }

    /// Asks the runtime to end the session, which then tells so through [`Self::poll`].
    ///
    /// # Errors
    /// If it does not run.
    pub fn request_exit(&self) -> Result<(), XrError> {
        self.session.request_exit().during("xrRequestExitSession")
    }

    /// Waits until the headset wants the next frame, and begins it: it has to be shown or skipped.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn wait(&mut self) -> Result<Frame, XrError> {
        let state = self.waiter.wait().during("xrWaitFrame")?;
        self.gpu
            .with_queue(|_| self.stream.begin())
            .during("xrBeginFrame")?;
        let period = u64::try_from(state.predicted_display_period.as_nanos()).unwrap_or(0);
        // A display of less than 1 Hz is none; one of more than 1 kHz neither.
        let period = Duration::from_nanos(period.clamp(1_000_000, 1_000_000_000));
        let time = state.predicted_display_time;
        Ok(Frame {
            time,
            predicted: self.clock.instant(&self.instance, time, period),
            period,
            should_render: state.should_render,
        })
    }

    /// Where the eyes will be when the frame is displayed; the last known place if it is unknown now, and none if it never was known.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn locate_views(&mut self, frame: &Frame) -> Result<Option<Eyes>, XrError> {
        self.space.settle(&self.session, frame.time)?;
        let (flags, views) = self
            .session
            .locate_views(VIEWS, frame.time, &self.space.floor)
            .during("xrLocateViews")?;
        // A headset that has lost tracking still has positions: those it last knew.
        if flags.contains(openxr::ViewStateFlags::ORIENTATION_VALID) {
            let seen = Eyes::of(&views, self.extent.width, self.extent.height);
            self.eyes = seen.or(self.eyes);
        }
        Ok(self.eyes)
    }

    /// The state of the hands when the frame is displayed; nothing while another program has the input.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn controls(&mut self, frame: &Frame) -> Result<Controls, XrError> {
        self.input.sync(frame.time, &self.space.floor)
    }

    /// Where the wearer's head, hands and body are now, and what their face does, or, of a runtime that does not tell its time, when the frame is displayed. After
    /// [`Self::controls`] of the same frame.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn wearer(&mut self, frame: &Frame) -> Result<Wearer, XrError> {
        let now = self.clock.both_clocks(&self.instance);
        let now = now.unwrap_or((frame.predicted, frame.time));
        let floor = &self.space.floor;
        let hands = self.input.wearer(now.1, floor)?;
        let gaze = || self.input.gaze(floor, now);
        self.wearer.locate(floor, now, hands, gaze)
    }

    /// Where the wearer's eyes look now, left and right, or, of a runtime that does not tell its time, when the frame is displayed; nothing of one whose gaze is not tracked. After
    /// [`Self::controls`] of the same frame. No other tracker is started for it.
    pub fn gazes(&mut self, frame: &Frame) -> [Option<Gaze>; 2] {
        let now = self.clock.both_clocks(&self.instance);
        let now = now.unwrap_or((frame.predicted, frame.time));
        let floor = &self.space.floor;
        (self.wearer).gazes(floor, now, || self.input.gaze(floor, now))
    }

    /// Waits until the device has nothing left to do for the session.
    ///
    /// # Errors
    /// [`XrError::Render`] if the device is lost.
    pub fn wait_idle(&self) -> Result<(), XrError> {
        Ok(self.gpu.wait_idle()?)
    }

    /// Reports a frame's timing: whether it was in time, and how long CPU and GPU took for it. The choice of the display's rate uses it.
    pub fn frame_completed(&mut self, frame: &Frame, in_time: bool, busy: Duration) {
        if let Some(refresh) = &mut self.refresh {
            refresh.consider(&FrameTiming {
                display_s: frame.time.as_nanos() as f64 * 1e-9,
                in_time,
                busy_ms: busy.as_secs_f32() * 1e3,
            });
        }
    }

    /// The images that a frame shows, for a renderer to draw what these eyes see: pictures of the headset's size, or smaller. They
    /// are to be read back by [`Self::show`] if `reads`.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn canvas(
        &mut self,
        eyes: &Eyes,
        surround: Surround,
        reads: bool,
    ) -> Result<Canvas<'_>, XrError> {
        Canvas::acquire(&mut self.images, *eyes, surround, reads)
    }

    /// Shows what was drawn onto the last canvas, and ends the frame. Returns the eyes' pictures, where they are to be read
    /// back.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails. The frame is then ended without a picture, if that is still possible, as it is
    /// where nothing was drawn.
    pub fn show(&mut self, frame: Frame) -> Result<Option<[EyePicture; 2]>, XrError> {
        match self.images.release() {
            Ok(Some(released)) => {
                self.end(frame, Some(&released.written), true)?;
                Ok(released.pictures)
            }
            Ok(None) => self.skip(frame).map(|()| None),
            Err(error) => {
                // The first error is returned.
                let _ = self.skip(frame);
                Err(error)
            }
        }
    }

    /// Ends the frame without a new picture.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn skip(&mut self, frame: Frame) -> Result<(), XrError> {
        self.end(frame, None, false)
    }

    /// Ends the frame with only the panel, before the viewer's room where that can be seen.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn show_panel(&mut self, frame: Frame) -> Result<(), XrError> {
        self.end(frame, None, true)
    }

    /// Shows a panel in the room, `width` metres wide, or changes the one that is shown.
    ///
    /// # Errors
    /// [`XrError::Lost`], or a call that fails.
    pub fn hang_panel(
        &mut self,
        image: PanelImage<'_>,
        floor_from_panel: Affine3A,
        width: f32,
    ) -> Result<(), XrError> {
        let placed = PlacedPanel {
            floor_from_panel,
            width,
        };
        match &mut self.panel {
            Some((panel, place)) if panel.fits(image) => {
                *place = placed;
                panel.show(image)
            }
            none => {
                *none = Panel::new(&self.gpu, &self.session, image)?.map(|panel| (panel, placed));
                Ok(())
            }
        }
    }

    /// Removes the panel.
    pub fn remove_panel(&mut self) {
        self.panel = None;
    }

    fn end(
        &mut self,
        frame: Frame,
        written: Option<&Written>,
        with_panel: bool,
    ) -> Result<(), XrError> {
        let surround = written.map_or(Surround::Room, |written| written.surround);
        let layers = FrameLayers {
            room: (self.room.as_ref())
                .filter(|_| surround == Surround::Room)
                .and_then(Passthrough::layer),
            depth: self.depth,
            eyes: written.map(|written| (&self.images, written)),
            panel: (self.panel.as_ref())
                .filter(|_| with_panel)
                .map(|(panel, place)| (panel, *place)),
            floor: &self.space.floor,
            transparent: surround == Surround::Room,
        };
        self.gpu
            .with_queue(|_| layers.end_frame(&mut self.stream, frame.time, self.blend))
    }
}
