//! A window: people live. Drag to orbit, scroll to come closer, Escape to leave.

use crate::backdrop::DUSK;
use crate::controls::Controls;
use crate::flat::{self, display_error};
use crate::gaze::Gaze;
use crate::size::{Size, Views};
use crate::until::Until;
use crate::viewpoint::{Viewpoint, eyes};
use anyhow::{Context, anyhow};
use app_pipeline::lanes::Drawn;
use app_session::display::{
    Display, DisplayNeeds, FlatView, LiveSession, LoadBackground, SessionError,
};
use renderer_splat::picture::Backdrop;
use renderer_splat::window::{PresentOutcome, WindowTarget};
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::{PhysicalPosition, PhysicalSize};
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::keyboard::{Key, NamedKey};
use winit::window::{Window, WindowId};

/// What stands behind the person.
const STUDIO: Backdrop = Backdrop::Gradient {
    top: [0.80, 0.83, 0.87],
    bottom: [0.70, 0.71, 0.73],
};

/// Degrees of orbit per pixel of drag.
const DRAG: f32 = 0.3;

/// Pause before looking again whether the first frame has come.
const WAITING: Duration = Duration::from_millis(5);

/// Pause between frames while the window cannot show any.
const HIDDEN: Duration = Duration::from_millis(50);

/// Frames between updates of the rate in the title.
const TITLE_FRAMES: u32 = 30;

/// Connects to the window system; without one, says what to do `instead`.
pub(crate) fn events(instead: &str) -> anyhow::Result<EventLoop<()>> {
    // winit's own text names a line of its source; its cause is always the same.
    EventLoop::new().map_err(|error| {
        log::debug!("{error}");
        anyhow!("a window needs a display, and there is none: {instead}")
    })
}

/// The window as a session's display, until the session is over or the window is closed.
pub(crate) struct WindowDisplay<'a> {
    /// Until it is shown.
    pub(crate) events: Option<EventLoop<()>>,
    pub(crate) needs: DisplayNeeds,
    pub(crate) background: Option<LoadBackground<'a>>,
    pub(crate) views: Views,
    pub(crate) viewpoint: Viewpoint,
    /// Moves the camera, if there is one.
    pub(crate) gaze: Option<Gaze>,
    pub(crate) until: &'a Until,
    /// Size of the last picture, pixels.
    pub(crate) size: Size,
    /// When the first picture with people in it was begun.
    pub(crate) first: Option<Instant>,
    /// What keys do, in a call both ways.
    pub(crate) controls: Option<Controls>,
}

impl Display for WindowDisplay<'_> {
    fn needs(&mut self) -> Result<DisplayNeeds, SessionError> {
        Ok(self.needs.clone())
    }

    fn show(&mut self, session: LiveSession<'_>) -> Result<(), SessionError> {
        let events = self.events.take().ok_or(SessionError::ShownAlready)?;
        let asked = self.viewpoint;
        let hertz = self.needs.period.as_secs_f64().recip();
        let mut view = View {
            flat: FlatView::new(&session, hertz, self.background.take()),
            session,
            display: self,
            open: None,
            asked,
            framed: None,
            drag: None,
            cursor: PhysicalPosition::default(),
            outcome: Ok(()),
        };
        let ended = (events.run_app(&mut view)).context("the window system ended the window");
        let View { flat, outcome, .. } = view;
        self.first = flat.first();
        ended.and(outcome).map_err(display_error)
    }
}

/// The window while it is open.
struct Open {
    window: Arc<Window>,
    /// Only without one while it is taken to another device.
    target: Option<WindowTarget>,
    counted: (Instant, u32),
}

impl Open {
    /// Takes the window to another device.
    fn renew(&mut self, gpu: &Arc<Gpu>) -> anyhow::Result<()> {
        // A window belongs to one device at a time.
        self.target = None;
        let size = self.window.inner_size();
        let target = WindowTarget::new(gpu, Arc::clone(&self.window), size.width, size.height)
            .context("cannot draw into the window: --display offscreen draws pictures instead")?;
        self.target = Some(target);
        Ok(())
    }
}

/// A session in its window.
struct View<'a, 'd> {
    session: LiveSession<'a>,
    flat: FlatView<'d>,
    display: &'a mut WindowDisplay<'d>,
    open: Option<Open>,
    /// The viewpoint that was asked for, of one person.
    asked: Viewpoint,
    /// From where all people were seen last, if nobody had turned the camera.
    framed: Option<Viewpoint>,
    /// Where the cursor was when the last part of a drag was taken.
    drag: Option<PhysicalPosition<f64>>,
    cursor: PhysicalPosition<f64>,
    outcome: anyhow::Result<()>,
}

impl ApplicationHandler for View<'_, '_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let outcome = self.open(events);
        self.settle(events, outcome);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let outcome = match event {
            WindowEvent::CloseRequested => {
                events.exit();
                Ok(())
            }
            WindowEvent::KeyboardInput { event, .. }
                if event.logical_key == Key::Named(NamedKey::Escape) =>
            {
                events.exit();
                Ok(())
            }
            WindowEvent::KeyboardInput { event, .. }
                if event.logical_key == Key::Named(NamedKey::Space) =>
            {
                self.hold_to_talk(event.state == ElementState::Pressed);
                Ok(())
            }
            // A key that is let go elsewhere is not told.
            WindowEvent::Focused(false) => {
                self.hold_to_talk(false);
                Ok(())
            }
            WindowEvent::KeyboardInput { event, .. } if event.state == ElementState::Pressed => {
                let controls = self.display.controls.as_ref().filter(|_| !event.repeat);
                if let (Some(controls), Key::Character(key)) = (controls, &event.logical_key) {
                    key.chars().for_each(|key| {
                        controls.press(key);
                    });
                }
                Ok(())
            }
            WindowEvent::Resized(size) => self.resize(size),
            WindowEvent::RedrawRequested => self.draw(events),
            WindowEvent::MouseInput {
                state,
                button: MouseButton::Left,
                ..
            } => {
                self.drag = (state == ElementState::Pressed).then_some(self.cursor);
                Ok(())
            }
            WindowEvent::CursorMoved { position, .. } => {
                self.cursor = position;
                self.orbit();
                // A drag turns the camera itself.
                let Size { width, height } = self.display.size;
                if let (Some(gaze), None) = (&mut self.display.gaze, self.drag) {
                    gaze.pointed([position.x, position.y], (width, height));
                }
                Ok(())
            }
            WindowEvent::CursorLeft { .. } => {
                if let Some(gaze) = &mut self.display.gaze {
                    gaze.left(Instant::now());
                }
                Ok(())
            }
            WindowEvent::MouseWheel { delta, .. } => {
                self.approach(delta);
                Ok(())
            }
            _ => Ok(()),
        };
        self.settle(events, outcome);
    }
}

impl View<'_, '_> {
    /// Keeps the first error and leaves.
    fn settle(&mut self, events: &ActiveEventLoop, outcome: anyhow::Result<()>) {
        if outcome.is_err() && self.outcome.is_ok() {
            self.outcome = outcome;
            events.exit();
        }
    }

    fn open(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        if self.open.is_some() {
            return Ok(());
        }
        let Size { width, height } = self.display.size;
        let attributes = Window::default_attributes()
            .with_title("Mon3tr")
            .with_inner_size(PhysicalSize::new(width, height));
        let window = Arc::new(
            events
                .create_window(attributes)
                .context("cannot open a window")?,
        );
        let size = window.inner_size();
        let now = Instant::now();
        window.request_redraw();
        let mut open = Open {
            window,
            target: None,
            counted: (now, 0),
        };
        let gpu = Arc::clone(self.session.lanes.renderer().gpu());
        open.renew(&gpu)?;
        self.open = Some(open);
        self.resize(size)
    }

    fn resize(&mut self, size: PhysicalSize<u32>) -> anyhow::Result<()> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        if let Some(target) = &mut open.target {
            target.resize(size.width, size.height);
        }
        // A minimised window has no area: keep what there is until it comes back.
        if size.width > 0 && size.height > 0 {
            self.display.size = Size {
                width: size.width,
                height: size.height,
            };
        }
        Ok(())
    }

    fn draw(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        open.window.request_redraw();
        let session = &mut self.session;
        let control = session.control;
        let Some(_step) = control.try_step() else {
            std::thread::sleep(HIDDEN);
            return Ok(());
        };
        let is_over = session.lanes.is_over()
            || session.control.is_leaving()
            || self.display.until.is_over(self.flat.shown());
        if is_over {
            events.exit();
            return Ok(());
        }
        let Some(people) = self.flat.begin(session)? else {
            std::thread::sleep(WAITING);
            return Ok(());
        };
        let WindowDisplay {
            size,
            views,
            viewpoint,
            gaze,
            ..
        } = &mut *self.display;
        let Size { width, height } = *size;
        let framed = flat::around(self.asked, &people, *size);
        match self.framed.replace(framed) {
            None => *viewpoint = framed,
            // People come and go, and the camera stays turned as it is.
            Some(before) => viewpoint.approach(framed.distance() / before.distance()),
        }
        let present = session.lanes.renderer().options();
        if (present.width, present.height) != (width, height) {
            // Once for a picture, not for every step of a drag.
            session.resize(width, height)?;
        }
        let backdrop = if session.lanes.renderer().options().background.is_some() {
            DUSK
        } else {
            STUDIO
        };
        let camera = flat::camera(*viewpoint, gaze.as_mut(), &people, *size);
        let cameras = eyes(camera, *views);
        if let Drawn::Renewed(gpu) = session.lanes.draw(&cameras)? {
            return open.renew(&gpu);
        }
        let shown = match &mut open.target {
            Some(target) => match target.present(session.lanes.renderer(), backdrop) {
                // The next picture finds that out again, and opens another.
                Err(error) if error.is_device_lost() => PresentOutcome::NotNow,
                shown => shown?,
            },
            None => PresentOutcome::NotNow,
        };
        self.flat.displayed(session, &cameras);
        open.counted.1 += 1;
        if open.counted.1 == TITLE_FRAMES {
            let rate = f64::from(TITLE_FRAMES) / open.counted.0.elapsed().as_secs_f64().max(1e-6);
            let speakers = (self.display.controls.as_ref()).map(Controls::speakers);
            let speakers = speakers.filter(|speakers| !speakers.is_empty());
            let who = speakers.map_or_else(String::new, |names| {
                format!(" - {} speaking", names.join(", "))
            });
            open.window.set_title(&format!(
                "Mon3tr: {rate:.0} frames/s on {}{who}",
                session.lanes.renderer().gpu().info().name
            ));
            open.counted = (Instant::now(), 0);
        }
        if shown == PresentOutcome::NotNow {
            // Hidden or just changing: no need to hurry.
            std::thread::sleep(HIDDEN);
        }
        Ok(())
    }

    fn hold_to_talk(&self, is_held: bool) {
        if let Some(controls) = &self.display.controls {
            controls.hold_to_talk(is_held);
        }
    }

    fn orbit(&mut self) {
        if let Some(from) = &mut self.drag {
            #[allow(clippy::cast_possible_truncation, reason = "pixels of a window")]
            let (x, y) = (
                (self.cursor.x - from.x) as f32,
                (self.cursor.y - from.y) as f32,
            );
            *from = self.cursor;
            self.display
                .viewpoint
                .orbit((-x * DRAG).to_radians(), (y * DRAG).to_radians());
        }
    }

    fn approach(&mut self, delta: MouseScrollDelta) {
        let notches = match delta {
            MouseScrollDelta::LineDelta(_, lines) => lines,
            #[allow(clippy::cast_possible_truncation, reason = "pixels of one scroll")]
            MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 / 40.0,
        };
        self.display.viewpoint.approach(0.9f32.powf(notches));
    }
}
