//! `receive --display window`: the call live in a window. Drag to orbit, scroll to come closer, Escape to leave.

use crate::backdrop::DUSK;
use crate::screen::Screen;
use crate::size::Size;
use crate::stills::RenderSettings;
use crate::until::Until;
use crate::viewpoint::Viewpoint;
use anyhow::{Context, anyhow};
use app_pipeline::lanes::Drawn;
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

/// Shows the call until it is over or the window is closed.
pub(crate) fn show(
    events: EventLoop<()>,
    screen: &mut Screen<'_>,
    viewpoint: Viewpoint,
    until: &Until,
) -> anyhow::Result<()> {
    let Size { width, height } = screen.live.setting().size;
    let mut view = View {
        screen,
        until,
        viewpoint,
        size: (width, height),
        open: None,
        drag: None,
        cursor: PhysicalPosition::default(),
        outcome: Ok(()),
    };
    events
        .run_app(&mut view)
        .context("the window system ended the window")?;
    view.outcome
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

/// A call in its window.
struct View<'a, 'o> {
    screen: &'a mut Screen<'o>,
    until: &'a Until,
    viewpoint: Viewpoint,
    size: (u32, u32),
    open: Option<Open>,
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
                if let (Some(gaze), None) = (&mut self.screen.gaze, self.drag) {
                    gaze.pointed([position.x, position.y], self.size);
                }
                Ok(())
            }
            WindowEvent::CursorLeft { .. } => {
                if let Some(gaze) = &mut self.screen.gaze {
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
        let (width, height) = self.size;
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
        let gpu = Arc::clone(self.screen.live.lanes.renderer().gpu());
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
        if size.width > 0 && size.height > 0 && (size.width, size.height) != self.size {
            self.size = (size.width, size.height);
        }
        Ok(())
    }

    fn draw(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        open.window.request_redraw();
        if self.screen.live.lanes.is_over() || self.until.is_over() {
            events.exit();
            return Ok(());
        }
        let Some(moment) = self.screen.begin()? else {
            std::thread::sleep(WAITING);
            return Ok(());
        };
        let viewpoint = self.screen.seen_from(self.viewpoint);
        let live = &mut self.screen.live;
        let (width, height) = self.size;
        let size = Size { width, height };
        if live.setting().size != size {
            // Once for a picture, not for every step of a drag.
            let setting = live.setting().clone();
            live.set(RenderSettings { size, ..setting })?;
        }
        let backdrop = if live.setting().background.is_some() {
            DUSK
        } else {
            STUDIO
        };
        let camera = viewpoint.camera(moment.floor, moment.heading, width, height);
        if let Drawn::Renewed(gpu) = live.draw(camera)? {
            return open.renew(&gpu);
        }
        let shown = match &mut open.target {
            Some(target) => match target.present(live.lanes.renderer(), backdrop) {
                // The next picture finds that out again, and opens another.
                Err(error) if error.is_device_lost() => PresentOutcome::NotNow,
                shown => shown?,
            },
            None => PresentOutcome::NotNow,
        };
        live.displayed();
        open.counted.1 += 1;
        if open.counted.1 == TITLE_FRAMES {
            let rate = f64::from(TITLE_FRAMES) / open.counted.0.elapsed().as_secs_f64().max(1e-6);
            open.window.set_title(&format!(
                "Mon3tr: {rate:.0} frames/s on {}",
                live.lanes.renderer().gpu().info().name
            ));
            open.counted = (Instant::now(), 0);
        }
        if shown == PresentOutcome::NotNow {
            // Hidden or just changing: no need to hurry.
            std::thread::sleep(HIDDEN);
        }
        Ok(())
    }

    fn orbit(&mut self) {
        if let Some(from) = &mut self.drag {
            #[allow(clippy::cast_possible_truncation, reason = "pixels of a window")]
            let (x, y) = (
                (self.cursor.x - from.x) as f32,
                (self.cursor.y - from.y) as f32,
            );
            *from = self.cursor;
            self.viewpoint
                .orbit((-x * DRAG).to_radians(), (y * DRAG).to_radians());
        }
    }

    fn approach(&mut self, delta: MouseScrollDelta) {
        let notches = match delta {
            MouseScrollDelta::LineDelta(_, lines) => lines,
            #[allow(clippy::cast_possible_truncation, reason = "pixels of one scroll")]
            MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 / 40.0,
        };
        self.viewpoint.approach(0.9f32.powf(notches));
    }
}
