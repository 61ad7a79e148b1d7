//! A picture as the networks see it: borrowed pixels, of whatever source.

use crate::TrackerError;

/// The pixels of a picture: 8-bit RGB, row after row from the top, without gaps.
#[derive(Debug, Clone, Copy)]
pub struct PictureView<'a> {
    width: usize,
    height: usize,
    rgb: &'a [u8],
}

impl<'a> PictureView<'a> {
    /// A view of `rgb`, three bytes a pixel.
    ///
    /// # Errors
    /// [`TrackerError::Picture`] if there is no pixel, or `rgb` has another length than `width` x `height` pixels.
    pub fn new(width: usize, height: usize, rgb: &'a [u8]) -> Result<Self, TrackerError> {
        let bytes = width.checked_mul(height).and_then(|n| n.checked_mul(3));
        if width == 0 || height == 0 || bytes != Some(rgb.len()) {
            return Err(TrackerError::Picture {
                width,
                height,
                bytes: rgb.len(),
            });
        }
        Ok(Self { width, height, rgb })
    }

    /// Pixels in a row, at least 1.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows, at least 1.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The bytes: `3 * width * height`.
    #[must_use]
    pub fn rgb(&self) -> &'a [u8] {
        self.rgb
    }
}
