//! The interface of losses that a network judges.

use crate::error::GradientError;
use std::fmt::Debug;

/// The distance of two pictures of a fixed size, as the paper's LPIPS term (section IV-C) takes it. One gives the same bytes of the same pictures.
pub trait PerceptualLoss: Debug + Send {
    /// Width and height of the pictures, pixels.
    fn size(&self) -> [usize; 2];

    /// What tells it from others: SHA-256 of its network's file, in hexadecimal digits.
    fn identity(&self) -> &str;

    /// The distance of two pictures, row-major [3, height, width] of red, green and blue as display values 0..=1. Writes its derivatives by what was
    /// drawn, in the same layout, to `by_drawn`.
    ///
    /// # Errors
    /// Pictures of another size, a network that fails or gives numbers that are not finite.
    fn compare(
        &mut self,
        drawn: &[f32],
        wanted: &[f32],
        by_drawn: &mut [f32],
    ) -> Result<f64, GradientError>;
}
