//! A made-up scene: a green floor, and cameras that look at it.

use std::path::{Path, PathBuf};

/// Gaussians of the floor.
pub(crate) const FLOOR: usize = 900;

/// A standard PLY in COLMAP's axes (y down): a green floor of 3 x 3 units at y = 0 and one Gaussian without a position.
pub(crate) fn scene(folder: &Path) -> PathBuf {
    let count = FLOOR + 1;
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
        "rot_0", "rot_1", "rot_2", "rot_3",
    ];
    let properties: String = names
        .map(|name| format!("property float {name}\n"))
        .concat();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    )
    .into_bytes();
    for k in 0..count {
        let at = |cell: usize| 0.1 * f32::from(u16::try_from(cell).expect("few")) - 1.45;
        let x = if k < FLOOR { at(k % 30) } else { f32::NAN };
        let (rotation, scale) = ([1.0, 0.0, 0.0, 0.0], [-2.8, -4.5, -2.8]);
        let head = [x, 0.0, at(k / 30), -1.5, 1.5, -1.5, 4.0];
        for value in head.into_iter().chain(scale).chain(rotation) {
            bytes.extend(f32::to_le_bytes(value));
        }
    }
    let file = folder.join("floor.ply");
    std::fs::write(&file, bytes).expect("a file can be written");
    file
}

/// Cameras 3 and 7, which look down at the floor from before and from the left of it.
pub(crate) fn cameras(folder: &Path) -> PathBuf {
    let file = folder.join("cameras.json");
    let half = 0.5f32.sqrt();
    let camera = |id: i32, position: [f32; 3], rotation: [[f32; 3]; 3]| {
        format!(
            r#"{{"id":{id},"img_name":"a","width":200,"height":100,"position":{position:?},"rotation":{rotation:?},"fx":150,"fy":150}}"#
        )
    };
    // The columns are the camera's right, down and forward.
    let front = [[1.0, 0.0, 0.0], [0.0, half, half], [0.0, -half, half]];
    let left = [[0.0, -half, half], [0.0, half, half], [-1.0, 0.0, 0.0]];
    let list = [
        camera(3, [0.0, -2.0, -2.0], front),
        camera(7, [-2.0, -2.0, 0.5], left),
    ];
    std::fs::write(&file, format!("[{}]", list.join(","))).expect("a file can be written");
    file
}

/// Pixels of the floor in a picture.
pub(crate) fn green(picture: &Path) -> usize {
    let picture = image::open(picture).expect("a PNG").to_rgb8();
    let is_green = |pixel: &image::Rgb<u8>| {
        let [red, green, blue] = pixel.0;
        green > 150 && red < 100 && blue < 100
    };
    picture.pixels().filter(|pixel| is_green(pixel)).count()
}
