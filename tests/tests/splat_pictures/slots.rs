//! Foregrounds written to slots while others are drawn, and slots that come and go.

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::thread;

use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::options::BackEnd;
use test_support::picture_check::{BACK_ENDS, packed, renderer_for, show, views_of};
use test_support::splat_scenes::{front_camera, random_gaussians};
use test_support::vulkan::{assert_silent, gpu, open_gpu};
use test_support::walking::Walking;

#[test]
fn slots_filled_by_another_thread_while_others_are_drawn_show_what_was_set() {
    let Some(gpu) = gpu() else { return };
    let camera = front_camera(160, 120);
    let frames: Vec<_> = (0..12).map(|seed| random_gaussians(4_000, seed)).collect();
    for back_end in BACK_ENDS {
        let mut expected = renderer_for(&gpu, back_end, 4_000, 160, 120, 1);
        let mut renderer = renderer_for(&gpu, back_end, 4_000, 160, 120, 1);
        let (give, free) = channel();
        for _ in 0..3 {
            let slot = renderer.foreground_slot().expect("memory for a slot");
            give.send(slot).expect("the other end");
        }
        let (to_renderer, written) = channel();
        thread::scope(|scope| {
            scope.spawn(|| {
                for (frame, mut slot) in frames.iter().zip(free) {
                    let gaussians = packed(frame);
                    slot.gaussians_mut()[..gaussians.len()].copy_from_slice(&gaussians);
                    slot.set(4_000, MotionBound::new()).expect("they fit");
                    to_renderer.send(slot).expect("the other end");
                }
                drop(to_renderer);
            });
            for frame in &frames {
                let slot = written.recv().expect("the writer lives");
                for _ in 0..2 {
                    let cameras = [camera];
                    let parts = [Part::here(Foreground::Slot(&slot))];
                    let drawing = Drawing::new(&cameras, &parts);
                    renderer.draw_with(&drawing).expect("a picture");
                }
                // The writer may have finished.
                let _ = give.send(slot);
                show(&mut expected, frame, &[camera]).expect("a picture");
                let same = views_of(&mut renderer) == views_of(&mut expected);
                assert!(same, "{back_end}: another picture");
            }
        });
    }
    assert_silent(&gpu);
}

#[test]
fn slots_and_the_set_foreground_take_turns_and_no_foreground_is_none() {
    let Some(gpu) = gpu() else { return };
    let camera = front_camera(128, 128);
    let [set, slotted] = [5, 6].map(|seed| random_gaussians(1_000, seed));
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 1_000, 128, 128, 1);
    let mut slot = Walking::new(&renderer);
    slot.write(&slotted);
    slot.draw(&mut renderer, &[camera], false)
        .expect("a picture");
    let from_slot = views_of(&mut renderer);
    renderer.draw(&[camera]).expect("a picture of nothing");
    let nothing = views_of(&mut renderer);
    let alpha = |pixel: &[f32; 4]| pixel[3];
    assert!(
        nothing[0].pixels().iter().all(|pixel| alpha(pixel) == 0.0),
        "nothing was set"
    );
    show(&mut renderer, &set, &[camera]).expect("a picture");
    let from_set = views_of(&mut renderer);
    assert!(from_set != from_slot, "two foregrounds");
    slot.draw(&mut renderer, &[camera], false)
        .expect("a picture");
    assert!(views_of(&mut renderer) == from_slot, "the slot again");
    drop(slot);
    renderer.draw(&[camera]).expect("a picture");
    assert!(views_of(&mut renderer) == from_set, "what was set again");
    assert_silent(&gpu);
}

#[test]
fn a_slot_may_go_before_its_renderer_or_after_it() {
    let Some(gpu) = gpu() else { return };
    let (gaussians, camera) = (random_gaussians(500, 7), front_camera(64, 64));
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 500, 64, 64, 1);
    let [mut before, mut after] = [(); 2].map(|()| Walking::new(&renderer));
    before.write(&gaussians);
    before
        .draw(&mut renderer, &[camera], false)
        .expect("a picture");
    drop(before);
    after.write(&gaussians);
    after
        .draw(&mut renderer, &[camera], false)
        .expect("a picture");
    drop(renderer);
    after.write(&gaussians);
    // A slot fits every renderer of its device.
    let mut another = renderer_for(&gpu, BackEnd::Tiles, 500, 64, 64, 1);
    after
        .draw(&mut another, &[camera], false)
        .expect("a picture");
    assert_silent(&gpu);
}

#[test]
fn slots_of_another_device_or_with_too_many_gaussians_are_refused() {
    let Some(gpu) = gpu() else { return };
    let camera = front_camera(64, 64);
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 100, 64, 64, 1);
    let mut slot = renderer.foreground_slot().expect("memory for a slot");
    assert_eq!(slot.gaussians_mut().len(), 100, "room");
    let refused = slot.set(101, MotionBound::new());
    assert!(
        matches!(
            refused,
            Err(RenderError::TooManyGaussians {
                count: 101,
                limit: 100
            })
        ),
        "{refused:?}"
    );
    assert!(slot.is_empty(), "as before");
    let larger = renderer_for(&gpu, BackEnd::Tiles, 200, 64, 64, 1);
    let mut full = Walking::new(&larger);
    full.write(&random_gaussians(150, 8));
    let refused = full.draw(&mut renderer, &[camera], false);
    assert!(
        matches!(refused, Err(RenderError::TooManyGaussians { .. })),
        "{refused:?}"
    );
    let other = open_gpu().expect("a second device like the first");
    assert!(!Arc::ptr_eq(&other, &gpu), "two devices");
    let stranger = Walking::new(&renderer_for(&other, BackEnd::Tiles, 100, 64, 64, 1));
    let refused = stranger.draw(&mut renderer, &[camera], false);
    assert!(
        matches!(refused, Err(RenderError::ForeignSlot)),
        "{refused:?}"
    );
    renderer.draw(&[camera]).expect("a picture all the same");
    assert_silent(&gpu);
}
