//! The preview's window: it shows the newest picture that was composed.

use super::{HandOver, Shot};
use crate::size::Size;
use anyhow::Context;
use image::RgbImage;
use renderer_splat::host_picture::HostPicture;
use renderer_splat::picture::Backdrop;
use renderer_splat::window::WindowTarget;
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::keyboard::{Key, NamedKey};
use winit::window::{Window, WindowId};

/// Beside the picture, where the window has another shape.
const AROUND: Backdrop = Backdrop::Gradient {
    top: [0.07, 0.08, 0.10],
    bottom: [0.07, 0.08, 0.10],
};

/// Shows `pictures` until the window is closed, or `shots` is: each event that the loop is sent says that there may be a new one.
pub(super) fn show(
    events: EventLoop<()>,
    gpu: &Arc<Gpu>,
    size: Size,
    shots: &HandOver<Shot>,
    pictures: &HandOver<RgbImage>,
) -> anyhow::Result<()> {
    let mut view = View {
        gpu,
        size,
        shots,
        pictures,
        open: None,
        outcome: Ok(()),
    };
    let ended = (events.run_app(&mut view)).context("the window system ended the window");
    ended.and(view.outcome)
}

struct View<'a> {
    gpu: &'a Arc<Gpu>,
    size: Size,
    shots: &'a HandOver<Shot>,
    pictures: &'a HandOver<RgbImage>,
    open: Option<Open>,
    outcome: anyhow::Result<()>,
}

/// The window while it is open.
struct Open {
    target: WindowTarget,
    window: Arc<Window>,
    picture: HostPicture,
}

impl Open {
    fn new(events: &ActiveEventLoop, gpu: &Arc<Gpu>, size: Size) -> anyhow::Result<Self> {
        let Size { width, height } = size;
        let attributes = Window::default_attributes()
            .with_title("Mon3tr: preview")
            .with_inner_size(PhysicalSize::new(width, height));
        let window = events.create_window(attributes);
        let window = Arc::new(window.context("cannot open a window")?);
        let inner = window.inner_size();
        let target = WindowTarget::new(gpu, Arc::clone(&window), inner.width, inner.height);
        Ok(Self {
            target: target.context("cannot draw into the window: leave out --preview")?,
            window,
            picture: HostPicture::new(gpu, width, height)?,
        })
    }
}

impl View<'_> {
    /// Takes the newest picture, if there is one.
    fn renew(&mut self) -> anyhow::Result<()> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        if let Some(newest) = self.pictures.take_now() {
            let (width, height) = newest.dimensions();
            if open.picture.size() != [width, height] {
                open.picture = HostPicture::new(self.gpu, width, height)?;
            }
            open.picture.write(&newest);
            open.window.request_redraw();
        }
        Ok(())
    }

    fn present(&mut self) -> anyhow::Result<()> {
        if let Some(open) = &mut self.open {
            // Where the window cannot show it now, the next picture comes soon.
            open.target.present_picture(&open.picture, AROUND)?;
        }
        Ok(())
    }

    /// Keeps the first error and leaves.
    fn settle(&mut self, events: &ActiveEventLoop, outcome: anyhow::Result<()>) {
        if outcome.is_err() && self.outcome.is_ok() {
            self.outcome = outcome;
            events.exit();
        }
    }
}

impl ApplicationHandler for View<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none() {
            match Open::new(events, self.gpu, self.size) {
                Ok(open) => self.open = Some(open),
                Err(error) => self.settle(events, Err(error)),
            }
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, (): ()) {
        if self.shots.is_closed() {
            events.exit();
            return;
        }
        let outcome = self.renew();
        self.settle(events, outcome);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::KeyboardInput { event, .. }
                if event.logical_key == Key::Named(NamedKey::Escape) =>
            {
                events.exit();
            }
            WindowEvent::Resized(size) => {
                if let Some(open) = &mut self.open {
                    open.target.resize(size.width, size.height);
                    open.window.request_redraw();
                }
            }
            WindowEvent::RedrawRequested => {
                let outcome = self.present();
                self.settle(events, outcome);
            }
            _ => {}
        }
    }
}
