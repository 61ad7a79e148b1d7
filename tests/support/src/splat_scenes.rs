//! Gaussians and cameras for the picture tests, made up.

mod before_viewer;
mod figure;
mod place;

pub use before_viewer::{figure_ahead, markers};
pub use figure::standing_figure;
pub use place::{
    BAR_COLOUR, between_bars, in_front_of_figure, on_a_bar, railing_and_wall, random_scene,
};

use glam::{EulerRot, Quat, Vec3};
use renderer_splat::camera::{Camera, Fov};
use renderer_splat::gaussian::Gaussian;

/// Random Gaussians in a ball of 1 m: sizes over a factor of 40, needles and discs among them, colours
/// that leave 0..=1 on both sides.
pub fn random_gaussians(count: usize, seed: u64) -> Vec<Gaussian> {
    let mut state = seed | 1;
    let mut unit = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        f32::from(u16::try_from(state >> 48).expect("16 bits")) / 65_536.0
    };
    (0..count)
        .map(|_| {
            let position = loop {
                let position = Vec3::from_array(std::array::from_fn(|_| 2.0 * unit() - 1.0));
                if position.length() < 1.0 {
                    break position;
                }
            };
            let rotation = Quat::from_euler(
                EulerRot::XYZ,
                std::f32::consts::TAU * unit(),
                std::f32::consts::PI * unit(),
                std::f32::consts::TAU * unit(),
            );
            Gaussian {
                position: position.to_array(),
                rotation: rotation.to_array(),
                scale: std::array::from_fn(|_| 0.002 * 40f32.powf(unit())),
                opacity: unit(),
                colour: std::array::from_fn(|_| 1.4 * unit() - 0.2),
            }
        })
        .collect()
}

/// A camera before the ball of random Gaussians, which fills the picture.
pub fn front_camera(width: u32, height: u32) -> Camera {
    Camera::look_at(
        Vec3::new(0.4, 0.5, 3.0),
        Vec3::ZERO,
        Vec3::Y,
        0.75,
        width,
        height,
    )
}

/// Two eyes 64 mm apart that look the same way, with the lopsided fields of view of a headset's.
pub fn eyes(width: u32, height: u32) -> [Camera; 2] {
    eyes_at(Vec3::new(0.4, 0.1, 2.6), width, height)
}

/// [`eyes`] whose middle is at a place: they look along -z, a little to the left.
pub fn eyes_at(head: Vec3, width: u32, height: u32) -> [Camera; 2] {
    let turn = Quat::from_rotation_y(0.15);
    let fov = |left, right| Fov {
        left,
        right,
        up: 0.4,
        down: -0.5,
    };
    let eye = |side: f32, fov| {
        let position = head + turn * Vec3::new(0.032 * side, 0.0, 0.0);
        Camera::from_fov(position, turn, fov, width, height)
    };
    [eye(-1.0, fov(-0.55, 0.42)), eye(1.0, fov(-0.42, 0.55))]
}

/// Where a point lies in a camera's picture: column and row.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "points in the picture"
)]
pub fn pixel_of(camera: &Camera, point: Vec3) -> (usize, usize) {
    let seen = camera.camera_from_world.transform_point3(point);
    let (x, y) = (-seen.x / seen.z, seen.y / seen.z);
    (
        (camera.fx * x + camera.cx) as usize,
        (camera.fy * y + camera.cy) as usize,
    )
}
