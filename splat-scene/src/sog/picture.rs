//! The images of a SOG scene: lossless WebP, four bytes in each pixel.

use std::io::Cursor;

use image_webp::WebPDecoder;

use crate::source::Source;
use crate::{Format, SceneError};

/// What a picture may have beyond four pixels for each Gaussian.
const SPARE_PIXELS: usize = 1 << 16;
/// What a file may have beyond its pixels' plain bytes.
const SPARE_BYTES: u64 = 1 << 16;

/// The most pixels that the image of an attribute may have: writers round its sides up.
pub(super) fn most_pixels(count: usize) -> usize {
    4 * count + SPARE_PIXELS
}

/// The most bytes that a file of so many pixels may have.
pub(super) fn most_bytes(pixels: usize) -> u64 {
    4 * pixels as u64 + SPARE_BYTES
}

/// A decoded image.
pub(super) struct Picture {
    pub(super) width: usize,
    bytes: Vec<u8>,
    channels: usize,
}

impl Picture {
    /// Decodes a file that has at most `most_pixels`.
    pub(super) fn decode(
        source: &Source<'_>,
        format: Format,
        name: &str,
        file: &[u8],
        most_pixels: usize,
    ) -> Result<Self, SceneError> {
        let broken = |why: String| source.damaged(format, format!("{name} {why}"));
        let undecodable = |error| broken(format!("cannot be decoded ({error})"));
        let mut decoder = WebPDecoder::new(Cursor::new(file)).map_err(undecodable)?;
        if decoder.is_animated() || decoder.is_lossy() {
            return Err(broken(
                "is no lossless WebP image, so its bytes are not those that were written"
                    .to_owned(),
            ));
        }
        let (width, height) = decoder.dimensions();
        let pixels = u64::from(width) * u64::from(height);
        if pixels > most_pixels as u64 {
            return Err(broken(format!(
                "has {width} x {height} pixels, more than the {most_pixels} that can be meant"
            )));
        }
        let size = decoder.output_buffer_size().unwrap_or(0);
        let mut bytes = Vec::new();
        bytes
            .try_reserve_exact(size)
            .map_err(|error| broken(format!("does not fit in memory ({error})")))?;
        bytes.resize(size, 0);
        decoder.read_image(&mut bytes).map_err(undecodable)?;
        Ok(Self {
            width: width as usize,
            bytes,
            channels: if decoder.has_alpha() { 4 } else { 3 },
        })
    }

    pub(super) fn pixels(&self) -> usize {
        self.bytes.len() / self.channels
    }

    /// Refuses a picture that has too few pixels for `count` Gaussians.
    pub(super) fn holds(
        &self,
        source: &Source<'_>,
        format: Format,
        name: &str,
        count: usize,
    ) -> Result<(), SceneError> {
        if self.pixels() >= count {
            return Ok(());
        }
        Err(source.damaged(
            format,
            format!("{name} has {} pixels for {count} Gaussians", self.pixels()),
        ))
    }

    /// Red, green, blue and alpha of a pixel, counted row by row; opaque where the image has no alpha.
    pub(super) fn pixel(&self, index: usize) -> [u8; 4] {
        let mut pixel = [0, 0, 0, 255];
        let start = index * self.channels;
        let bytes = self.bytes.get(start..start + self.channels);
        for (to, from) in pixel.iter_mut().zip(bytes.unwrap_or_default()) {
            *to = *from;
        }
        pixel
    }
}
