//! Pictures of Gaussians that only the device has, against pictures of those that the CPU posed.

use crate::person::{PUPPET, Pose, mesh_of};
use glam::{Affine3A, Quat, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Image;
use renderer_splat::posing::{Deformation, DetailLevel, PosedInput, Poser, StateId};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use spmm3::{GaussianSet, PlanarVertices, SH_C0};
use std::sync::Arc;
use synthetic_person::{Puppet, PuppetSize};
use test_support::picture_check::{BACK_ENDS, compare, whole};
use test_support::vulkan::{assert_silent, gpu};

/// Least likeness to the CPU's picture, dB, and the largest difference of a channel. What differs is a state's rounding
/// before it is interpolated, and Gaussians that change places by less than the key tells apart.
const LEAST: f64 = 60.0;
const MOST: f32 = 0.03;

/// Far enough for all of the puppet, wherever its root goes.
fn camera(size: u32) -> Camera {
    let eye = Vec3::new(0.4, 1.2, 4.5);
    Camera::look_at(eye, Vec3::new(0.0, 0.9, 0.0), Vec3::Y, 0.9, size, size)
}

/// Posing on the CPU: F_m2g in single precision, with residuals from the reference.
#[allow(
    clippy::cast_possible_truncation,
    reason = "networks give single precision"
)]
fn posed_on_cpu(puppet: &Puppet, pose: &Pose) -> GaussianSet {
    let skinned = pose.skinned(puppet);
    let planes: Vec<f32> = (0..3)
        .flat_map(|axis| skinned.iter().map(move |p| p[axis] as f32))
        .collect();
    let residuals = pose.residuals(puppet);
    let residuals: Vec<f32> = (0..14)
        .flat_map(|plane| residuals.iter().map(move |r| r[plane] as f32))
        .collect();
    let mut set = GaussianSet::zeroed(residuals.len() / 14);
    let posed = PlanarVertices::new(&planes, skinned.len()).expect("three planes");
    puppet
        .gaussians
        .pose(posed, Some(&residuals), Vec3::from(pose.root), &mut set)
        .expect("the puppet's own");
    set
}

/// Between two sets, as they are shown.
fn packed_between(from: &GaussianSet, to: &GaussianSet, share: f32) -> Vec<PackedGaussian> {
    let opacity = |logit: f32| 1.0 / (1.0 + (-logit).exp());
    let colour = |c: Vec3| (c * SH_C0 + 0.5).max(Vec3::ZERO);
    (0..from.len())
        .map(|i| {
            let scale = from.log_scales[i].lerp(to.log_scales[i], share);
            let faded = [from, to].map(|set| opacity(set.opacity_logits[i]));
            PackedGaussian::new(
                from.positions[i].lerp(to.positions[i], share).to_array(),
                from.rotations[i].slerp(to.rotations[i], share).to_array(),
                (scale * std::f32::consts::LOG2_E).to_array(),
                faded[0] + (faded[1] - faded[0]) * share,
                colour(from.colours[i])
                    .lerp(colour(to.colours[i]), share)
                    .to_array(),
            )
        })
        .collect()
}

fn renderer_of(gpu: &Arc<Gpu>, puppet: &Puppet, back_end: BackEnd, size: u32) -> SplatRenderer {
    let mesh = mesh_of(puppet);
    let options = RendererOptions {
        back_end: Some(back_end),
        mesh: Some(Arc::new(mesh)),
        ..RendererOptions::new(0, size, size, 1)
    };
    SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer")
}

fn posed(
    renderer: &mut SplatRenderer,
    camera: Camera,
    [from, to]: [StateId; 2],
    share: f32,
) -> Image {
    let cameras = [camera];
    let foreground = Foreground::Posed {
        from,
        to,
        share,
        level: 0,
    };
    renderer
        .draw_with(&Drawing::new(&cameras, &[Part::here(foreground)]))
        .expect("a picture");
    renderer.read_back(0).expect("a view")
}

fn uploaded(gpu: &Arc<Gpu>, back_end: BackEnd, camera: Camera, set: &[PackedGaussian]) -> Image {
    let count = u32::try_from(set.len()).expect("few");
    let options = RendererOptions {
        back_end: Some(back_end),
        ..RendererOptions::new(count, camera.width, camera.height, 1)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer");
    renderer.set_foreground(set).expect("a foreground");
    renderer.draw(&[camera]).expect("a picture");
    renderer.read_back(0).expect("a view")
}

/// Two poses a motion frame apart: 0.03 radians a joint.
fn two_poses(puppet: &Puppet) -> [Pose; 2] {
    let mut random = synthetic_person::Random::new(80);
    let mut motion = random.motion(0.4);
    motion.root_translation *= 0.3;
    let first = Pose::of(puppet, &motion);
    for joint in spmm3::Joint::ALL {
        let turned = motion.axis_angle(joint) + random.vector() * 0.03;
        motion.set_axis_angle(joint, turned);
    }
    [first, Pose::of(puppet, &motion)]
}

#[test]
fn the_device_draws_what_it_poses_as_what_the_cpu_posed() {
    let Some(gpu) = gpu() else { return };
    let puppet = Puppet::new(PuppetSize {
        detail: 2,
        gaussians: 20_001,
        ..PuppetSize::SMALL
    });
    let poses = two_poses(&puppet);
    let sets = poses.each_ref().map(|pose| posed_on_cpu(&puppet, pose));
    let camera = camera(512);
    for back_end in BACK_ENDS {
        if !back_end.runs_on(&gpu) {
            println!("skipped: no quads on this device");
            continue;
        }
        let mut renderer = renderer_of(&gpu, &puppet, back_end, 512);
        let ids = poses
            .each_ref()
            .map(|pose| renderer.push_state(&pose.input()).expect("a pose"));
        for share in [0.0, 0.4, 1.0, 1.5] {
            let want = packed_between(&sets[0], &sets[1], share);
            let want = uploaded(&gpu, back_end, camera, &want);
            let got = posed(&mut renderer, camera, ids, share);
            let alpha = want.pixels().iter().map(|pixel| pixel[3]).sum::<f32>();
            assert!(alpha > 5_000.0, "{alpha} pixels of a person");
            let (psnr, most) = compare(&got, &want, whole(&want));
            println!("{back_end} at {share}: {psnr:.1} dB, {most:.4} at most");
            assert!(
                psnr >= LEAST && most <= MOST,
                "{psnr:.1} dB, {most} at {share}"
            );
        }
        println!("{back_end}: {:?}", renderer.stage_times());
    }
    assert_silent(&gpu);
}

#[test]
fn a_posed_foreground_and_an_uploaded_one_take_turns() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let [first, second] = two_poses(puppet);
    let set = posed_on_cpu(puppet, &second);
    let set = packed_between(&set, &set, 1.0);
    let camera = camera(192);
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        mesh: Some(Arc::new(mesh_of(puppet))),
        ..RendererOptions::new(u32::try_from(set.len()).expect("few"), 192, 192, 1)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
    let nothing = posed_error(&mut renderer, camera);
    assert!(matches!(nothing, RenderError::NoState), "{nothing}");
    let id = renderer.push_state(&first.input()).expect("a pose");
    let alone = posed(&mut renderer, camera, [id, id], 1.0);
    renderer.set_foreground(&set).expect("a foreground");
    renderer.draw(&[camera]).expect("a picture");
    let between = renderer.read_back(0).expect("a view");
    assert!(between != alone, "another pose");
    let again = posed(&mut renderer, camera, [id, id], 1.0);
    assert_eq!(again, alone, "the pose is still there");
    renderer.draw(&[camera]).expect("a picture");
    let last = renderer.read_back(0).expect("a view");
    assert_eq!(last, between, "and what was uploaded");
    assert_silent(&gpu);
}

/// Of the first state before there is one, by way of another renderer's name for it.
fn posed_error(renderer: &mut SplatRenderer, camera: Camera) -> RenderError {
    let mut other = renderer_of(renderer.gpu(), &PUPPET, BackEnd::Tiles, 16);
    let pose = Pose::random(&PUPPET, 81);
    let id = other.push_state(&pose.input()).expect("a pose");
    let foreground = Foreground::Posed {
        from: id,
        to: id,
        share: 1.0,
        level: 0,
    };
    renderer
        .draw_with(&Drawing::new(&[camera], &[Part::here(foreground)]))
        .expect_err("nothing was pushed")
}

#[test]
fn every_picture_of_moving_gaussians_is_in_their_order() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let camera = camera(256);
    let mut renderer = renderer_of(&gpu, puppet, BackEnd::Tiles, 256);
    // Far apart: arms pass before the body.
    let mut ids = [0; 2].map(|_| {
        renderer
            .push_state(&Pose::random(puppet, 90).input())
            .expect("a pose")
    });
    for seed in 91..94 {
        let pose = Pose::random(puppet, seed);
        ids = [ids[1], renderer.push_state(&pose.input()).expect("a pose")];
        for share in [0.3, 0.6, 1.0] {
            let kept = posed(&mut renderer, camera, ids, share);
            renderer.forget_order();
            let fresh = posed(&mut renderer, camera, ids, share);
            assert_eq!(kept, fresh, "at {share} before pose {seed}");
        }
    }
}

#[test]
fn a_level_of_detail_is_drawn_as_its_gaussians_are_when_uploaded() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let half: Vec<u32> = (0u32..2_000).step_by(2).collect();
    let level = DetailLevel {
        kept: &half,
        log2_growth: &vec![0.4; half.len()],
    };
    let mesh = mesh_of(puppet).with_levels(&[level]).expect("its own");
    let poses = two_poses(puppet);
    let mut poser = Poser::new(&gpu, &mesh).expect("the puppet fits");
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        mesh: Some(Arc::new(mesh)),
        ..RendererOptions::new(0, 192, 192, 1)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
    let camera = camera(192);
    let ids = poses.each_ref().map(|pose| {
        let id = renderer.push_state(&pose.input()).expect("a pose");
        (id, poser.push_state(&pose.input()).expect("a pose"))
    });
    let [(from, brought_from), (to, brought_to)] = ids;
    for level in [0, 1, 0] {
        let set = poser.interpolate_level(brought_from, brought_to, 0.6, level);
        let want = uploaded(&gpu, BackEnd::Tiles, camera, &set.expect("two states"));
        let foreground = Foreground::Posed {
            from,
            to,
            share: 0.6,
            level,
        };
        renderer
            .draw_with(&Drawing::new(&[camera], &[Part::here(foreground)]))
            .expect("a picture");
        let got = renderer.read_back(0).expect("a view");
        assert_eq!(got, want, "level {level}");
    }
    assert_silent(&gpu);
}

#[test]
fn a_posed_part_among_others_is_drawn_as_its_gaussians_are_when_uploaded() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let camera = camera(192);
    let poses = two_poses(puppet);
    let mut poser = Poser::new(&gpu, &mesh_of(puppet)).expect("the puppet fits");
    let brought = poses
        .each_ref()
        .map(|pose| poser.push_state(&pose.input()).expect("a pose"));
    let turned = |angle: f32, x: f32, z: f32| {
        Affine3A::from_rotation_translation(Quat::from_rotation_y(angle), Vec3::new(x, 0.0, z))
    };
    let (here, there) = (turned(0.8, -0.2, 0.0), turned(-0.5, 0.2, 0.15));
    for back_end in BACK_ENDS {
        let count = mesh_of(puppet).gaussians();
        let options = RendererOptions {
            back_end: Some(back_end),
            mesh: Some(Arc::new(mesh_of(puppet))),
            // Room for both when both are uploaded.
            ..RendererOptions::new(2 * count, 192, 192, 1)
        };
        let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
        let [from, to] = poses
            .each_ref()
            .map(|pose| renderer.push_state(&pose.input()).expect("a pose"));
        let mut slots = [0.0, 0.6].map(|share| {
            let set = poser.interpolate(brought[0], brought[1], share);
            let mut slot = renderer.foreground_slot_for(count).expect("memory");
            slot.gaussians_mut()
                .copy_from_slice(&set.expect("two states"));
            slot
        });
        for slot in &mut slots {
            slot.set(count, MotionBound::new()).expect("they fit");
        }
        let [other, same] = slots.each_ref().map(Foreground::Slot);
        let posed = Foreground::Posed {
            from,
            to,
            share: 0.6,
            level: 0,
        };
        let part = |gaussians, world_from_part| Part {
            gaussians,
            world_from_part,
        };
        let mut picture = |parts: &[Part<'_>]| {
            let drawing = Drawing::new(std::slice::from_ref(&camera), parts);
            renderer.draw_with(&drawing).map(|()| {
                let view = renderer.read_back(0);
                view.expect("a view")
            })
        };
        let posed_last = picture(&[part(other, here), part(posed, there)]);
        let want = picture(&[part(other, here), part(same, there)]);
        assert_eq!(
            posed_last.expect("a picture"),
            want.expect("a picture"),
            "{back_end}: behind a slot"
        );
        let posed_first = picture(&[part(posed, there), part(other, here)]);
        let want = picture(&[part(same, there), part(other, here)]);
        assert_eq!(
            posed_first.expect("a picture"),
            want.expect("a picture"),
            "{back_end}: before a slot"
        );
        let twice = picture(&[part(posed, here), part(posed, there)]);
        assert!(
            matches!(twice, Err(RenderError::PosedTwice)),
            "{back_end}: {:?}",
            twice.err()
        );
    }
    assert_silent(&gpu);
}

#[test]
fn a_renderer_without_a_mesh_says_so() {
    let Some(gpu) = gpu() else { return };
    let options = RendererOptions::new(1, 16, 16, 1);
    let mut renderer = SplatRenderer::new(gpu, &options).expect("a renderer");
    let pose = PosedInput {
        deformation: Deformation::Computed {
            canonical_vertices: &[],
            potentials: &[],
        },
        skinning: &[],
        root: [0.0; 3],
    };
    let error = renderer.push_state(&pose).expect_err("no mesh");
    assert!(matches!(error, RenderError::NoMesh), "{error}");
}
