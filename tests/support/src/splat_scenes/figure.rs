//! A standing person without a bake: flat splats on the skin of a body made of ellipsoids, opaque and overlapping as a
//! scan's are.

use glam::{Quat, Vec3};
use renderer_splat::gaussian::Gaussian;

use synthetic_person::Random;

/// An ellipsoid of a body.
struct Part {
    centre: [f32; 3],
    /// Half axes, metres.
    axes: [f32; 3],
    /// Of all Gaussians.
    share: f32,
    colour: [f32; 3],
}

const SKIN: [f32; 3] = [0.85, 0.64, 0.52];
const HAIR: [f32; 3] = [0.28, 0.17, 0.1];
const JACKET: [f32; 3] = [0.2, 0.3, 0.5];
const TROUSERS: [f32; 3] = [0.3, 0.31, 0.34];
const SHOES: [f32; 3] = [0.35, 0.12, 0.1];

const fn part(centre: [f32; 3], axes: [f32; 3], share: f32, colour: [f32; 3]) -> Part {
    Part {
        centre,
        axes,
        share,
        colour,
    }
}

/// Shares fall short of 1: the rest is face.
const PARTS: [Part; 13] = [
    part([0.0, 1.62, 0.0], [0.085, 0.12, 0.1], 0.12, SKIN),
    part([0.0, 1.66, -0.02], [0.092, 0.11, 0.1], 0.08, HAIR),
    part([0.0, 1.48, 0.0], [0.05, 0.09, 0.05], 0.03, SKIN),
    part([0.0, 1.17, 0.0], [0.2, 0.29, 0.13], 0.25, JACKET),
    part([0.0, 0.9, 0.0], [0.165, 0.12, 0.115], 0.08, TROUSERS),
    part([-0.22, 1.13, 0.0], [0.058, 0.3, 0.062], 0.08, JACKET),
    part([0.22, 1.13, 0.0], [0.058, 0.3, 0.062], 0.08, JACKET),
    part([-0.235, 0.81, 0.02], [0.035, 0.09, 0.045], 0.02, SKIN),
    part([0.235, 0.81, 0.02], [0.035, 0.09, 0.045], 0.02, SKIN),
    part([-0.1, 0.47, 0.0], [0.085, 0.46, 0.095], 0.1, TROUSERS),
    part([0.1, 0.47, 0.0], [0.085, 0.46, 0.095], 0.1, TROUSERS),
    part([-0.1, 0.04, 0.05], [0.05, 0.045, 0.12], 0.02, SHOES),
    part([0.1, 0.04, 0.05], [0.05, 0.045, 0.12], 0.02, SHOES),
];

/// A person of `count` Gaussians, 1.77 m tall, feet at the origin, facing +z; the same for the same count.
pub fn standing_figure(count: u32) -> Vec<Gaussian> {
    let mut random = Random::new(0x5EED);
    (0..count).map(|_| skin_splat(count, &mut random)).collect()
}

fn skin_splat(count: u32, random: &mut Random) -> Gaussian {
    let mut pick = random.unit();
    let chosen = PARTS.iter().find(|part| {
        pick -= part.share;
        pick < 0.0
    });
    let part = chosen.unwrap_or(&PARTS[0]);
    let axes = Vec3::from_array(part.axes);
    let direction = direction_by_area(axes, random);
    let normal = (direction / axes).normalize();
    let place = Vec3::from_array(part.centre) + direction * axes;
    let area = axes.x * axes.y + axes.y * axes.z + axes.z * axes.x;
    #[expect(clippy::cast_precision_loss, reason = "a rough spacing")]
    let spacing = 2.2 * (area / (part.share * count as f32)).sqrt();
    let shade = 0.5 + 0.5 * normal.dot(Vec3::new(0.4, 0.55, 0.73)).max(0.0);
    // Stripes across the jacket, so that a shift of the picture shows.
    let stripe = part.colour == JACKET && (place.y * 25.0).sin() > 0.6;
    let pattern = if stripe { 1.7 } else { 1.0 };
    let grain = 0.95 + 0.1 * random.unit();
    Gaussian {
        position: place.to_array(),
        rotation: Quat::from_rotation_arc(Vec3::Z, normal).to_array(),
        scale: [
            spacing,
            spacing * (0.6 + 0.8 * random.unit()),
            0.1 * spacing,
        ],
        opacity: 0.6 + 0.4 * random.unit(),
        colour: part.colour.map(|channel| channel * shade * pattern * grain),
    }
}

/// A direction whose point on an ellipsoid is as likely to lie on one patch as on any of the same area.
fn direction_by_area(axes: Vec3, random: &mut Random) -> Vec3 {
    loop {
        let direction = random.vector();
        let length = direction.length();
        if !(0.1..=1.0).contains(&length) {
            continue;
        }
        let direction = direction / length;
        if random.unit() < (direction / axes).length() * axes.min_element() {
            return direction;
        }
    }
}
