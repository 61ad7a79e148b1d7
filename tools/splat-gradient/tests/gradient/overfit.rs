//! A few Gaussians learn two pictures.

use crate::device::device;
use crate::scenes::{attributes_of, view_of};
use glam::Vec3;
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use splat_gradient::Picture;
use splat_gradient::adam::{Adam, Group};
use splat_gradient::attributes::{Attributes, plane};
use splat_gradient::loss::{Ssim, Target, alpha_l1, colour_l1};
use synthetic_person::Random;
use test_support::splat_reference::render;
use test_support::splat_scenes::random_gaussians;

const SIZE: u32 = 64;

/// The picture that the f64 reference draws.
#[expect(
    clippy::cast_possible_truncation,
    reason = "pictures are single precision"
)]
fn photograph(gaussians: &[Gaussian], camera: &Camera) -> Picture {
    let reference = render(gaussians, camera);
    let planes = (0..4).flat_map(|channel| reference.pixels.iter().map(move |p| p[channel] as f32));
    Picture::new(reference.width, reference.height, planes.collect()).expect("as many")
}

/// Over red, green and blue of all pixels.
fn psnr(a: &Picture, b: &Picture) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for channel in 0..3 {
        for (a, b) in a.plane(channel).iter().zip(b.plane(channel)) {
            sum += f64::from(a - b).powi(2);
            count += 1.0;
        }
    }
    -10.0 * (sum / count).log10()
}

#[test]
fn two_hundred_gaussians_learn_two_pictures_to_35_db() {
    let Some(mut device) = device() else { return };
    let mut truth = random_gaussians(200, 31);
    for gaussian in &mut truth {
        gaussian.scale = gaussian.scale.map(|scale| 0.02 + 2.0 * scale);
        gaussian.colour = gaussian.colour.map(|channel| channel.clamp(0.05, 0.95));
    }
    let camera = |x: f32, z: f32| {
        Camera::look_at(Vec3::new(x, 0.4, z), Vec3::ZERO, Vec3::Y, 0.75, SIZE, SIZE)
    };
    let cameras = [camera(0.4, 3.0), camera(-2.4, 1.9)];
    let views = cameras.map(|camera| view_of(&camera));
    let targets = cameras.map(|camera| Target::new(photograph(&truth, &camera)));

    // Grey balls near where something is.
    let mut random = Random::new(12);
    let mut start = truth;
    for gaussian in &mut start {
        gaussian.position = gaussian.position.map(|x| x + 0.1 * random.signed());
        gaussian.rotation = [0.0, 0.0, 0.0, 1.0];
        gaussian.scale = [0.08; 3];
        gaussian.opacity = 0.5;
        gaussian.colour = [0.5; 3];
    }
    let mut learnt = attributes_of(&start);
    let mut groups = [Group {
        count: learnt.len(),
        rate: 0.0,
    }; 14];
    for (planes, rate) in [
        (plane::POSITION, 4e-3),
        (plane::ROTATION, 1e-2),
        (plane::LOG_SCALE, 2e-2),
        (plane::OPACITY..plane::OPACITY + 1, 4e-2),
        (plane::COLOUR, 2e-2),
    ] {
        for plane in planes {
            groups[plane].rate = rate;
        }
    }
    let mut adam = Adam::new(learnt.numbers().len());
    let mut ssim = Ssim::new();
    let first = device.draw(&learnt, &views[0]);
    let before = first.map(|drawn| psnr(drawn.picture(), targets[0].picture()));
    let before = before.expect("drawn");
    let side = SIZE as usize;
    let steps: u16 = 600;
    for step in 0..steps {
        let mut gradients = Attributes::zeros(learnt.len());
        for (view, target) in views.iter().zip(&targets) {
            let mut drawn = device.draw(&learnt, view).expect("drawn");
            let mut by_pixel = Picture::transparent(side, side);
            let picture = drawn.picture();
            colour_l1(picture, target, 0.8, &mut by_pixel).expect("one size");
            ssim.loss(picture, target, 0.2, &mut by_pixel)
                .expect("one size");
            alpha_l1(picture, target, 0.1, &mut by_pixel).expect("one size");
            drawn.backward(&by_pixel, &mut gradients).expect("one size");
        }
        let slower = 0.02f32.powf(f32::from(step) / f32::from(steps));
        let now = groups.map(|group| Group {
            rate: group.rate * slower,
            ..group
        });
        adam.step(learnt.numbers_mut(), gradients.numbers(), &now)
            .expect("all");
    }
    for (view, target) in views.iter().zip(&targets) {
        let drawn = device.draw(&learnt, view).expect("drawn");
        let found = psnr(drawn.picture(), target.picture());
        println!("{before:.1} dB before, {found:.1} dB learnt");
        assert!(found >= 35.0, "{found:.1} dB, from {before:.1}");
    }
}
