//! An avatar's own renders, written as a capture, are what the avatar looks like.

use super::ablation::{Ablation, Part};
use super::colours::Colours;
use super::groups::groups;
use super::{Judges, draw, measure};
use capture::{Camera, Capture, CaptureWriter, FramePose, HeldOut, Photograph};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use mon3tr::stills::StillRenderer;
use renderer_splat::picture::Image;
use spmm3::{Avatar, Joint, MotionParams};
use std::sync::Arc;
use synthetic_person::Puppet;
use test_support::{onnx, vulkan};

const SIZE: [u32; 2] = [112, 128];

/// A camera that sees the whole person from a direction, its principal point off the middle.
fn camera(name: &str, angle: f64) -> Camera {
    let eye = DVec3::new(angle.sin() * 3.4, 1.3, angle.cos() * 3.4);
    let forward = (DVec3::new(0.0, 0.9, 0.0) - eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let axes = DMat3::from_cols(right, forward.cross(right), forward).transpose();
    Camera {
        name: name.to_owned(),
        size: SIZE,
        focal: [180.0, 175.0],
        centre: [60.0, 61.0],
        distortion: [0.0; 5],
        camera_from_world: DAffine3 {
            matrix3: axes,
            translation: -(axes * eye),
        },
    }
}

/// What was drawn as a masked photograph: colours without alpha, and alpha.
fn photograph(image: &Image) -> Photograph {
    #[expect(clippy::cast_possible_truncation, reason = "limited to 0..=255")]
    let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
    let mut rgb = Vec::new();
    for [red, green, blue, alpha] in image.pixels() {
        // By the alpha as it is stored, so that their product is the picture.
        let stored = f32::from(byte(*alpha)) / 255.0;
        rgb.extend([red, green, blue].map(|value| byte(*value / stored.max(1e-3))));
    }
    let mask = image.pixels().iter().map(|pixel| byte(pixel[3]));
    Photograph {
        size: [image.width(), image.height()],
        rgb,
        mask: Some(mask.collect()),
    }
}

/// As from a package, so that its networks can be read back.
fn puppet() -> Avatar {
    let bytes = Puppet::small().avatar().to_bytes().expect("a package");
    Avatar::read(std::io::Cursor::new(bytes)).expect("the package is sound")
}

#[test]
fn an_avatars_own_renders_as_a_capture_are_met_and_what_is_switched_off_is_missed() {
    let (Some(gpu), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    let avatar = Arc::new(puppet());
    let cameras = [camera("front", 0.2), camera("side", 1.4)];
    let motions: Vec<MotionParams> = (0..3u8)
        .map(|k| {
            let mut motion = MotionParams::default();
            let bend = 0.3 + 0.25 * f32::from(k);
            motion.set_axis_angle(Joint::LeftShoulder, Vec3::new(0.0, 0.2, -bend));
            motion.set_axis_angle(Joint::RightElbow, Vec3::new(0.0, bend, 0.0));
            motion.set_axis_angle(Joint::Spine1, Vec3::new(0.2 * bend, 0.1, 0.0));
            motion.root_translation = Vec3::new(0.05 * f32::from(k), 0.0, 0.02);
            motion
        })
        .collect();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("capture");
    std::fs::create_dir(&path).expect("a folder");
    let poses: Vec<FramePose> = (motions.iter())
        .map(|motion| FramePose::of(motion, &avatar.skeleton))
        .collect();
    let held_out = HeldOut {
        cameras: vec![1],
        frames: vec![2],
    };
    let renderer = StillRenderer {
        gpu: &gpu,
        runtime: &runtime,
        avatar: &avatar,
    };
    let all: Vec<(usize, usize)> = (0..2).flat_map(|c| (0..3).map(move |f| (c, f))).collect();
    // The renders need a capture whose pictures they then become: first an empty one, then one with the renders.
    let write = |path: &std::path::Path, pictures: &[Photograph]| -> Capture {
        let writer = CaptureWriter::create(path, &cameras, 3, 30.0)
            .expect("a writer")
            .with_expression_basis(Some(avatar.expression_basis.clone()));
        for ((camera, frame), picture) in all.iter().zip(pictures) {
            writer.write(*camera, *frame, picture).expect("a picture");
        }
        writer.finish(Some(&poses), &held_out).expect("a capture");
        Capture::open(path).expect("a capture")
    };
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let blank = Photograph {
        size: SIZE,
        rgb: vec![0; 3 * pixels],
        mask: Some(vec![0; pixels]),
    };
    let empty = write(&folder.path().join("empty"), &vec![blank.clone(); 6]);
    let mut pictures = vec![blank; 6];
    draw::draw(&renderer, &empty, &motions, &all, |k, image| {
        pictures[k] = photograph(image);
        Ok(())
    })
    .expect("renders");
    let capture = write(&path, &pictures);
    let motions = draw::motions(&capture, &avatar).expect("it has poses");
    let groups = groups(2, 3, capture.held_out(), 10);
    let mut judges = Judges {
        lpips: None,
        features: None,
    };
    // Of pictures whose colours are right already.
    let colours = Colours::fitted(&renderer, &capture, &motions).expect("a fit");
    let mut full = Vec::new();
    for group in &groups {
        let means = measure(
            &renderer,
            &capture,
            &motions,
            &colours,
            group,
            &mut judges,
            |_, _, _| Ok(()),
        )
        .expect("figures");
        let scores = means.scores.expect("every group has pictures");
        assert!(scores.psnr_masked > 45.0, "{}: {scores:?}", group.name);
        assert!(scores.ssim_masked > 0.995, "{}: {scores:?}", group.name);
        full.push(scores.psnr_masked);
    }
    for part in [Part::Attributes, Part::Mesh] {
        let ablation = Ablation {
            without: vec![part],
            nearest_controller: false,
        };
        let ablated = Arc::new(ablation.of((*avatar).clone()).expect("our own networks"));
        let renderer = StillRenderer {
            avatar: &ablated,
            ..renderer
        };
        let means = measure(
            &renderer,
            &capture,
            &motions,
            &colours,
            &groups[0],
            &mut judges,
            |_, _, _| Ok(()),
        );
        let scores = means.expect("figures").scores.expect("pictures");
        assert!(
            scores.psnr_masked < full[0] - 3.0,
            "without {part:?} the picture is as good: {scores:?}"
        );
    }
}
