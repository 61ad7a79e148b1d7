//! Draws a scene in f64 and scores other renderers' pictures of it:
//! `cargo run --release -p mon3tr-tests --example reference_picture -- SCENE.ply CAMERAS.json ID OUT.png [PICTURE.png...]`.
//!
//! SCENE is a standard 3DGS PLY, CAMERAS follows 3DGS's cameras.json, and the picture has the size that the camera there has.
//! The file is read and its spherical harmonics are evaluated here, by none of the code that our renderer's pictures come
//! from. All pictures are over black. The scores, printed as JSON, are against the reference before it is rounded to 8 bits; what
//! that rounding alone costs is given with them.

use glam::{Affine3A, Mat3A, Quat, Vec3A};
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use serde_json::{Value, json};
use std::error::Error;
use test_support::splat_reference::{PixelBox, ReferencePicture, covered_box, render};

type Failure = Box<dyn Error>;

/// Coefficients of one channel after the first, by degree.
const REST: [usize; 4] = [0, 3, 8, 15];

/// Real spherical harmonics of the degrees 1 to 3 as 3DGS orders and signs them, for a unit direction.
fn harmonics([x, y, z]: [f64; 3]) -> [f64; 15] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -0.488_602_511_902_919_9 * y,
        0.488_602_511_902_919_9 * z,
        -0.488_602_511_902_919_9 * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.315_391_565_252_520_05 * (2.0 * zz - xx - yy),
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (xx - yy),
        -0.590_043_589_926_643_5 * y * (3.0 * xx - yy),
        2.890_611_442_640_554 * x * y * z,
        -0.457_045_799_464_465_8 * y * (4.0 * zz - xx - yy),
        0.373_176_332_590_115_4 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_799_464_465_8 * x * (4.0 * zz - xx - yy),
        1.445_305_721_320_277 * z * (xx - yy),
        -0.590_043_589_926_643_5 * x * (xx - 3.0 * yy),
    ]
}

/// The scene's Gaussians, coloured as they look from `eye`.
#[expect(
    clippy::cast_possible_truncation,
    reason = "to the renderer's precision"
)]
fn read_scene(bytes: &[u8], eye: [f64; 3]) -> Result<Vec<Gaussian>, Failure> {
    const END: &[u8] = b"end_header\n";
    let end = bytes
        .windows(END.len())
        .position(|window| window == END)
        .ok_or("no PLY: no end_header")?
        + END.len();
    let header = String::from_utf8_lossy(&bytes[..end]);
    if !header.contains("binary_little_endian") {
        return Err("the PLY is not binary_little_endian".into());
    }
    let names: Vec<&str> = header
        .lines()
        .filter_map(|line| line.strip_prefix("property float "))
        .map(str::trim)
        .collect();
    let column = |name: &str| {
        let found = names.iter().position(|found| *found == name);
        found.ok_or_else(|| format!("the PLY has no property {name}"))
    };
    let columns = |names: [&str; 3]| -> Result<[usize; 3], Failure> {
        Ok([column(names[0])?, column(names[1])?, column(names[2])?])
    };
    let position = columns(["x", "y", "z"])?;
    let scale = columns(["scale_0", "scale_1", "scale_2"])?;
    let base = columns(["f_dc_0", "f_dc_1", "f_dc_2"])?;
    let turn = columns(["rot_1", "rot_2", "rot_3"])?;
    let (turn_w, opacity) = (column("rot_0")?, column("opacity")?);
    let rest = names.iter().filter(|n| n.starts_with("f_rest_")).count() / 3;
    if !REST.contains(&rest) {
        return Err(format!("{rest} coefficients a channel after the first: no degree").into());
    }
    let first_rest = if rest == 0 { 0 } else { column("f_rest_0")? };
    let gaussian = |record: &[u8]| {
        let value = |column: usize| {
            let bytes: [u8; 4] = std::array::from_fn(|k| record[4 * column + k]);
            f32::from_le_bytes(bytes)
        };
        let centre = position.map(value);
        let toward: [f64; 3] = std::array::from_fn(|k| f64::from(centre[k]) - eye[k]);
        let length = toward.iter().map(|v| v * v).sum::<f64>().sqrt();
        let basis = harmonics(toward.map(|v| v / length));
        let colour = std::array::from_fn(|channel| {
            let coefficients = first_rest + channel * rest..first_rest + (channel + 1) * rest;
            let rest: f64 = coefficients
                .zip(basis)
                .map(|(column, b)| b * f64::from(value(column)))
                .sum();
            let base = 0.282_094_791_773_878_14 * f64::from(value(base[channel]));
            (0.5 + base + rest).max(0.0) as f32
        });
        let [x, y, z] = turn.map(value);
        Gaussian {
            position: centre,
            rotation: Quat::from_xyzw(x, y, z, value(turn_w))
                .normalize()
                .to_array(),
            scale: scale.map(|column| value(column).exp()),
            opacity: (1.0 / (1.0 + (-f64::from(value(opacity))).exp())) as f32,
            colour,
        }
    };
    Ok(bytes[end..]
        .chunks_exact(4 * names.len())
        .map(gaussian)
        .collect())
}

/// The camera `id` of a cameras.json: centre in the world, world from camera, camera x right, y down, z forward.
#[expect(
    clippy::cast_possible_truncation,
    reason = "to the renderer's precision"
)]
fn read_camera(text: &str, id: u64) -> Result<(Camera, [f64; 3]), Failure> {
    let all: Vec<Value> = serde_json::from_str(text)?;
    let found = all.iter().find(|camera| camera["id"] == id);
    let camera = found.ok_or_else(|| format!("no camera has the id {id}"))?;
    let number = |value: &Value, what: &str| {
        let found = value.as_f64();
        found.ok_or_else(|| format!("the camera's {what} is no number"))
    };
    let mut rotation = [[0.0; 3]; 3];
    let mut position = [0.0; 3];
    for row in 0..3 {
        position[row] = number(&camera["position"][row], "position")?;
        for column in 0..3 {
            rotation[row][column] = number(&camera["rotation"][row][column], "rotation")?;
        }
    }
    let pixels = |what: &str| -> Result<u32, Failure> {
        let found = camera[what].as_u64().and_then(|n| u32::try_from(n).ok());
        Ok(found.ok_or_else(|| format!("the camera's {what} is no number of pixels"))?)
    };
    let (width, height) = (pixels("width")?, pixels("height")?);
    // The camera's y and z turn round. Rows of world-from-camera are columns of camera-from-world.
    let flip = [1.0, -1.0, -1.0];
    let column = |row: usize| {
        Vec3A::from_array(std::array::from_fn(|k| (flip[k] * rotation[row][k]) as f32))
    };
    let translation: [f32; 3] = std::array::from_fn(|k| {
        let along: f64 = (0..3).map(|row| rotation[row][k] * position[row]).sum();
        (-flip[k] * along) as f32
    });
    let camera = Camera {
        camera_from_world: Affine3A {
            matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
            translation: Vec3A::from_array(translation),
        },
        fx: number(&camera["fx"], "fx")? as f32,
        fy: number(&camera["fy"], "fy")? as f32,
        cx: width as f32 / 2.0,
        cy: height as f32 / 2.0,
        width,
        height,
        near: 0.05,
    };
    Ok((camera, position))
}

/// The reference over black, in steps of an 8-bit channel.
fn over_black(pixel: [f64; 4]) -> [f64; 3] {
    std::array::from_fn(|k| 255.0 * pixel[k].clamp(0.0, 1.0))
}

/// dB over a box.
fn psnr(got: &[u8], expected: &ReferencePicture, within: PixelBox) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for y in within.top..=within.bottom {
        for x in within.left..=within.right {
            let index = y * expected.width + x;
            let wanted = over_black(expected.pixels[index]);
            for (got, wanted) in got[3 * index..3 * index + 3].iter().zip(wanted) {
                squares += (f64::from(*got) - wanted).powi(2);
                count += 1.0;
            }
        }
    }
    10.0 * (255.0 * 255.0 * count / squares).log10()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to 0..=255"
)]
fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, cameras, id, out, pictures @ ..] = arguments.as_slice() else {
        return Err(
            "usage: reference_picture SCENE.ply CAMERAS.json ID OUT.png [PICTURE.png...]".into(),
        );
    };
    let (camera, eye) = read_camera(&std::fs::read_to_string(cameras)?, id.parse()?)?;
    let gaussians = read_scene(&std::fs::read(scene)?, eye)?;
    let expected = render(&gaussians, &camera);
    let rounded: Vec<u8> = expected
        .pixels
        .iter()
        .flat_map(|pixel| over_black(*pixel).map(|v| v.round() as u8))
        .collect();
    let (width, height) = (camera.width, camera.height);
    image::save_buffer(out, &rounded, width, height, image::ColorType::Rgb8)?;

    let covered = covered_box(&expected).ok_or("the camera sees nothing of the scene")?;
    let whole = PixelBox {
        left: 0,
        top: 0,
        right: expected.width - 1,
        bottom: expected.height - 1,
    };
    let score = |bytes: &[u8]| {
        json!({
            "covered_db": psnr(bytes, &expected, covered),
            "whole_db": psnr(bytes, &expected, whole),
        })
    };
    let mut scores = Vec::new();
    for file in pictures {
        let picture = image::open(file)?.to_rgb8();
        if picture.dimensions() != (width, height) {
            return Err(format!("{file} is not {width}x{height}").into());
        }
        scores.push(score(&picture));
    }
    let report = json!({
        "gaussians": gaussians.len(),
        "covered": [covered.left, covered.top, covered.right, covered.bottom],
        "rounded": score(&rounded),
        "pictures": scores,
    });
    println!("{report}");
    Ok(())
}
