//! Gaussians and cameras for the picture tests: made up at random, and read from a capture.

use glam::{EulerRot, Quat, Vec3};
use xr_renderer::{Camera, Fov, Gaussian};

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
    let turn = Quat::from_rotation_y(0.15);
    let fov = |left, right| Fov {
        left,
        right,
        up: 0.4,
        down: -0.5,
    };
    let eye = |side: f32, fov| {
        let position = Vec3::new(0.4, 0.1, 2.6) + turn * Vec3::new(0.032 * side, 0.0, 0.0);
        Camera::from_fov(position, turn, fov, width, height)
    };
    [eye(-1.0, fov(-0.55, 0.42)), eye(1.0, fov(-0.42, 0.55))]
}

/// Reads a captured scene as 3DGS writes it: little-endian floats, named in a text header. Colours that
/// depend on the direction of view are left out.
pub fn captured_gaussians(bytes: &[u8]) -> Vec<Gaussian> {
    let end = b"end_header\n";
    let header_length = bytes
        .windows(end.len())
        .position(|window| window == end)
        .expect("a header");
    let header = String::from_utf8_lossy(&bytes[..header_length]).into_owned();
    let names: Vec<&str> = header
        .lines()
        .filter_map(|line| line.strip_prefix("property float "))
        .collect();
    let column = |name: &str| names.iter().position(|found| *found == name).expect(name);
    let columns = |names: [&str; 3]| names.map(column);
    let position = columns(["x", "y", "z"]);
    let scale = columns(["scale_0", "scale_1", "scale_2"]);
    let colour = columns(["f_dc_0", "f_dc_1", "f_dc_2"]);
    let rotation = ["rot_1", "rot_2", "rot_3", "rot_0"].map(column);
    let opacity = column("opacity");
    bytes[header_length + end.len()..]
        .chunks_exact(4 * names.len())
        .map(|record| {
            let value = |column: usize| {
                let bytes = record[4 * column..4 * column + 4]
                    .try_into()
                    .expect("4 bytes");
                f32::from_le_bytes(bytes)
            };
            Gaussian {
                position: position.map(value),
                rotation: Quat::from_array(rotation.map(value)).normalize().to_array(),
                scale: scale.map(|column| value(column).exp()),
                opacity: 1.0 / (1.0 + (-value(opacity)).exp()),
                colour: colour.map(|column| 0.5 + 0.282_094_79 * value(column)),
            }
        })
        .collect()
}
