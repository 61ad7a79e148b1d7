//! Pictures on the host, planar, and in the same layout the derivatives of a loss by them.

use crate::error::{GradientError, check_count};

/// Planes of a picture: premultiplied red, green, blue as display values, then alpha.
pub const CHANNELS: usize = 4;

/// Row-major [4, height, width], rows from the top: premultiplied red, green, blue, and alpha.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Picture {
    width: usize,
    height: usize,
    numbers: Vec<f32>,
}

impl Picture {
    /// All transparent.
    #[must_use]
    pub fn transparent(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            numbers: vec![0.0; CHANNELS * width * height],
        }
    }

    /// From row-major [4, height, width].
    ///
    /// # Errors
    /// Another number of numbers.
    pub fn new(width: usize, height: usize, numbers: Vec<f32>) -> Result<Self, GradientError> {
        let expected = width.saturating_mul(height).saturating_mul(CHANNELS);
        check_count("a picture's pixels", numbers.len(), expected)?;
        Ok(Self {
            width,
            height,
            numbers,
        })
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Row-major [4, height, width].
    #[must_use]
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// Row-major [4, height, width].
    pub fn numbers_mut(&mut self) -> &mut [f32] {
        &mut self.numbers
    }

    /// One channel of every pixel; `channel` is below 4.
    ///
    /// # Panics
    /// If it is not.
    #[must_use]
    pub fn plane(&self, channel: usize) -> &[f32] {
        let pixels = self.width * self.height;
        &self.numbers[channel * pixels..(channel + 1) * pixels]
    }

    /// Makes it all transparent; of derivatives, all 0.
    pub fn clear(&mut self) {
        self.numbers.fill(0.0);
    }

    /// One channel of every pixel; `channel` is below 4.
    ///
    /// # Panics
    /// If it is not.
    pub fn plane_mut(&mut self, channel: usize) -> &mut [f32] {
        let pixels = self.width * self.height;
        &mut self.numbers[channel * pixels..(channel + 1) * pixels]
    }

    /// All channels.
    pub(crate) fn planes_mut(&mut self) -> [&mut [f32]; CHANNELS] {
        let pixels = self.width * self.height;
        let mut rest = &mut self.numbers[..];
        std::array::from_fn(|_| {
            let (plane, others) = std::mem::take(&mut rest).split_at_mut(pixels);
            rest = others;
            plane
        })
    }

    /// Makes it all transparent, of this size.
    pub(crate) fn reset(&mut self, width: usize, height: usize) {
        self.width = width;
        self.height = height;
        self.numbers.clear();
        self.numbers.resize(CHANNELS * width * height, 0.0);
    }

    /// Refuses a picture of another size.
    ///
    /// # Errors
    /// [`GradientError::Size`], of `what`.
    pub fn check_size(
        &self,
        what: &'static str,
        expected: [usize; 2],
    ) -> Result<(), GradientError> {
        let got = [self.width, self.height];
        if got == expected {
            return Ok(());
        }
        Err(GradientError::Size {
            what,
            got,
            expected,
        })
    }
}
