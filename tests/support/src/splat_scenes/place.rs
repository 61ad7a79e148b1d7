//! Static scenes: random ones of every degree of spherical harmonics, and a place to put a person in.

use glam::{Quat, Vec3};
use renderer_splat::camera::Camera;
use splat_scene::{SH_C0, Scene, SceneBuilder, Splat, rest_coefficients};

use super::random_gaussians;
use synthetic_person::Random;

/// Display colour of the railing's bars.
pub const BAR_COLOUR: [f32; 3] = [0.75, 0.6, 0.1];
/// Metres from one bar to the next.
const BAR_SPACING: f32 = 0.16;
/// Where the bars stand before the figure, metres.
const BARS_Z: f32 = 0.4;

/// The Gaussians of [`random_gaussians`] as a scene whose colours depend on the direction of view, up to a degree.
pub fn random_scene(count: usize, sh_degree: u8, seed: u64) -> Scene {
    let mut builder = SceneBuilder::new(sh_degree).expect("a degree from 0 to 3");
    let mut random = Random::new(seed);
    for gaussian in random_gaussians(count, seed) {
        let splat = Splat {
            position: gaussian.position,
            rotation: gaussian.rotation,
            log_scale: gaussian.scale.map(f32::ln),
            opacity: gaussian.opacity,
            colour: gaussian.colour.map(|channel| (channel - 0.5) / SH_C0),
        };
        let rest: Vec<f32> = (0..3 * rest_coefficients(sh_degree))
            .map(|_| 0.3 * random.signed())
            .collect();
        builder.push(&splat, &rest).expect("room for one more");
    }
    builder.finish()
}

/// A railing before the figure, a wall and a floor behind and below it; the wall's colour depends on the direction of
/// view a little (SH degree 1).
pub fn railing_and_wall() -> Scene {
    let mut builder = SceneBuilder::new(1).expect("degree 1");
    let mut random = Random::new(21);
    let mut add = |position: Vec3, scale: Vec3, opacity: f32, colour: [f32; 3], shine: f32| {
        // A little roughness, as captures have: splats in one plane would have no order that all arithmetic agrees on.
        let rough = 0.002 * random.vector();
        let splat = Splat {
            position: (position + rough).to_array(),
            rotation: Quat::IDENTITY.to_array(),
            log_scale: scale.to_array().map(f32::ln),
            opacity,
            colour: colour.map(|channel| (channel - 0.5) / SH_C0),
        };
        // Brighter where one looks up at it, and to the left.
        let rest = [-1.0, 0.0, 0.6].map(|way| [way * shine; 3]);
        builder
            .push(&splat, rest.as_flattened())
            .expect("room for one more");
    };
    let steps = |count: u16, step: f32| {
        (0..count).map(move |index| step * (f32::from(index) - 0.5 * f32::from(count - 1)))
    };
    // Bars: three threads of splats each, so that they are opaque but not flat.
    for x in steps(15, BAR_SPACING) {
        for y in steps(70, 0.0155) {
            for (side, forward) in [(-0.006, 0.0), (0.006, 0.0), (0.0, 0.008)] {
                let place = Vec3::new(x + side, 0.55 + y, BARS_Z + forward);
                let shade = if side > 0.0 { 0.8 } else { 1.0 };
                let colour = BAR_COLOUR.map(|channel| channel * shade);
                add(place, Vec3::new(0.006, 0.012, 0.006), 0.97, colour, 0.0);
            }
        }
    }
    for x in steps(160, 0.0155) {
        let place = Vec3::new(x, 1.11, BARS_Z);
        add(
            place,
            Vec3::new(0.012, 0.014, 0.02),
            0.98,
            [0.4, 0.25, 0.1],
            0.0,
        );
    }
    for x in steps(120, 0.05) {
        for y in steps(70, 0.05) {
            let tile = (x / 0.6).floor() + (y / 0.6).floor();
            let light = if tile.rem_euclid(2.0) < 1.0 {
                0.62
            } else {
                0.5
            };
            let colour = [light, light, 0.95 * light];
            let place = Vec3::new(x, 1.7 + y, -0.9);
            add(place, Vec3::new(0.04, 0.04, 0.004), 0.97, colour, 0.1);
        }
        for z in steps(80, 0.05) {
            let place = Vec3::new(x, -0.02, 1.08 + z);
            let colour = [0.32, 0.36, 0.3];
            add(place, Vec3::new(0.04, 0.004, 0.04), 0.97, colour, 0.1);
        }
    }
    builder.finish()
}

/// A point on the front of the bar nearest to the middle, before the figure's chest.
pub fn on_a_bar() -> Vec3 {
    Vec3::new(0.0, 1.0, BARS_Z + 0.012)
}

/// A point in the gap beside that bar.
pub fn between_bars() -> Vec3 {
    Vec3::new(0.5 * BAR_SPACING, 1.0, BARS_Z)
}

/// A camera that has the figure, the railing and the wall in its picture.
pub fn in_front_of_figure(width: u32, height: u32) -> Camera {
    let (eye, target) = (Vec3::new(0.5, 1.3, 2.9), Vec3::new(0.0, 0.95, 0.0));
    Camera::look_at(eye, target, Vec3::Y, 0.7, width, height)
}
