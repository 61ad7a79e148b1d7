//! What displays without a headset have in common: the pictures they need, the scene around people, and where these are seen from.

use crate::gaze::Gaze;
use crate::scenery::{Scenery, SceneryOptions};
use crate::size::{Size, Views};
use crate::viewpoint::{Viewpoint, eyes};
use app_session::display::{DisplayNeeds, LoadBackground, SessionError, Standpoint};
use glam::{Quat, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::options::RendererOptions;
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Room for a person's arms beside those who stand outermost, metres.
const ARMS: f32 = 1.2;

/// What a flat display of so many pictures a second needs, on which a person is seen from `viewpoint`.
pub(crate) fn needs(
    gpu: &Arc<Gpu>,
    size: Size,
    views: Views,
    viewpoint: &Viewpoint,
    hertz: f64,
) -> DisplayNeeds {
    let Size { width, height } = size;
    let camera = viewpoint.camera(Vec3::ZERO, Quat::IDENTITY, width, height);
    DisplayNeeds {
        gpu: Arc::clone(gpu),
        renderer: RendererOptions::new(0, width, height, views.count()),
        cameras: eyes(camera, views),
        period: Duration::from_secs_f64(hertz.recip()),
    }
}

/// Loads the scene around people, if one was chosen.
pub(crate) fn background(options: &SceneryOptions) -> Option<LoadBackground<'_>> {
    options.background.as_ref()?;
    Some(Box::new(|floor, heading| {
        let scenery = options.around(None, floor, heading)?;
        Ok(scenery.map(|scenery| (Arc::clone(&scenery.background), Scenery::filter(&scenery))))
    }))
}

/// From where all people are seen, if one of them is seen from `viewpoint`: further away where they would not fit.
pub(crate) fn around(mut viewpoint: Viewpoint, people: &Standpoint, size: Size) -> Viewpoint {
    if people.width > 0.0 {
        let aspect = size.width as f32 / size.height.max(1) as f32;
        viewpoint.back_off((people.width + ARMS) / aspect);
    }
    viewpoint
}

/// The camera of the picture that is begun now, of people who are seen from `viewpoint`, which a gaze may move.
pub(crate) fn camera(
    viewpoint: Viewpoint,
    gaze: Option<&mut Gaze>,
    people: &Standpoint,
    size: Size,
) -> Camera {
    match gaze {
        Some(gaze) => gaze.camera(viewpoint, people, size, Instant::now()),
        None => viewpoint.camera(people.floor, people.heading, size.width, size.height),
    }
}

/// An error of a display of this program's.
pub(crate) fn display_error(error: anyhow::Error) -> SessionError {
    SessionError::Display(error.into())
}
