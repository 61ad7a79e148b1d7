//! Scenes before the wearer of a headset: floor space, metres, y up, the viewer at the origin looking along -z.

use glam::{Quat, Vec3};
use renderer_splat::gaussian::Gaussian;

use super::standing_figure;

/// Where the figure's feet are.
const FEET: Vec3 = Vec3::new(0.1, 0.0, -1.6);

/// A person of 20,000 Gaussians, a step and a half ahead, facing the viewer.
pub fn figure_ahead() -> Vec<Gaussian> {
    let mut figure = standing_figure(20_000);
    for gaussian in &mut figure {
        gaussian.position = (Vec3::from_array(gaussian.position) + FEET).to_array();
    }
    figure
}

/// A red, a green and a blue ball, each farther away and larger than the one before, none before another: each colour channel shows
/// one of them alone.
pub fn markers() -> [Gaussian; 3] {
    let ball = |position, size, colour| Gaussian {
        position,
        rotation: Quat::IDENTITY.to_array(),
        scale: [size; 3],
        opacity: 0.99,
        colour,
    };
    [
        ball([-0.1, 1.45, -0.5], 0.0056, [1.0, 0.0, 0.0]),
        ball([0.15, 1.7, -1.2], 0.0136, [0.0, 1.0, 0.0]),
        ball([-0.4, 2.0, -3.0], 0.034, [0.0, 0.0, 1.0]),
    ]
}
