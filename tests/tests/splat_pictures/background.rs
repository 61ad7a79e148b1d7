//! Static scenes: a real capture, every degree of spherical harmonics, and inputs at the edge. The reference reads the
//! scene as its file states it, so that what packing costs is measured.

use glam::Vec3;
use renderer_splat::camera::{Camera, Fov};
use splat_scene::{Scene, SceneBuilder, Splat};
use synthetic_person::Random;
use synthetic_person::real_files::real_file;
use test_support::picture_check::{
    BACK_ENDS, assert_drawn_as_reference, draw, renderer_of, show, views_of,
};
use test_support::splat_reference::World;
use test_support::splat_scenes::{eyes, front_camera, random_gaussians, random_scene};
use test_support::vulkan::{assert_silent, gpu};

use crate::{EQUAL, OPAQUE, PACKED, SPARSE};

fn captured() -> Option<(Scene, Vec3)> {
    let scene = Scene::load(real_file("splats/playbot3.ply")?).expect("the capture can be read");
    assert_eq!(
        (scene.len(), scene.sh_degree()),
        (31_000, 2),
        "Gaussians and degree of the capture"
    );
    let bounds = scene.robust_bounds().expect("a scene with something in it");
    let middle = 0.5 * (Vec3::from(bounds.min) + Vec3::from(bounds.max));
    Some((scene, middle))
}

#[test]
fn a_captured_scene_looks_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let Some((scene, middle)) = captured() else {
        return;
    };
    let eye = middle + Vec3::new(1.1, 0.5, -2.2);
    let camera = Camera::look_at(eye, middle, Vec3::Y, 0.8, 1024, 1024);
    assert_drawn_as_reference(&gpu, "captured", &World::scene(&scene), &[camera], PACKED);
}

#[test]
fn both_eyes_see_a_captured_scene_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let Some((scene, middle)) = captured() else {
        return;
    };
    let head = middle + Vec3::new(0.0, 0.3, -2.4);
    let facing = Camera::look_at(head, middle, Vec3::Y, 0.8, 64, 64);
    let turn = glam::Quat::from_mat3a(&facing.camera_from_world.matrix3).inverse();
    let eyes = [-1.0, 1.0].map(|side: f32| {
        let fov = Fov {
            left: -0.48 - 0.06 * side,
            right: 0.48 - 0.06 * side,
            up: 0.45,
            down: -0.5,
        };
        let position = head + turn * Vec3::new(0.032 * side, 0.0, 0.0);
        Camera::from_fov(position, turn, fov, 840, 880)
    });
    let world = World::scene(&scene);
    assert_drawn_as_reference(&gpu, "captured-stereo", &world, &eyes, PACKED);
}

#[test]
fn every_degree_of_spherical_harmonics_looks_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    for degree in 0..=3 {
        let scene = random_scene(10_000, degree, 50 + u64::from(degree));
        let name = format!("degree-{degree}");
        let world = World::scene(&scene);
        assert_drawn_as_reference(&gpu, &name, &world, &eyes(512, 480), PACKED);
    }
}

#[test]
fn a_camera_within_a_scene_draws_what_is_before_it() {
    let Some(gpu) = gpu() else { return };
    let scene = random_scene(20_000, 1, 60);
    let camera = Camera::look_at(Vec3::splat(0.05), Vec3::X, Vec3::Y, 1.2, 512, 512);
    assert_drawn_as_reference(&gpu, "inside", &World::scene(&scene), &[camera], OPAQUE);
}

#[test]
fn a_scene_of_one_gaussian_is_drawn() {
    let Some(gpu) = gpu() else { return };
    let scene = random_scene(1, 3, 61);
    let camera = front_camera(256, 256);
    assert_drawn_as_reference(&gpu, "lone", &World::scene(&scene), &[camera], SPARSE);
}

#[test]
fn a_scene_of_equal_gaussians_looks_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let splat = Splat {
        position: [0.1, -0.2, 0.3],
        rotation: [0.1, 0.2, 0.3, 0.9],
        log_scale: [-1.5, -2.0, -3.0],
        opacity: 0.4,
        colour: [1.0, -0.5, 0.3],
    };
    let mut builder = SceneBuilder::new(0).expect("degree 0");
    for _ in 0..1_000 {
        builder.push(&splat, &[]).expect("room for one more");
    }
    let (scene, camera) = (builder.finish(), front_camera(512, 512));
    assert_drawn_as_reference(&gpu, "equal", &World::scene(&scene), &[camera], EQUAL);
}

#[test]
fn strays_far_away_do_not_blur_their_neighbours_places() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random::new(65);
    let mut builder = SceneBuilder::new(1).expect("degree 1");
    for gaussian in random_gaussians(20_000, 62) {
        let splat = Splat {
            position: gaussian.position,
            rotation: gaussian.rotation,
            log_scale: gaussian.scale.map(f32::ln),
            opacity: gaussian.opacity,
            colour: gaussian.colour,
        };
        let rest: [f32; 9] = std::array::from_fn(|_| 0.2 * random.signed());
        builder.push(&splat, &rest).expect("room for one more");
        // As captures have them: a few in a thousand, up to 20 km away, and large enough to be seen there.
        if random.unit() < 0.003 {
            let times = 10f32.powf(0.5 + 3.8 * random.unit());
            let stray = Splat {
                position: gaussian.position.map(|x| times * x),
                log_scale: splat.log_scale.map(|log| log + times.ln()),
                ..splat
            };
            builder.push(&stray, &rest).expect("room for one more");
        }
    }
    let (scene, camera) = (builder.finish(), front_camera(512, 512));
    assert_drawn_as_reference(&gpu, "strays", &World::scene(&scene), &[camera], PACKED);
}

#[test]
fn an_empty_scene_changes_nothing() {
    let Some(gpu) = gpu() else { return };
    let empty = SceneBuilder::new(2).expect("degree 2").finish();
    let gaussians = random_gaussians(2_000, 63);
    let cameras = eyes(320, 300);
    for back_end in BACK_ENDS {
        let alone = draw(&gpu, back_end, &World::of(&gaussians), &cameras);
        let world = World {
            background: Some(&empty),
            ..World::of(&gaussians)
        };
        let with = draw(&gpu, back_end, &world, &cameras);
        assert!(with == alone, "{back_end}: another picture");
        let nothing = draw(&gpu, back_end, &World::scene(&empty), &cameras);
        let all = nothing
            .iter()
            .flat_map(|image| image.pixels().as_flattened());
        assert!(
            all.copied().all(|value| value == 0.0),
            "{back_end}: nothing at all"
        );
    }
    assert_silent(&gpu);
}

#[test]
fn a_scene_behind_the_camera_is_not_drawn_and_comes_back() {
    let Some(gpu) = gpu() else { return };
    let scene = random_scene(5_000, 1, 64);
    let world = World::scene(&scene);
    let camera = front_camera(200, 200);
    let away = Camera::look_at(Vec3::Z * 3.0, Vec3::Z * 6.0, Vec3::Y, 0.75, 200, 200);
    for back_end in BACK_ENDS {
        let mut renderer = renderer_of(&gpu, back_end, &world, &[camera]);
        renderer.draw(&[camera]).expect("a picture");
        let before = views_of(&mut renderer);
        renderer.draw(&[away]).expect("a picture of nothing");
        let nothing = renderer.read_back(0).expect("a view");
        assert!(
            nothing.pixels().as_flattened().iter().all(|v| *v == 0.0),
            "{back_end}: all behind the camera"
        );
        show(&mut renderer, &[], &[camera]).expect("a picture");
        assert!(views_of(&mut renderer) == before, "{back_end}: as before");
    }
    assert_silent(&gpu);
}
