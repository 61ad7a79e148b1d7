//! Pictures of the truth, of the avatar, and of where they differ.

use anyhow::Context;
use glam::Vec3;
use image::{RgbImage, imageops};
use scan_rig::pinhole::Pinhole;
use scan_rig::scan::Scan;
use scan_rig::surface::raster;

/// How many times the difference is shown.
const TIMES: f32 = 4.0;

/// Two scans from one place, before white, and the difference between them.
pub(super) fn beside(left: &Scan, right: &Scan, view: &Pinhole) -> anyhow::Result<RgbImage> {
    let [a, b] = [left, right].map(|scan| raster::draw(scan, view).over(Vec3::ONE));
    let difference = (a.iter().zip(&b))
        .map(|(a, b)| (*a - *b).abs() * TIMES)
        .collect();
    let mut all = RgbImage::new(3 * view.width, view.height);
    let columns = (0i64..).step_by(view.width as usize);
    for (pixels, x) in [a, b, difference].iter().zip(columns) {
        let rgb: Vec<u8> = pixels.iter().flat_map(to_bytes).collect();
        let picture = RgbImage::from_raw(view.width, view.height, rgb)
            .context("a picture of another size")?;
        imageops::replace(&mut all, &picture, x, 0);
    }
    Ok(all)
}

fn to_bytes(pixel: &Vec3) -> [u8; 3] {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates at the bounds of a byte"
    )]
    let byte = |value: f32| (value * 255.0).round() as u8;
    pixel.to_array().map(byte)
}
