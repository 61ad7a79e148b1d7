//! Foregrounds alone.

use glam::Vec3;
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use test_support::picture_check::{
    BACK_ENDS, Least, assert_drawn_as_reference, compare, renderer_for, show, whole,
};
use test_support::splat_reference::World;
use test_support::splat_scenes::{
    eyes, front_camera, in_front_of_figure, random_gaussians, standing_figure,
};
use test_support::vulkan::{assert_silent, gpu};

use crate::{CROWDED, EQUAL, OPAQUE, SPARSE};

#[test]
fn twenty_thousand_random_gaussians_look_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(20_000, 7);
    let camera = front_camera(1024, 1024);
    assert_drawn_as_reference(&gpu, "mono", &World::of(&gaussians), &[camera], CROWDED);
}

#[test]
fn both_eyes_see_what_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(20_000, 11);
    let eyes = eyes(768, 700);
    assert_drawn_as_reference(&gpu, "stereo", &World::of(&gaussians), &eyes, CROWDED);
}

#[test]
fn a_person_of_150_000_gaussians_looks_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let figure = standing_figure(150_000);
    let camera = in_front_of_figure(1024, 1024);
    assert_drawn_as_reference(&gpu, "figure", &World::of(&figure), &[camera], CROWDED);
}

#[test]
fn a_picture_whose_sides_are_no_multiple_of_a_tile_is_whole() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(2_000, 3);
    let world = World::of(&gaussians);
    assert_drawn_as_reference(&gpu, "odd", &world, &[front_camera(333, 217)], SPARSE);
    assert_drawn_as_reference(&gpu, "thin", &world, &[front_camera(1, 500)], SPARSE);
}

#[test]
fn a_camera_among_the_gaussians_draws_those_before_it() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(20_000, 5);
    let camera = Camera::look_at(Vec3::splat(0.05), Vec3::X, Vec3::Y, 1.2, 512, 512);
    assert_drawn_as_reference(&gpu, "within", &World::of(&gaussians), &[camera], OPAQUE);
}

#[test]
fn each_splat_near_the_camera_is_the_same_by_tiles_and_by_quads() {
    let Some(gpu) = gpu() else { return };
    // Needles and discs that reach far beyond the picture, or past the eye, on all sides.
    let camera = Camera::look_at(Vec3::splat(0.05), Vec3::X, Vec3::Y, 1.2, 96, 96);
    let depth = |gaussian: &Gaussian| {
        let centre = Vec3::from(gaussian.position);
        -camera.camera_from_world.transform_point3(centre).z
    };
    let mut near = random_gaussians(20_000, 60);
    near.retain(|gaussian| (camera.near..0.25).contains(&depth(gaussian)));
    assert!(near.len() > 1_000, "{} near the camera", near.len());
    let mut renderers = BACK_ENDS.map(|back_end| renderer_for(&gpu, back_end, 1, 96, 96, 1));
    for (index, gaussian) in near.iter().enumerate() {
        let [tiles, quads] = renderers.each_mut().map(|renderer| {
            show(renderer, std::slice::from_ref(gaussian), &[camera]).expect("a picture");
            renderer.read_back(0).expect("a view")
        });
        let (_, most) = compare(&tiles, &quads, whole(&tiles));
        // Where one draws an alpha of just 1/255, the other need not.
        assert!(
            most < 0.006,
            "number {index} differs by {most}: {gaussian:?}"
        );
    }
    assert_silent(&gpu);
}

#[test]
fn a_face_at_20_centimetres_has_no_holes() {
    let Some(gpu) = gpu() else { return };
    let figure = standing_figure(150_000);
    // The face's foremost point is 0.1 m before the axis.
    let eye = Vec3::new(0.0, 1.62, 0.3);
    let camera = Camera::look_at(eye, Vec3::new(0.0, 1.62, 0.0), Vec3::Y, 0.6, 512, 512);
    let pictures = assert_drawn_as_reference(&gpu, "face", &World::of(&figure), &[camera], CROWDED);
    for image in pictures.iter().flatten() {
        let middle = whole(image);
        let (third, width) = (middle.right / 3, middle.right + 1);
        let alphas = (third..2 * third)
            .flat_map(|y| (third..2 * third).map(move |x| image.pixels()[y * width + x][3]));
        let least = alphas.fold(1.0, f32::min);
        assert!(least > 0.95, "alpha {least} within the face");
    }
}

#[test]
fn many_gaussians_in_one_place_are_blended_in_the_order_of_their_index() {
    let Some(gpu) = gpu() else { return };
    // Same place, other colours: a wrong order among equals shows.
    let mut gaussians = random_gaussians(20_000, 13);
    for gaussian in &mut gaussians {
        gaussian.position = [0.1, 0.2, 0.0];
        gaussian.opacity *= 0.2;
    }
    // 20,000 layers: half floats lose a little with each.
    let least = Least {
        quads: 38.0,
        ..CROWDED
    };
    let camera = front_camera(512, 512);
    assert_drawn_as_reference(&gpu, "stack", &World::of(&gaussians), &[camera], least);
}

#[test]
fn gaussians_that_are_all_the_same_look_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let gaussians = vec![random_gaussians(1, 14)[0]; 5_000];
    let camera = front_camera(512, 512);
    assert_drawn_as_reference(&gpu, "same", &World::of(&gaussians), &[camera], EQUAL);
}

#[test]
fn gaussians_larger_than_the_picture_make_the_tile_lists_grow() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = random_gaussians(1_500, 17);
    for gaussian in &mut gaussians {
        gaussian.scale = gaussian.scale.map(|scale| 60.0 * scale);
        gaussian.opacity *= 0.05;
    }
    // 1,500 thin layers over every pixel: lavapipe does not round to half floats but cuts, and each layer grows darker.
    let least = Least {
        quads: 38.0,
        ..OPAQUE
    };
    let camera = front_camera(512, 512);
    assert_drawn_as_reference(&gpu, "large", &World::of(&gaussians), &[camera], least);
}
