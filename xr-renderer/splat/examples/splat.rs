//! Splats a static scene to a PNG.
//!
//! ```text
//! cargo run --release -p renderer-splat --example splat -- scene.ply out.png [DEGREES]
//! ```
//!
//! Reads what `splat-scene` reads (PLY, compressed PLY, `.splat`, `.spz`), looks at the middle of the scene from DEGREES around it
//! (0: from the front), and draws on the best Vulkan device, or the one that `MON3TR_GPU` names.

use std::env;
use std::error::Error;
use std::sync::Arc;

use glam::{Quat, Vec3};
use renderer_splat::background::Background;
use renderer_splat::camera::Camera;
use renderer_splat::options::{Filter, RendererOptions};
use renderer_splat::picture::Backdrop;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;
use splat_scene::{Bounds, Scene};

/// Size of the picture, pixels.
const WIDTH: u32 = 1280;
const HEIGHT: u32 = 960;

/// Vertical field of view, radians.
const FOV: f32 = 0.8;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let (Some(from), Some(to)) = (arguments.next(), arguments.next()) else {
        return Err("usage: splat SCENE OUT.png [DEGREES]".into());
    };
    let degrees: f32 = arguments.next().map_or(Ok(0.0), |text| text.parse())?;

    // The scene, on the host.
    let scene = Scene::load(&from)?;
    println!(
        "{from}: {} Gaussians, spherical harmonics of degree {}",
        scene.len(),
        scene.sh_degree()
    );
    let bounds = scene.robust_bounds().ok_or("the scene is empty")?;
    let camera = camera_around(&bounds, degrees.to_radians());

    // A device, and a renderer on it: no foreground, one view, the scene as its background.
    let choice: GpuChoice = env::var("MON3TR_GPU").unwrap_or_default().parse()?;
    let gpu = Gpu::open(&choice, false)?;
    println!("drawing on {}", gpu.info().name);
    let options = RendererOptions {
        background: Some(Arc::new(Background::pack(&scene))),
        filter: if scene.antialiased() {
            Filter::Mip
        } else {
            Filter::Dilation
        },
        ..RendererOptions::new(0, WIDTH, HEIGHT, 1)
    };
    let mut renderer = SplatRenderer::new(gpu, &options)?;

    // One picture, over grey.
    renderer.draw(&[camera])?;
    let times = renderer.stage_times();
    println!(
        "projected in {:.2} ms, sorted in {:.2} ms, splatted in {:.2} ms by {}",
        times.project,
        times.sort,
        times.bin + times.raster,
        renderer.back_end()
    );
    let picture = renderer.read_back(0)?.over(Backdrop::Colour([0.2; 3]));
    image::save_buffer(&to, &picture, WIDTH, HEIGHT, image::ExtendedColorType::Rgb8)?;
    println!("wrote {to}");
    Ok(())
}

/// A camera that sees a whole box, a little from above, turned around its vertical axis by an angle in radians.
fn camera_around(bounds: &Bounds, angle: f32) -> Camera {
    let (min, max) = (Vec3::from(bounds.min), Vec3::from(bounds.max));
    let centre = 0.5 * (min + max);
    // A little farther than the box needs, which leaves out the outermost Gaussians.
    let distance = 0.6 * (max - min).length() / (0.5 * FOV).tan();
    let from_centre = Quat::from_rotation_y(angle) * Vec3::new(0.0, 0.2, 1.0).normalize();
    Camera::look_at(
        centre + distance * from_centre,
        centre,
        Vec3::Y,
        FOV,
        WIDTH,
        HEIGHT,
    )
}
