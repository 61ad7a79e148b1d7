//! Gaussian splatting on the CPU in f64: slow, plain, and written apart from the renderer.
//!
//! No tiles, no early stop, no packing, no keys: every Gaussian is projected as the 3DGS paper and its
//! public code say, all are sorted by exact depth, and each pixel blends all of them front to back. Only
//! pixels where alpha cannot reach 1/255 are skipped. Nothing of `xr-renderer` is used but its inputs.

use std::cmp::Ordering;
use std::ops::RangeInclusive;

use rayon::prelude::*;
use xr_renderer::{Camera, Gaussian, Image};

const ALPHA_CUT: f64 = 1.0 / 255.0;
const ALPHA_MOST: f64 = 0.99;
const LOW_PASS: f64 = 0.3;

type Vec3 = [f64; 3];
type Mat3 = [Vec3; 3];

/// A picture in f64: premultiplied red, green, blue, alpha; row by row from the top.
#[derive(Debug, Clone)]
pub struct ReferencePicture {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` pixels.
    pub pixels: Vec<[f64; 4]>,
}

/// A rectangle of pixels, both ends belonging to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBox {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Last column.
    pub right: usize,
    /// Last row.
    pub bottom: usize,
}

struct Projected {
    depth: f64,
    mean: [f64; 2],
    /// a, b, c of q = a dx^2 + 2 b dx dy + c dy^2.
    inverse_covariance: [f64; 3],
    opacity: f64,
    colour: Vec3,
    columns: RangeInclusive<usize>,
    rows: RangeInclusive<usize>,
}

fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn rotation(quaternion: [f32; 4]) -> Mat3 {
    let [x, y, z, w] = quaternion.map(f64::from);
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - z * w),
            2.0 * (x * z + y * w),
        ],
        [
            2.0 * (x * y + z * w),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - x * w),
        ],
        [
            2.0 * (x * z - y * w),
            2.0 * (y * z + x * w),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// The pixels of one axis whose centres lie within `mean +- reach`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped first"
)]
#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn pixels_within(mean: f64, reach: f64, count: usize) -> Option<RangeInclusive<usize>> {
    let first = (mean - reach - 0.5).ceil().max(0.0);
    let last = (mean + reach - 0.5).floor().min(count as f64 - 1.0);
    (first <= last).then_some(first as usize..=last as usize)
}

fn project(gaussian: &Gaussian, camera: &Camera) -> Option<Projected> {
    // OpenXR's camera (y up, looking along -z) to the image's frame (y down, z forward).
    let flip = [1.0, -1.0, -1.0];
    let view: Mat3 = std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            flip[row] * f64::from(camera.camera_from_world.matrix3.col(column)[row])
        })
    });
    let t: Vec3 = std::array::from_fn(|row| {
        let turned: f64 = (0..3)
            .map(|column| view[row][column] * f64::from(gaussian.position[column]))
            .sum();
        turned + flip[row] * f64::from(camera.camera_from_world.translation[row])
    });
    if t[2] <= f64::from(camera.near) {
        return None;
    }
    let (fx, fy) = (f64::from(camera.fx), f64::from(camera.fy));
    let (cx, cy) = (f64::from(camera.cx), f64::from(camera.cy));
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));

    let half_tan = [0.5 * width / fx, 0.5 * height / fy];
    let x = (t[0] / t[2]).clamp(
        -cx / fx - 0.3 * half_tan[0],
        (width - cx) / fx + 0.3 * half_tan[0],
    ) * t[2];
    let y = (t[1] / t[2]).clamp(
        -cy / fy - 0.3 * half_tan[1],
        (height - cy) / fy + 0.3 * half_tan[1],
    ) * t[2];
    let jacobian: Mat3 = [
        [fx / t[2], 0.0, -fx * x / (t[2] * t[2])],
        [0.0, fy / t[2], -fy * y / (t[2] * t[2])],
        [0.0; 3],
    ];
    let turn = rotation(gaussian.rotation);
    let axes: Mat3 =
        std::array::from_fn(|i| std::array::from_fn(|j| turn[i][j] * f64::from(gaussian.scale[j])));
    let covariance_3d = product(&axes, &transposed(&axes));
    let image_from_world = product(&jacobian, &view);
    let covariance = product(
        &product(&image_from_world, &covariance_3d),
        &transposed(&image_from_world),
    );
    let a = covariance[0][0] + LOW_PASS;
    let b = covariance[0][1];
    let c = covariance[1][1] + LOW_PASS;
    let determinant = a * c - b * b;

    let opacity = f64::from(gaussian.opacity);
    if opacity <= ALPHA_CUT {
        return None;
    }
    let reach = 2.0 * (opacity / ALPHA_CUT).ln();
    let mean = [fx * t[0] / t[2] + cx, fy * t[1] / t[2] + cy];
    Some(Projected {
        depth: t[2],
        mean,
        inverse_covariance: [c / determinant, -b / determinant, a / determinant],
        opacity,
        colour: gaussian.colour.map(|channel| f64::from(channel).max(0.0)),
        columns: pixels_within(mean[0], (reach * a).sqrt(), camera.width as usize)?,
        rows: pixels_within(mean[1], (reach * c).sqrt(), camera.height as usize)?,
    })
}

/// Draws all Gaussians, which are finite, as one camera sees them.
pub fn render(gaussians: &[Gaussian], camera: &Camera) -> ReferencePicture {
    let mut splats: Vec<Projected> = gaussians
        .par_iter()
        .filter_map(|gaussian| project(gaussian, camera))
        .collect();
    // Stable: equal depths stay in the order of their index.
    splats.par_sort_by(|a, b| a.depth.partial_cmp(&b.depth).unwrap_or(Ordering::Equal));

    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut by_row: Vec<Vec<u32>> = vec![Vec::new(); height];
    for (index, splat) in (0..).zip(&splats) {
        for row in splat.rows.clone() {
            by_row[row].push(index);
        }
    }
    let mut pixels = vec![[0.0; 4]; width * height];
    pixels
        .par_chunks_exact_mut(width)
        .zip(&by_row)
        .enumerate()
        .for_each(|(y, (row, touching))| {
            blend_row(
                row,
                y,
                touching.iter().map(|index| &splats[*index as usize]),
            );
        });
    ReferencePicture {
        width,
        height,
        pixels,
    }
}

#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn blend_row<'a>(row: &mut [[f64; 4]], y: usize, splats: impl Iterator<Item = &'a Projected>) {
    let mut transmittance = vec![1.0f64; row.len()];
    for splat in splats {
        let dy = y as f64 + 0.5 - splat.mean[1];
        let [a, b, c] = splat.inverse_covariance;
        for x in splat.columns.clone() {
            let dx = x as f64 + 0.5 - splat.mean[0];
            let q = a * dx * dx + 2.0 * b * dx * dy + c * dy * dy;
            let alpha = (splat.opacity * (-0.5 * q).exp()).min(ALPHA_MOST);
            if alpha < ALPHA_CUT {
                continue;
            }
            let weight = alpha * transmittance[x];
            for (sum, channel) in row[x].iter_mut().zip(splat.colour) {
                *sum += weight * channel;
            }
            row[x][3] += weight;
            transmittance[x] *= 1.0 - alpha;
        }
    }
}

/// The smallest box around all pixels that are not wholly transparent; nothing if all are.
pub fn covered_box(picture: &ReferencePicture) -> Option<PixelBox> {
    let covered = || {
        (0..picture.pixels.len())
            .filter(|index| picture.pixels[*index][3] > 0.0)
            .map(|index| (index % picture.width, index / picture.width))
    };
    Some(PixelBox {
        left: covered().map(|(x, _)| x).min()?,
        right: covered().map(|(x, _)| x).max()?,
        top: covered().map(|(_, y)| y).min()?,
        bottom: covered().map(|(_, y)| y).max()?,
    })
}

/// Peak signal-to-noise ratio in dB over a box, on premultiplied RGBA clamped to 0..=1; infinite if equal.
pub fn psnr(got: &Image, expected: &ReferencePicture, within: PixelBox) -> f64 {
    let mut squares = 0.0;
    let mut count = 0.0;
    for y in within.top..=within.bottom {
        for x in within.left..=within.right {
            let index = y * expected.width + x;
            for (got, expected) in got.pixels()[index].iter().zip(expected.pixels[index]) {
                let difference = f64::from(*got).clamp(0.0, 1.0) - expected.clamp(0.0, 1.0);
                squares += difference * difference;
                count += 1.0;
            }
        }
    }
    -10.0 * (squares / count).log10()
}

/// The reference in the renderer's picture type, to be looked at.
#[expect(clippy::cast_possible_truncation, reason = "for the eye")]
pub fn to_image(picture: &ReferencePicture) -> Option<Image> {
    let pixels = picture
        .pixels
        .iter()
        .map(|pixel| pixel.map(|value| value as f32))
        .collect();
    Image::new(
        u32::try_from(picture.width).ok()?,
        u32::try_from(picture.height).ok()?,
        pixels,
    )
}
