//! A static scene for the background, and the cameras that were made for it.

use anyhow::Context;
use glam::Vec3;
use splat_scene::Scene;
use splat_scene::cameras::SceneCamera;
use std::path::Path;
use xr_renderer::{Camera, Fov};

/// Reads a scene file.
pub(crate) fn load(file: &Path) -> anyhow::Result<Scene> {
    let scene = Scene::load(file).context("cannot use the scene")?;
    if scene.dropped().total() > 0 {
        log::warn!(
            "{}: Gaussians left out: {}",
            file.display(),
            scene.dropped()
        );
    }
    Ok(scene)
}

/// A scene's camera for pictures of another size: the field of view stays, as in 3DGS.
pub(crate) fn camera(camera: &SceneCamera, width: u32, height: u32) -> Camera {
    let half = |pixels: u32, focal: f32| (0.5 * pixels as f32 / focal).atan();
    let (right, up) = (
        half(camera.width, camera.fx),
        half(camera.height, camera.fy),
    );
    let fov = Fov {
        left: -right,
        right,
        up,
        down: -up,
    };
    let position = Vec3::from_array(camera.position);
    Camera::from_fov(position, camera.world_from_camera, fov, width, height)
}
