//! Reusing the order: a renderer that sorted recently draws as one that sorts now, and a static scene stays the same.

use glam::{Affine3A, Quat, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::motion_bound::Change;
use renderer_splat::picture::Image;
use renderer_splat::renderer::SplatRenderer;
use synthetic_person::Random;
use test_support::picture_check::{
    BACK_ENDS, compare, keep_pictures, renderer_of, show, views_of, whole,
};
use test_support::splat_reference::{PixelBox, World};
use test_support::splat_scenes::{
    eyes_at, in_front_of_figure, railing_and_wall, random_gaussians, standing_figure,
};
use test_support::vulkan::{assert_silent, gpu};
use test_support::walking::Walking;

/// Least PSNR in dB of a picture in the kept order against one in its own.
const NO_POPPING: f64 = 50.0;

/// A head that turned by degrees to the left and upwards, and moved by metres in its own axes.
fn moved(camera: &Camera, left: f32, up: f32, way: Vec3) -> Camera {
    let turn = Quat::from_rotation_y(-left.to_radians()) * Quat::from_rotation_x(-up.to_radians());
    Camera {
        camera_from_world: Affine3A::from_rotation_translation(turn, -way)
            * camera.camera_from_world,
        ..*camera
    }
}

fn assert_no_popping(what: &str, kept: &[Image], fresh: &[Image]) {
    for (view, (kept, fresh)) in kept.iter().zip(fresh).enumerate() {
        let (psnr, most) = compare(kept, fresh, whole(kept));
        println!("{what}, view {view}: {psnr:.1} dB, {most:.4} at most");
        if psnr < NO_POPPING {
            let start = keep_pictures("order", kept, fresh);
            panic!("{what}, view {view}: {psnr:.1} dB; see {start}-*.png");
        }
    }
}

#[test]
fn a_head_that_hardly_turns_or_moves_sees_no_popping() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(60_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let start = in_front_of_figure(512, 512);
    let trembling = trembled(&figure, 0.000_24);
    for back_end in BACK_ENDS {
        let mut kept = renderer_of(&gpu, back_end, &world, &[start]);
        let mut fresh = renderer_of(&gpu, back_end, &world, &[start]);
        let mut person = Walking::new(&kept);
        person.write(&figure);
        person.draw(&mut kept, &[start], false).expect("a picture");
        let still = person.path();
        let mut aside = still;
        aside.advance(Change {
            metres: 0.000_241,
            ..Change::default()
        });
        for (left, up, way) in [
            (0.06, 0.0, Vec3::ZERO),
            (0.12, 0.02, Vec3::new(0.001, 0.0, 0.0)),
            (0.18, 0.05, Vec3::new(0.002, 0.001, 0.0)),
            (0.24, 0.0, Vec3::new(0.003, -0.003, 0.0)),
            (-0.24, 0.0, Vec3::new(0.0, 0.0, -0.004_9)),
            (0.0, 0.24, Vec3::new(-0.004_9, 0.0, 0.0)),
            (0.0, -0.24, Vec3::new(0.0, 0.0, 0.004_9)),
        ] {
            let camera = moved(&start, left, up, way);
            for (people, path, trembles) in [
                (&figure, still, ""),
                (&trembling, aside, ", the person trembles"),
            ] {
                person.write_at(people, path);
                person.draw(&mut kept, &[camera], false).expect("a picture");
                fresh.forget_order();
                show(&mut fresh, people, &[camera]).expect("a picture");
                let what = format!("{back_end}, {left} left, {up} up, {way} m{trembles}");
                assert_no_popping(&what, &views_of(&mut kept), &views_of(&mut fresh));
            }
        }
    }
    assert_silent(&gpu);
}

/// Each Gaussian moved by as much in some direction.
fn trembled(gaussians: &[Gaussian], metres: f32) -> Vec<Gaussian> {
    let mut random = Random::new(80);
    gaussians
        .iter()
        .map(|gaussian| {
            let way = random.vector().normalize_or(Vec3::X) * metres;
            Gaussian {
                position: (Vec3::from(gaussian.position) + way).to_array(),
                ..*gaussian
            }
        })
        .collect()
}

#[test]
fn both_eyes_of_a_head_that_hardly_turns_see_no_popping() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(40_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let start = eyes_at(Vec3::new(0.35, 1.15, 2.4), 400, 400);
    let way = Vec3::new(0.002, 0.002, 0.002);
    let turned = start.map(|eye| moved(&eye, 0.2, 0.1, way));
    for back_end in BACK_ENDS {
        let mut kept = renderer_of(&gpu, back_end, &world, &start);
        kept.draw(&start).expect("a picture");
        kept.draw(&turned).expect("a picture");
        let mut fresh = renderer_of(&gpu, back_end, &world, &start);
        fresh.draw(&turned).expect("a picture");
        let what = format!("{back_end}, both eyes");
        assert_no_popping(&what, &views_of(&mut kept), &views_of(&mut fresh));
    }
    assert_silent(&gpu);
}

#[test]
fn gaussians_that_enter_at_the_pictures_edge_are_drawn_before_the_next_sort() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(60_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    // So near that the body leaves the picture on all sides.
    let eye = Vec3::new(0.1, 1.1, 1.2);
    let start = Camera::look_at(eye, Vec3::new(0.0, 1.05, 0.0), Vec3::Y, 0.5, 600, 600);
    let strip = 6;
    let edges = [
        [0, 0, strip, 599],
        [599 - strip, 0, 599, 599],
        [0, 0, 599, strip],
        [0, 599 - strip, 599, 599],
    ];
    let edges = edges.map(|[left, top, right, bottom]| PixelBox {
        left,
        top,
        right,
        bottom,
    });
    for back_end in BACK_ENDS {
        let mut kept = renderer_of(&gpu, back_end, &world, &[start]);
        let mut fresh = renderer_of(&gpu, back_end, &world, &[start]);
        for (left, up) in [(0.24, 0.0), (-0.24, 0.0), (0.0, 0.24), (0.0, -0.24)] {
            // The move shows the same side as the turn.
            let way = Vec3::new(-left, up, 0.0) * (0.004_9 / 0.24);
            kept.forget_order();
            kept.draw(&[start]).expect("a picture");
            let camera = moved(&start, left, up, way);
            kept.draw(&[camera]).expect("a picture");
            fresh.forget_order();
            fresh.draw(&[camera]).expect("a picture");
            let (kept, fresh) = (views_of(&mut kept), views_of(&mut fresh));
            for edge in edges {
                let (psnr, most) = compare(&kept[0], &fresh[0], edge);
                println!("{back_end}, {left} left, {up} up: {psnr:.1} dB, {most:.4} at most");
                assert!(psnr >= NO_POPPING, "{back_end}, {edge:?}: {psnr:.1} dB");
            }
        }
    }
    assert_silent(&gpu);
}

/// Red before green, 0.1 mm apart in depth and 10 cm apart across: a turn to the left by 0.06 degrees swaps them.
fn pair() -> [Gaussian; 2] {
    [
        (-0.05, 0.0, [1.0, 0.0, 0.0]),
        (0.05, -0.000_1, [0.0, 1.0, 0.0]),
    ]
    .map(|(x, z, colour)| Gaussian {
        position: [x, 0.0, z],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [0.1; 3],
        opacity: 0.95,
        colour,
    })
}

#[test]
fn the_order_is_kept_below_the_threshold_and_renewed_beyond_it() {
    let Some(gpu) = gpu() else { return };
    let pair = pair();
    let start = Camera::look_at(Vec3::Z * 2.0, Vec3::ZERO, Vec3::Y, 0.5, 128, 128);
    for back_end in BACK_ENDS {
        let mut renderer = renderer_of(&gpu, back_end, &World::of(&pair), &[start]);
        let mut slot = Walking::new(&renderer);
        slot.write(&pair);
        let mut red_shows = |camera: Camera, foreground: Option<&[Gaussian]>, forget: bool| {
            if let Some(foreground) = foreground {
                slot.write(foreground);
            }
            if forget {
                renderer.forget_order();
            }
            slot.draw(&mut renderer, &[camera], false)
                .expect("a picture");
            let middle = renderer.read_back(0).expect("a view").pixels()[64 * 128 + 64];
            middle[0] > middle[1]
        };
        let turned = |degrees| moved(&start, degrees, 0.0, Vec3::ZERO);
        assert!(red_shows(start, None, false), "{back_end}: red is nearer");
        for degrees in [0.08, 0.16, 0.24] {
            let kept = red_shows(turned(degrees), None, false);
            assert!(kept, "{back_end}: the order is kept at {degrees} degrees");
        }
        let renewed = red_shows(turned(0.26), None, false);
        assert!(!renewed, "{back_end}: and renewed at 0.26");
        // Back again by less than the threshold from there: green stays in front.
        let kept = red_shows(turned(0.03), None, false);
        assert!(!kept, "{back_end}: kept from the last sort on");
        assert!(red_shows(turned(0.03), None, true), "{back_end}: forgotten");
        // The foreground's own moves: red goes back by 0.2 mm, then by 0.3.
        let mut back = pair;
        back[0].position[2] = -0.000_2;
        let kept = red_shows(turned(0.03), Some(&back), false);
        assert!(kept, "{back_end}: a move of 0.2 mm keeps the order");
        back[0].position[2] = -0.000_3;
        let kept = red_shows(turned(0.03), Some(&back), false);
        assert!(!kept, "{back_end}: a move of 0.3 mm does not");
        // To and fro is a way of 0.4 mm, though it ends where it began.
        assert!(
            red_shows(turned(0.03), Some(&pair), false),
            "{back_end}: sorted again"
        );
    }
    assert_silent(&gpu);
}

/// A foreground as it is drawn right after it was another one.
fn drawn_after(
    renderer: &mut SplatRenderer,
    before: &[Gaussian],
    after: &[Gaussian],
    camera: Camera,
) -> Vec<Image> {
    let mut slot = Walking::new(renderer);
    for gaussians in [before, after] {
        slot.write(gaussians);
        slot.draw(renderer, &[camera], false).expect("a picture");
    }
    views_of(renderer)
}

#[test]
fn an_order_is_kept_on_request_but_only_by_the_gaussians_it_was_made_of() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(20_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let start = in_front_of_figure(256, 256);
    // Most of what is in view here was not there, and the other way round.
    let turned = moved(&start, 25.0, 5.0, Vec3::new(0.3, 0.0, -0.8));
    let fewer = &figure[..figure.len() - 1_000];
    for back_end in BACK_ENDS {
        let mut kept = renderer_of(&gpu, back_end, &world, &[start]);
        let mut person = Walking::new(&kept);
        let mut draw = |kept: &mut SplatRenderer, people: &[Gaussian], camera, keep_order| {
            person.write(people);
            person.draw(kept, &[camera], keep_order).expect("a picture");
            views_of(kept).remove(0)
        };
        let first = draw(&mut kept, &figure, start, true);
        let stale = draw(&mut kept, &figure, turned, true);
        let back = draw(&mut kept, &figure, start, true);
        assert!(back == first, "{back_end}: the order of the first picture");
        let fresh = draw(&mut kept, &figure, turned, false);
        assert!(stale != fresh, "{back_end}: the order was not kept");
        let without = draw(&mut kept, fewer, start, true);
        kept.forget_order();
        let sorted = draw(&mut kept, fewer, start, false);
        assert!(without == sorted, "{back_end}: an order of other Gaussians");
        kept.forget_order();
        let forgotten = draw(&mut kept, fewer, turned, true);
        let sorted = draw(&mut kept, fewer, turned, false);
        assert!(forgotten == sorted, "{back_end}: there was no order");
    }
    assert_silent(&gpu);
}

#[test]
fn gaussians_that_appear_in_their_place_are_drawn_at_once() {
    let Some(gpu) = gpu() else { return };
    let after = random_gaussians(2_000, 81);
    let camera = Camera::look_at(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 0.5, 200, 200);
    let hidden = |change: fn(&mut Gaussian)| {
        let mut before = after.clone();
        before.iter_mut().step_by(2).for_each(change);
        before
    };
    for (before, what) in [
        (hidden(|gaussian| gaussian.opacity = 0.0), "transparent"),
        (hidden(|gaussian| gaussian.scale = [3e38; 3]), "broken"),
    ] {
        for back_end in BACK_ENDS {
            let mut renderer = renderer_of(&gpu, back_end, &World::of(&before), &[camera]);
            let got = drawn_after(&mut renderer, &before, &after, camera);
            show(&mut renderer, &after, &[camera]).expect("a picture");
            let what = format!("{back_end}, {what} before");
            assert_no_popping(&what, &got, &views_of(&mut renderer));
        }
    }
    assert_silent(&gpu);
}

#[test]
fn gaussians_that_grow_into_the_picture_are_drawn_at_once() {
    let Some(gpu) = gpu() else { return };
    let camera = Camera::look_at(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 0.5, 200, 200);
    let at = |x: f32, scale: f32| Gaussian {
        position: [x, 0.0, 0.0],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [scale; 3],
        opacity: 0.9,
        colour: [0.9, 0.5, 0.1],
    };
    // One in the middle, and one beyond the edge (at 0.77 m) that grows into the picture.
    let (before, after) = ([at(0.0, 0.1), at(1.2, 0.01)], [at(0.0, 0.1), at(1.2, 0.3)]);
    for back_end in BACK_ENDS {
        let mut renderer = renderer_of(&gpu, back_end, &World::of(&before), &[camera]);
        let got = drawn_after(&mut renderer, &before, &after, camera);
        show(&mut renderer, &after, &[camera]).expect("a picture");
        assert!(got == views_of(&mut renderer), "{back_end}: it is missing");
        let edge = got[0].pixels()[100 * 200 + 199];
        assert!(edge[3] > 0.05, "{back_end}: nothing at the edge: {edge:?}");
    }
    assert_silent(&gpu);
}

#[test]
fn a_world_at_rest_gives_the_same_picture_again() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(20_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let eyes = eyes_at(Vec3::new(0.35, 1.15, 2.4), 320, 320);
    for back_end in BACK_ENDS {
        let mut renderer = renderer_of(&gpu, back_end, &world, &eyes);
        renderer.draw(&eyes).expect("a picture");
        let first = views_of(&mut renderer);
        for what in ["kept", "sorted again"] {
            renderer.draw(&eyes).expect("a picture");
            let again = views_of(&mut renderer);
            assert!(again == first, "{back_end}, {what}: another picture");
            renderer.forget_order();
        }
    }
    assert_silent(&gpu);
}
