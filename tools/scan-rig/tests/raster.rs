//! The rasteriser on the CPU against the renderer, on a real scan.

use glam::{DVec3, Quat, Vec3};
use renderer_splat::background::Background;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use scan_rig::pinhole::Pinhole;
use scan_rig::scan::Scan;
use scan_rig::surface::raster;
use splat_scene::Scene;
use std::sync::Arc;
use synthetic_person::real_files::real_file;

/// A real scan, upright at the origin and 1.75 m high.
fn biker() -> Option<Scan> {
    let path = real_file("splats/biker.compressed.ply")?;
    let scene = Scene::load(path).expect("a scene");
    let mut scan = Scan::from_scene(&scene);
    // The file's y points down.
    scan.transform(
        0.554,
        Quat::from_rotation_x(std::f32::consts::PI),
        Vec3::ZERO,
    );
    let low = scan.positions.iter().fold(f32::INFINITY, |y, p| y.min(p.y));
    scan.transform(1.0, Quat::IDENTITY, Vec3::Y * -low);
    Some(scan)
}

#[test]
fn a_picture_drawn_on_the_cpu_is_the_renderers() {
    let (Some(scan), Some(gpu)) = (biker(), test_support::vulkan::gpu()) else {
        return;
    };
    let scene = scan.to_scene().expect("a scene");
    let target = DVec3::new(0.0, 0.9, 0.0);
    let view = Pinhole::look_at(
        DVec3::new(-2.9, 1.4, 0.9),
        target,
        DVec3::Y,
        900.0,
        420,
        600,
    );
    let options = RendererOptions {
        background: Some(Arc::new(Background::pack(&scene))),
        ..RendererOptions::new(0, view.width, view.height, 1)
    };
    let mut renderer = SplatRenderer::new(gpu, &options).expect("a renderer");
    renderer.draw(&[view.camera()]).expect("a picture");
    let theirs = renderer.read_back(0).expect("a view");
    let ours = raster::draw(&scan, &view);
    let mut error = 0.0;
    let mut covered = 0.0;
    for (at, pixel) in theirs.pixels().iter().enumerate() {
        let [red, green, blue, alpha] = *pixel;
        if alpha < 0.02 {
            continue;
        }
        let difference = Vec3::new(red, green, blue) - ours.colours[at];
        error += f64::from(difference.length_squared()) / 3.0;
        covered += 1.0;
    }
    assert!(covered > 20_000.0, "the scan covers {covered} pixels");
    let psnr = -10.0 * f64::log10(error / covered);
    println!("{psnr:.1} dB over {covered} pixels");
    assert!(psnr > 50.0, "{psnr} dB");
}

#[test]
fn weights_and_what_comes_through_are_all_of_the_light() {
    let mut random = fastrand::Rng::with_seed(1);
    let mut scan = Scan::default();
    for _ in 0..2000 {
        let mut side = || random.f32() - 0.5;
        scan.positions.push(Vec3::new(side(), side(), side()));
        scan.rotations
            .push(Quat::from_xyzw(side(), side(), side(), side()).normalize());
        scan.scales
            .push(Vec3::new(side(), side(), side()).abs() * 0.1 + 0.001);
        scan.opacities.push(side().abs() * 2.0);
        scan.colours.push(Vec3::ONE);
    }
    let view = Pinhole::look_at(DVec3::Z * 2.0, DVec3::ZERO, DVec3::Y, 120.0, 90, 70);
    let (picture, peaks) = raster::draw_with_peaks(&scan, &view);
    let unpainted = raster::draw_unpainted(&scan, &view, &vec![true; scan.len()]);
    let shares = unpainted
        .shares
        .iter()
        .map(|(_, weight)| f64::from(*weight));
    assert_eq!(
        unpainted.starts.len(),
        picture.colours.len() + 1,
        "shares of every pixel"
    );
    let through: f64 = picture.transmittance.iter().map(|t| f64::from(*t)).sum();
    let weights: f64 = shares.sum();
    assert!(
        (through + weights - 90.0 * 70.0).abs() < 0.1,
        "{through} + {weights}"
    );
    for (colour, clear) in picture.colours.iter().zip(&picture.transmittance) {
        assert!(
            (colour.x + clear - 1.0).abs() < 1e-4,
            "white is as opaque as it is bright"
        );
    }
    let mut largest = vec![0.0_f32; scan.len()];
    for (gaussian, weight) in &unpainted.shares {
        let slot = &mut largest[*gaussian as usize];
        *slot = slot.max(*weight);
    }
    assert!(peaks == largest, "the largest shares are the peaks");
    assert!(peaks.iter().all(|p| *p <= 0.99), "a weight is too large");
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let again = one.install(|| raster::draw_with_peaks(&scan, &view));
    assert!(
        again == (picture, peaks),
        "another number of threads draws another picture"
    );
}

#[test]
fn depth_is_where_half_of_the_light_is_gone() {
    let wall = |z: f32, opacity: f32| {
        let mut scan = Scan::default();
        for at in 0..400_u16 {
            let (x, y) = (f32::from(at % 20), f32::from(at / 20));
            scan.positions
                .push(Vec3::new(x * 0.05 - 0.5, y * 0.05 - 0.5, z));
            scan.rotations.push(Quat::IDENTITY);
            scan.scales.push(Vec3::new(0.05, 0.05, 0.001));
            scan.opacities.push(opacity);
            scan.colours.push(Vec3::ONE);
        }
        scan
    };
    let mut scan = wall(0.5, 0.02);
    scan.append(wall(0.0, 0.9));
    let view = Pinhole::look_at(DVec3::Z * 2.0, DVec3::ZERO, DVec3::Y, 40.0, 31, 31);
    let picture = raster::draw(&scan, &view);
    let middle = picture.depth[15 * 31 + 15];
    assert!(
        (middle - 2.0).abs() < 1e-4,
        "{middle} m, behind the veil at 1.5 m"
    );
    assert_eq!(picture.depth[0], f32::INFINITY, "beside the wall");
}
