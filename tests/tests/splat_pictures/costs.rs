//! Foregrounds that cover more tiles than any device draws in time: refused before they are drawn, by the part to be left out.

use glam::{Affine3A, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::{Gaussian, PackedGaussian};
use renderer_splat::limits::{MOST_FOREGROUND_PAIRS, MOST_PART_PAIRS};
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::slot::ForegroundSlot;
use std::sync::Arc;
use test_support::picture_check::{BACK_ENDS, packed, views_of};
use test_support::splat_scenes::standing_figure;
use test_support::vulkan::{assert_silent, gpu};

/// One that covers every picture here, hardly to be seen.
fn huge() -> PackedGaussian {
    PackedGaussian::from(&Gaussian {
        position: [0.0, 1.0, 0.0],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [7.0; 3],
        opacity: 0.05,
        colour: [0.9, 0.1, 0.4],
    })
}

fn slot(renderer: &SplatRenderer, gaussians: &[PackedGaussian]) -> ForegroundSlot {
    let count = u32::try_from(gaussians.len()).expect("few");
    let mut slot = renderer.foreground_slot_for(count).expect("memory");
    slot.gaussians_mut().copy_from_slice(gaussians);
    slot.set(count, renderer_splat::motion_bound::MotionBound::new())
        .expect("they fit");
    slot
}

fn part(slot: &ForegroundSlot) -> Part<'_> {
    Part {
        gaussians: Foreground::Slot(slot),
        world_from_part: Affine3A::IDENTITY,
    }
}

fn camera(side: u32) -> Camera {
    Camera::look_at(Vec3::new(0.0, 1.0, 3.0), Vec3::Y, Vec3::Y, 0.7, side, side)
}

#[test]
fn huge_gaussians_are_refused_by_their_part_and_the_others_are_drawn_without_them() {
    let Some(gpu) = gpu() else { return };
    let figure = packed(&standing_figure(5_000));
    // 30,000 of 7 m, and so many in both eyes that 32 bits do not hold their pairs.
    for (count, side, views, pairs) in [
        (30_000, 512, 1, 30_000 * 32 * 32),
        (550_000, 1024, 2, 550_000 * 64 * 64 * 2_u64),
    ] {
        for back_end in BACK_ENDS {
            let options = RendererOptions {
                back_end: Some(back_end),
                ..RendererOptions::new(5_000 + count, side, side, views)
            };
            let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
            let cameras = vec![camera(side); views as usize];
            let hostile = vec![huge(); count as usize];
            let slots = [&figure, &hostile].map(|gaussians| slot(&renderer, gaussians));
            let alone = [part(&slots[0])];
            let both = [part(&slots[0]), part(&slots[1])];
            let draw = |renderer: &mut SplatRenderer, parts: &[Part<'_>]| {
                renderer.draw_with(&Drawing::new(&cameras, parts))
            };
            draw(&mut renderer, &alone).expect("a figure");
            let before = views_of(&mut renderer);
            let figures_pairs = renderer.part_pairs()[0];
            // Sorted, and with the order that was kept.
            for _ in 0..2 {
                let refused = draw(&mut renderer, &both).expect_err("too many tiles");
                assert_eq!(refused.costly_part(), Some(1), "{refused}");
                let RenderError::CostlyPart {
                    pairs: counted,
                    limit,
                    ..
                } = refused
                else {
                    panic!("{refused}");
                };
                assert_eq!((counted, limit), (pairs, MOST_PART_PAIRS), "{back_end}");
                assert_eq!(renderer.part_pairs()[0], figures_pairs, "the figure's");
            }
            draw(&mut renderer, &alone).expect("the figure again");
            assert!(views_of(&mut renderer) == before, "{back_end}: as before");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn parts_that_cost_too_much_together_are_refused_by_the_one_that_costs_most() {
    let Some(gpu) = gpu() else { return };
    let (side, tiles) = (512, 32 * 32);
    // Each within its bound, by half a million pairs and more.
    let counts = [7_000, 7_600, 7_100];
    let sum: u64 = counts.iter().map(|count| u64::from(*count) * tiles).sum();
    assert!(sum > MOST_FOREGROUND_PAIRS.into(), "all together");
    assert!(7_600 * tiles < MOST_PART_PAIRS.into(), "and each");
    for back_end in BACK_ENDS {
        let options = RendererOptions {
            back_end: Some(back_end),
            ..RendererOptions::new(counts.iter().sum(), side, side, 1)
        };
        let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
        let slots = counts.map(|count| slot(&renderer, &vec![huge(); count as usize]));
        let parts = slots.each_ref().map(part);
        let refused = renderer.draw_with(&Drawing::new(&[camera(side)], &parts));
        let refused = refused.expect_err("too many tiles");
        assert_eq!(refused.costly_part(), Some(1), "{refused}");
        let counted = renderer.part_pairs();
        let expected = counts.map(|count| u64::from(count) * tiles);
        assert_eq!(counted[..3], expected, "{back_end}");
    }
    assert_silent(&gpu);
}
