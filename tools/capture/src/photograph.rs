//! A picture as the trainer compares it.

use crate::camera::LARGEST_SIDE;
use crate::error::CaptureError;

/// An undistorted picture in 8-bit display values; the centre of pixel (0, 0) is at (0.5, 0.5).
#[derive(Clone, PartialEq, Eq)]
pub struct Photograph {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// [height, width, 3].
    pub rgb: Vec<u8>,
    /// [height, width]: how much of the pixel is the person, 255 = all. `None` where nobody made a mask yet.
    pub mask: Option<Vec<u8>>,
}

/// Without the pixels.
impl std::fmt::Debug for Photograph {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Photograph")
            .field("size", &self.size)
            .field("mask", &self.mask.is_some())
            .finish_non_exhaustive()
    }
}

impl Photograph {
    /// Checks that the arrays have the size's length.
    ///
    /// # Errors
    /// [`CaptureError::Request`] if not, or for a size out of 1..=[`LARGEST_SIDE`].
    pub fn check(&self) -> Result<(), CaptureError> {
        let [width, height] = self.size.map(|side| side as usize);
        let sides = self.size.iter().all(|s| (1..=LARGEST_SIDE).contains(s));
        let pixels = width.saturating_mul(height);
        let mask = self.mask.as_ref().is_none_or(|mask| mask.len() == pixels);
        if sides && mask && self.rgb.len() == pixels.saturating_mul(3) {
            Ok(())
        } else {
            Err(CaptureError::Request(format!(
                "a photograph of {width} x {height} pixels has {} colour values and {:?} mask values: 3 and 1 for each pixel are needed",
                self.rgb.len(),
                self.mask.as_ref().map(Vec::len)
            )))
        }
    }

    /// The part of `size` pixels from the pixel `corner` (left, top) on, as [`crate::Camera::cropped`]; what reaches beyond the picture is left
    /// out, so the result may be smaller.
    #[must_use]
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        let [left, top] = [0, 1].map(|axis| corner[axis].min(self.size[axis]));
        let size = [
            size[0].min(self.size[0] - left),
            size[1].min(self.size[1] - top),
        ];
        let cut = |values: &[u8], channels: usize| {
            let row = self.size[0] as usize * channels;
            let from = left as usize * channels;
            let length = size[0] as usize * channels;
            (values.chunks_exact(row.max(1)))
                .skip(top as usize)
                .take(size[1] as usize)
                .flat_map(|row| &row[from..from + length])
                .copied()
                .collect()
        };
        Self {
            size,
            rgb: cut(&self.rgb, 3),
            mask: self.mask.as_ref().map(|mask| cut(mask, 1)),
        }
    }
}
