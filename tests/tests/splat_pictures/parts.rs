//! Foregrounds in parts, each turned and shifted: people in one picture, and parts that come and go.

use glam::{Affine3A, Quat, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::limits::MOST_PARTS;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Image;
use renderer_splat::renderer::SplatRenderer;
use test_support::picture_check::{
    BACK_ENDS, assert_pictures_like_reference, renderer_for, renderer_of, show, views_of,
};
use test_support::splat_reference::World;
use test_support::splat_scenes::{
    eyes_at, front_camera, in_front_of_figure, railing_and_wall, random_gaussians, standing_figure,
};
use test_support::vulkan::{assert_silent, gpu};
use test_support::walking::Walking;

use crate::{CROWDED, PACKED};

fn placed(turn: f32, x: f32, y: f32, z: f32) -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_rotation_y(turn), Vec3::new(x, y, z))
}

/// Slots that hold these Gaussians.
fn written(renderer: &SplatRenderer, rows: &[&[Gaussian]]) -> Vec<Walking> {
    let filled = rows.iter().map(|row| {
        let count = u32::try_from(row.len()).expect("few");
        let slot = renderer.foreground_slot_for(count);
        let mut slot = Walking::in_slot(slot.expect("memory for a slot"));
        slot.write(row);
        slot
    });
    filled.collect()
}

fn drawn(renderer: &mut SplatRenderer, cameras: &[Camera], parts: &[Part<'_>]) -> Vec<Image> {
    renderer
        .draw_with(&Drawing::new(cameras, parts))
        .expect("a picture");
    views_of(renderer)
}

/// Two people so close that the second one's arms are before and behind the first one's body, leaning forwards.
fn embrace() -> [Affine3A; 2] {
    let leaning = Affine3A::from_rotation_x(0.15);
    [
        placed(0.4, -0.1, 0.0, 0.0),
        placed(-1.5, 0.14, 0.02, 0.0) * leaning,
    ]
}

#[test]
fn two_people_who_embrace_look_as_the_reference_says_in_both_eyes() {
    let Some(gpu) = gpu() else { return };
    let (first, second) = (standing_figure(40_000), standing_figure(25_000));
    let [here, there] = embrace();
    let people = [(&first[..], here), (&second[..], there)];
    let world = World {
        parts: &people,
        ..World::default()
    };
    let eyes = eyes_at(Vec3::new(0.35, 1.15, 2.4), 640, 640);
    for back_end in BACK_ENDS {
        let mut renderer = renderer_for(&gpu, back_end, 65_000, 640, 640, 2);
        let slots = written(&renderer, &[&first, &second]);
        let parts = [slots[0].at(here), slots[1].at(there)];
        let got = drawn(&mut renderer, &eyes, &parts);
        let name = format!("embrace-{back_end}");
        let least = CROWDED.of(back_end);
        assert_pictures_like_reference(&gpu, &name, &world, &eyes, &got, least);
        // The parts' order does not matter, except at equal depth.
        let other = drawn(&mut renderer, &eyes, &[parts[1], parts[0]]);
        let name = format!("embrace-turned-{back_end}");
        assert_pictures_like_reference(&gpu, &name, &world, &eyes, &other, least);
    }
    assert_silent(&gpu);
}

#[test]
fn two_people_on_either_side_of_a_railing_look_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let (first, second) = (standing_figure(30_000), standing_figure(20_000));
    let scene = railing_and_wall();
    let (behind, before) = (placed(0.4, -0.1, 0.0, 0.0), placed(2.8, 0.3, -0.1, 0.6));
    let people = [(&first[..], behind), (&second[..], before)];
    let world = World {
        parts: &people,
        background: Some(&scene),
        ..World::default()
    };
    let camera = [in_front_of_figure(768, 768)];
    for back_end in BACK_ENDS {
        let room = standing_figure(50_000);
        let made_of = World {
            foreground: &room,
            ..world
        };
        let mut renderer = renderer_of(&gpu, back_end, &made_of, &camera);
        let slots = written(&renderer, &[&first, &second]);
        let parts = [slots[0].at(behind), slots[1].at(before)];
        let got = drawn(&mut renderer, &camera, &parts);
        let name = format!("railing-between-{back_end}");
        let least = PACKED.of(back_end);
        assert_pictures_like_reference(&gpu, &name, &world, &camera, &got, least);
    }
    assert_silent(&gpu);
}

#[test]
fn parts_that_stand_where_they_are_make_the_picture_of_all_in_one_to_the_last_bit() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(5_000, 41);
    let camera = [front_camera(200, 150)];
    // Not multiples of a workgroup, one of them empty.
    let cuts = [0, 777, 778, 778, 1_500, 3_001, 4_000, 4_500, 4_900, 5_000];
    for back_end in BACK_ENDS {
        let mut renderer = renderer_for(&gpu, back_end, 5_000, 200, 150, 1);
        show(&mut renderer, &gaussians, &camera).expect("a picture");
        let whole = views_of(&mut renderer);
        let rows: Vec<_> = cuts
            .windows(2)
            .map(|cut| &gaussians[cut[0]..cut[1]])
            .collect();
        let slots = written(&renderer, &rows);
        let parts: Vec<_> = slots
            .iter()
            .map(|slot| slot.at(Affine3A::IDENTITY))
            .collect();
        assert_eq!(parts.len(), MOST_PARTS, "all there may be");
        let cut = drawn(&mut renderer, &camera, &parts);
        assert!(cut == whole, "{back_end}: another picture");
    }
    assert_silent(&gpu);
}

#[test]
fn a_part_carried_less_than_the_bound_keeps_the_order_and_by_more_it_is_sorted_again() {
    let Some(gpu) = gpu() else { return };
    let disc = |z: f32, colour: [f32; 3]| {
        [Gaussian {
            position: [0.0, 0.0, z],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [0.2, 0.2, 0.01],
            opacity: 0.98,
            colour,
        }]
    };
    // Red is nearer by a tenth of a millimetre.
    let (red, green) = (disc(0.000_1, [1.0, 0.0, 0.0]), disc(0.0, [0.0, 1.0, 0.0]));
    let camera = [Camera::look_at(
        Vec3::Z * 2.0,
        Vec3::ZERO,
        Vec3::Y,
        0.5,
        64,
        64,
    )];
    for back_end in BACK_ENDS {
        let mut renderer = renderer_for(&gpu, back_end, 2, 64, 64, 1);
        let slots = written(&renderer, &[&red, &green]);
        let mut red_shows = |world_from_red: Affine3A| {
            let parts = [slots[0].at(world_from_red), slots[1].at(Affine3A::IDENTITY)];
            let [middle] = drawn(&mut renderer, &camera, &parts)
                .iter()
                .map(|view| view.pixels()[32 * 64 + 32])
                .collect::<Vec<_>>()[..]
            else {
                panic!("one view");
            };
            middle[0] > middle[1]
        };
        let back = |metres: f32| placed(0.0, 0.0, 0.0, -metres);
        assert!(red_shows(back(0.0)), "{back_end}: red is nearer");
        assert!(red_shows(back(0.000_24)), "{back_end}: 0.24 mm: kept");
        assert!(!red_shows(back(0.000_26)), "{back_end}: 0.26 mm: sorted");
        assert!(!red_shows(back(0.000_02)), "{back_end}: kept from there on");
        assert!(red_shows(back(0.0)), "{back_end}: and 0.26 mm back");
        // A turn moves what is at the origin by nothing, but might have moved a hand.
        let turned = Affine3A::from_rotation_y(0.000_05);
        assert!(
            red_shows(back(0.000_11) * turned),
            "{back_end}: a little of both: kept"
        );
        let turned = Affine3A::from_rotation_y(0.000_07);
        assert!(
            !red_shows(back(0.000_11) * turned),
            "{back_end}: too much of both: sorted"
        );
    }
    assert_silent(&gpu);
}

/// Some of the slots as parts, one at each place.
fn at_places<'a>(slots: &'a [Walking], present: &[usize]) -> Vec<Part<'a>> {
    let places = [
        placed(0.3, -0.4, 0.0, 0.0),
        placed(-1.0, 0.3, 0.1, -0.2),
        placed(2.0, 0.0, -0.2, 0.4),
    ];
    let parts = present.iter().zip(places);
    parts.map(|(slot, place)| slots[*slot].at(place)).collect()
}

#[test]
fn parts_come_go_and_change_places_without_a_trace() {
    let Some(gpu) = gpu() else { return };
    let rows = [500, 2_000, 1_200].map(|count| random_gaussians(count, 50 + count as u64));
    let rows = rows.each_ref().map(Vec::as_slice);
    let camera = [front_camera(160, 120)];
    for back_end in BACK_ENDS {
        let mut renderer = renderer_for(&gpu, back_end, 3_700, 160, 120, 1);
        let slots = written(&renderer, &rows);
        let mut seen: Vec<Vec<Image>> = Vec::new();
        for present in [
            &[0, 1, 2][..],
            &[0, 2],
            &[2],
            &[],
            &[1, 2],
            &[2, 1],
            &[2, 1, 0],
            // Twice the same, at two places.
            &[0, 0],
        ] {
            let got = drawn(&mut renderer, &camera, &at_places(&slots, present));
            let mut fresh = renderer_for(&gpu, back_end, 3_700, 160, 120, 1);
            let new = written(&fresh, &rows);
            let expected = drawn(&mut fresh, &camera, &at_places(&new, present));
            assert!(got == expected, "{back_end}, {present:?}: another picture");
            assert!(
                !seen.contains(&got),
                "{back_end}, {present:?}: nothing changed"
            );
            seen.push(got);
        }
        // A part whose slot is dropped leaves nothing behind either.
        let mut slots = slots;
        let with = drawn(&mut renderer, &camera, &at_places(&slots, &[0, 1]));
        slots.truncate(1);
        let alone = drawn(&mut renderer, &camera, &at_places(&slots, &[0]));
        assert!(alone != with, "{back_end}: one went");
        slots.extend(written(&renderer, &rows[1..2]));
        let again = drawn(&mut renderer, &camera, &at_places(&slots, &[0, 1]));
        assert!(again == with, "{back_end}: and came back");
    }
    assert_silent(&gpu);
}

#[test]
fn the_set_foreground_is_placed_by_its_part() {
    let Some(gpu) = gpu() else { return };
    let (set, slotted) = (random_gaussians(800, 61), random_gaussians(700, 62));
    let camera = [front_camera(128, 128)];
    let (here, there) = (placed(0.5, 0.1, 0.0, 0.0), placed(-0.7, -0.1, 0.2, 0.1));
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 1_500, 128, 128, 1);
    let slots = written(&renderer, &[&set, &slotted]);
    let expected = drawn(
        &mut renderer,
        &camera,
        &[slots[0].at(here), slots[1].at(there)],
    );
    show(&mut renderer, &set, &camera).expect("a picture");
    let placed = Part {
        gaussians: Foreground::Set,
        world_from_part: here,
    };
    let got = drawn(&mut renderer, &camera, &[placed, slots[1].at(there)]);
    assert!(got == expected, "another picture");
    assert_silent(&gpu);
}

#[test]
fn parts_that_cannot_be_drawn_are_refused_by_name() {
    let Some(gpu) = gpu() else { return };
    let camera = [front_camera(64, 64)];
    let mut renderer = SplatRenderer::new(
        gpu.clone(),
        &RendererOptions {
            back_end: Some(BackEnd::Tiles),
            ..RendererOptions::new(100, 64, 64, 1)
        },
    )
    .expect("a renderer");
    let row = random_gaussians(60, 63);
    let slots = written(&renderer, &[&row, &row]);
    let here = Affine3A::IDENTITY;
    let mut refused = |parts: &[Part<'_>]| {
        renderer
            .draw_with(&Drawing::new(&camera, parts))
            .expect_err("it cannot be drawn")
    };
    let error = refused(&[Part::here(Foreground::Set); MOST_PARTS + 1]);
    assert!(
        matches!(error, RenderError::TooManyParts { parts: 10 }),
        "{error}"
    );
    let error = refused(&[slots[0].at(here), slots[1].at(here)]);
    assert!(
        matches!(
            error,
            RenderError::TooManyGaussians {
                count: 120,
                limit: 100
            }
        ),
        "{error}"
    );
    for (what, broken) in [
        ("larger", Affine3A::from_scale(Vec3::splat(1.01))),
        ("mirrored", Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0))),
        ("nowhere", placed(0.0, f32::NAN, 0.0, 0.0)),
        ("without end", placed(0.0, f32::INFINITY, 0.0, 0.0)),
        ("turned by no number", placed(f32::NAN, 0.0, 0.0, 0.0)),
    ] {
        let set = Part::here(Foreground::Set);
        let error = refused(&[set, slots[0].at(broken)]);
        assert!(
            matches!(error, RenderError::PartNotRigid { part: 1 }),
            "{what}: {error}"
        );
    }
    let parts = [slots[0].at(here)];
    renderer
        .draw_with(&Drawing::new(&camera, &parts))
        .expect("a picture all the same");
    assert_silent(&gpu);
}
