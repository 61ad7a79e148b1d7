//! The difference of a picture from the reference.

use renderer_splat::picture::Image;

use super::ReferencePicture;

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

/// Mean and greatest distance in metres of the depths a renderer gives (times alpha), each divided by its alpha, over the
/// pixels where the reference's alpha is above 0.5; nothing where there are none.
pub fn depth_error(got: &Image, depths: &[f32], expected: &ReferencePicture) -> Option<(f64, f64)> {
    let (mut sum, mut most, mut count) = (0.0, 0.0f64, 0.0);
    let expected = expected.pixels.iter().zip(&expected.depths);
    for ((pixel, depth), (right_pixel, right_depth)) in
        got.pixels().iter().zip(depths).zip(expected)
    {
        if right_pixel[3] <= 0.5 {
            continue;
        }
        let error = f64::from(*depth) / f64::from(pixel[3]) - right_depth / right_pixel[3];
        sum += error.abs();
        most = most.max(error.abs());
        count += 1.0;
    }
    (count > 0.0).then(|| (sum / count, most))
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
