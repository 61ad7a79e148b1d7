//! The headset as a session's display.

use super::figures::{HeadsetFigures, REFRESH_HZ};
use super::frames::Frames;
use super::handle::HeadsetHandle;
use super::observer::FrameObserver;
use super::options::PresentOptions;
use crate::display::{Display, DisplayNeeds, LiveSession, SessionError};
use glam::Vec3;
use renderer_openxr::session::SessionOptions;
use renderer_splat::camera::Camera;
use renderer_splat::options::{Filter, RendererOptions};
use std::sync::Arc;
use std::time::Duration;

/// Shows a session in a headset.
pub struct HeadsetDisplay<'a> {
    /// Until it is shown.
    headset: Option<HeadsetHandle>,
    options: PresentOptions,
    observer: &'a mut dyn FrameObserver,
    figures: HeadsetFigures,
}

impl std::fmt::Debug for HeadsetDisplay<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HeadsetDisplay")
            .field("headset", &self.headset)
            .field("options", &self.options)
            .finish_non_exhaustive()
    }
}

impl<'a> HeadsetDisplay<'a> {
    /// In this headset.
    pub fn new(
        headset: HeadsetHandle,
        options: PresentOptions,
        observer: &'a mut dyn FrameObserver,
    ) -> Self {
        Self {
            headset: Some(headset),
            options,
            observer,
            figures: HeadsetFigures::default(),
        }
    }

    /// What there was of the headset, once the session is over.
    #[must_use]
    pub fn into_figures(self) -> HeadsetFigures {
        self.figures
    }
}

impl Display for HeadsetDisplay<'_> {
    fn needs(&mut self) -> Result<DisplayNeeds, SessionError> {
        let headset = self
            .headset
            .as_ref()
            .ok_or(SessionError::ShownAlready)?
            .headset();
        let [width, height] = headset.info().eye_size;
        let (background, filter) = match &self.options.scene {
            Some((background, filter)) => (Some(Arc::clone(background)), *filter),
            None => (None, Filter::Dilation),
        };
        Ok(DisplayNeeds {
            gpu: Arc::clone(headset.gpu()),
            renderer: RendererOptions {
                background,
                filter,
                depth: (headset.extensions()).has("XR_KHR_composition_layer_depth"),
                ..RendererOptions::new(0, width, height, 2)
            },
            cameras: first_views([width, height]).to_vec(),
            period: Duration::from_secs_f32(1.0 / REFRESH_HZ),
        })
    }

    fn show(&mut self, session: LiveSession<'_>) -> Result<(), SessionError> {
        let HeadsetHandle {
            runtime,
            headset,
            options,
        } = self.headset.take().ok_or(SessionError::ShownAlready)?;
        let of_open_xr = SessionOptions {
            // A scene is to be seen, not the room.
            room: self.options.scene.is_none(),
            read_back: self.options.read_back,
            display_hz: self.options.display_hz,
        };
        let control = session.control;
        let mut frames = Frames::new(session, of_open_xr, &self.options, &mut *self.observer)?;
        self.figures = std::thread::scope(|scope| {
            let thread = std::thread::Builder::new()
                .name("headset frames".to_owned())
                .spawn_scoped(scope, move || -> Result<HeadsetFigures, SessionError> {
                    let shown = frames.run(headset, &runtime, options);
                    control.end_work();
                    shown.map(|()| frames.into_figures())
                })
                .map_err(SessionError::Thread)?;
            thread.join().map_err(|_| SessionError::Panicked)?
        })?;
        Ok(())
    }
}

/// Both eyes, about as they will see the first person, to find out what is fastest.
fn first_views([width, height]: [u32; 2]) -> [Camera; 2] {
    [-0.0315, 0.0315].map(|x| {
        let eye = Vec3::new(x, 1.6, 1.6);
        Camera::look_at(eye, eye - Vec3::Z, Vec3::Y, 1.6, width, height)
    })
}
