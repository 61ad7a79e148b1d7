//! A made-up standing person of any number of Gaussians: flat splats on the skin of a body made of ellipsoids, opaque and
//! overlapping as a scan's are. Needs no file, so that anyone can repeat a measurement.

use glam::{Quat, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::{Gaussian, PackedGaussian};

/// An ellipsoid of the body.
struct Part {
    centre: Vec3,
    /// Half axes, metres.
    axes: Vec3,
    /// Of all Gaussians.
    share: f32,
    colour: [f32; 3],
}

/// `count` Gaussians of a person who stands at the origin, 1.75 m high.
pub(crate) fn standing_figure(count: usize) -> Vec<PackedGaussian> {
    let parts = parts();
    let mut random = fastrand::Rng::with_seed(0x3D65);
    (0..count)
        .map(|_| PackedGaussian::from(&gaussian(&parts, count, &mut random)))
        .collect()
}

/// The camera that the whole figure fits, moved by `x` metres to the right.
pub(crate) fn camera(x: f32, width: u32, height: u32) -> Camera {
    let (eye, target) = (Vec3::new(x, 1.0, 2.6), Vec3::new(x, 0.9, 0.0));
    Camera::look_at(eye, target, Vec3::Y, 0.8, width, height)
}

fn parts() -> [Part; 6] {
    let part = |centre, axes, share, colour| Part {
        centre: Vec3::from_array(centre),
        axes: Vec3::from_array(axes),
        share,
        colour,
    };
    let (skin, jacket, trousers) = ([0.85, 0.64, 0.52], [0.2, 0.3, 0.5], [0.18, 0.18, 0.2]);
    [
        part([0.0, 1.62, 0.0], [0.09, 0.13, 0.11], 0.2, skin),
        part([0.0, 1.15, 0.0], [0.2, 0.34, 0.13], 0.35, jacket),
        part([-0.28, 1.1, 0.0], [0.06, 0.34, 0.06], 0.1, jacket),
        part([0.28, 1.1, 0.0], [0.06, 0.34, 0.06], 0.1, jacket),
        part([-0.1, 0.42, 0.0], [0.09, 0.44, 0.1], 0.125, trousers),
        part([0.1, 0.42, 0.0], [0.09, 0.44, 0.1], 0.125, trousers),
    ]
}

fn gaussian(parts: &[Part; 6], count: usize, random: &mut fastrand::Rng) -> Gaussian {
    let mut pick = random.f32();
    let chosen = parts.iter().find(|part| {
        pick -= part.share;
        pick < 0.0
    });
    let [head, ..] = parts;
    let &Part {
        centre,
        axes,
        share,
        colour,
    } = chosen.unwrap_or(head);
    let direction = direction_by_area(axes, random);
    let normal = (direction / axes).normalize();
    let area = axes.x * axes.y + axes.y * axes.z + axes.z * axes.x;
    let spacing = 2.2 * (area / (share * count as f32)).sqrt();
    let shade = 0.55 + 0.45 * normal.dot(Vec3::new(0.3, 0.6, 0.74)).max(0.0);
    Gaussian {
        position: (centre + direction * axes).to_array(),
        rotation: Quat::from_rotation_arc(Vec3::Z, normal).to_array(),
        scale: [spacing, spacing * (0.6 + 0.8 * random.f32()), 0.1 * spacing],
        opacity: 0.6 + 0.4 * random.f32(),
        colour: colour.map(|channel: f32| channel * shade * (0.9 + 0.2 * random.f32())),
    }
}

/// A direction whose point on an ellipsoid is as likely to lie on one patch as on any of the same area.
fn direction_by_area(axes: Vec3, random: &mut fastrand::Rng) -> Vec3 {
    loop {
        let point = Vec3::from_array(std::array::from_fn(|_| 2.0 * random.f32() - 1.0));
        let length = point.length();
        if !(0.1..=1.0).contains(&length) {
            continue;
        }
        let direction = point / length;
        if random.f32() < (direction / axes).length() * axes.min_element() {
            return direction;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figure_has_the_count_asked_for_and_a_persons_size() {
        let figure = standing_figure(5000);
        assert_eq!(figure.len(), 5000, "count");
        let heights = figure.iter().map(|gaussian| gaussian.position()[1]);
        let (low, high) = heights.fold((f32::MAX, f32::MIN), |(low, high), y| {
            (low.min(y), high.max(y))
        });
        assert!(
            (-0.05..0.1).contains(&low) && (1.7..1.8).contains(&high),
            "from {low} to {high} m"
        );
        assert_eq!(
            standing_figure(100),
            standing_figure(100),
            "the same each time"
        );
    }
}
