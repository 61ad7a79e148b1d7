use super::*;
use crate::size::Size;
use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec3A};
use renderer_splat::host_picture::HostPicture;
use renderer_splat::picture::Backdrop;
use renderer_splat::window::WindowTarget;
use spmm3::MotionParams;
use std::time::Duration;
use synthetic_person::Puppet;
use test_support::{onnx, vulkan};

fn shot(number: u8) -> Shot {
    let (width, height) = (64, 48);
    let camera = Camera::of_view(Vec2::new(64.0, 48.0), 60.0);
    // 3 m away, 1 m above the floor, level.
    let flip = Mat3A::from_diagonal(Vec3::new(1.0, -1.0, -1.0));
    Shot {
        picture: Arc::new(Picture {
            width,
            height,
            rgb: vec![number; 64 * 48 * 3],
            ..Picture::empty()
        }),
        observation: Observation::default(),
        fitted: Fitted {
            motion: MotionParams::default(),
            camera_from_room: Affine3A {
                matrix3: flip,
                translation: Vec3A::new(0.0, 1.0, 3.0),
            },
            sees_person: true,
            limbs: [1.0; 6],
            hands: [1.0; 2],
            face: 1.0,
            reprojection_px: 0.0,
            swapped: false,
        },
        camera,
        pace: Pace::default(),
        notice: None,
        calibrating: None,
    }
}

#[test]
fn the_newest_shot_is_drawn_beside_its_own_picture_and_the_end_ends_it() {
    let (Some(gpu), Some(runtime)) = (vulkan::gpu(), onnx::runtime()) else {
        return;
    };
    let bytes = Puppet::small().avatar().to_bytes().expect("a package");
    let avatar = Avatar::read(std::io::Cursor::new(bytes)).expect("the package is sound");
    let avatar = Arc::new(avatar);
    let renderer = StillRenderer {
        gpu: &gpu,
        runtime: &runtime,
        avatar: &avatar,
    };
    let composition = Composition::of_side(&shot(0).camera, 128);
    let shots = HandOver::default();
    // Of these two only the newer one is shown; the third comes when that has been.
    shots.put(shot(10));
    shots.put(shot(100));
    let mut pages = Vec::new();
    draw(&renderer, &composition, &shots, |page| {
        pages.push(page);
        match pages.len() {
            1 => shots.put(shot(200)),
            _ => shots.close(),
        }
    })
    .expect("drawn");
    assert_eq!(shots.dropped(), 1, "one was left out");
    let Size { width, height } = composition.half();
    let seen: Vec<u8> = pages.iter().map(|page| page.get_pixel(5, 5).0[0]).collect();
    assert_eq!(seen, [100, 200], "each with its own picture");
    for page in &pages {
        assert_eq!(
            page.dimensions(),
            (2 * width, height + 2 * STRIP_HEIGHT),
            "its size"
        );
        let right = imageops::crop_imm(page, width, 0, width, height).to_image();
        let first = right.get_pixel(0, 0);
        let others = right.pixels().filter(|pixel| *pixel != first).count();
        assert!(others > 50, "the avatar is drawn: {others} pixels");
        let below = imageops::crop_imm(page, 0, height, 2 * width, STRIP_HEIGHT).to_image();
        assert!(below.pixels().any(|pixel| pixel.0[0] > 150), "text below");
    }
}

#[test]
fn a_composed_picture_is_shown_in_a_window_of_any_size() {
    let Some(gpu) = vulkan::gpu() else {
        return;
    };
    let mut target = match WindowTarget::headless(&gpu, 96, 64) {
        Ok(target) => target,
        Err(why) => {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
            println!("skipped: {why}");
            return;
        }
    };
    let mut picture = HostPicture::new(&gpu, 48, 32).expect("a picture");
    picture.write(&[120; 48 * 32 * 3]);
    let backdrop = Backdrop::Gradient {
        top: [0.0; 3],
        bottom: [0.0; 3],
    };
    target.present_picture(&picture, backdrop).expect("shown");
    // Fewer bytes and more than it has are no harm.
    picture.write(&[1; 7]);
    picture.write(&vec![1; 1 << 16]);
    target.resize(50, 200);
    target
        .present_picture(&picture, backdrop)
        .expect("shown again");
}

#[test]
fn a_preview_that_is_closed_takes_nothing_and_holds_no_picture() {
    let shots = HandOver::default();
    let kept = shot(1);
    let picture = Arc::clone(&kept.picture);
    shots.put(kept);
    shots.close();
    shots.put(shot(2));
    assert!(shots.take().is_none(), "nothing to take");
    assert_eq!(
        Arc::strong_count(&picture),
        1,
        "the tracker has its memory back"
    );
    // What waits is woken.
    let shots = Arc::new(HandOver::<Shot>::default());
    let waiting = std::thread::spawn({
        let shots = Arc::clone(&shots);
        move || shots.take().is_none()
    });
    std::thread::sleep(Duration::from_millis(5));
    shots.close();
    assert!(waiting.join().expect("no panic"), "ended");
}
