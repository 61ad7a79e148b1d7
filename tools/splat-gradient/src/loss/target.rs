//! What a picture should look like, and where that is known.

use crate::error::{GradientError, check_count};
use crate::picture::Picture;

/// A picture to be met, with a weight of every pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    picture: Picture,
    /// Row by row.
    weights: Vec<f32>,
    /// 1 / the sum of weights; 0 where that is 0.
    inverse_sum: f64,
}

impl Target {
    /// Every pixel counts the same. The colours are premultiplied by the mask, which is alpha.
    #[must_use]
    pub fn new(picture: Picture) -> Self {
        let weights = vec![1.0; picture.width() * picture.height()];
        Self::with(picture, weights)
    }

    /// Pixels count by their weights, row by row from the top: 0 where what should be seen is not known, such as at a mask's edge or
    /// where something stands before the person. A weight that is negative or not finite is one of 0.
    ///
    /// # Errors
    /// Another number of weights than of pixels.
    pub fn weighted(picture: Picture, weights: Vec<f32>) -> Result<Self, GradientError> {
        let pixels = picture.width() * picture.height();
        check_count("weights of a picture's pixels", weights.len(), pixels)?;
        Ok(Self::with(picture, weights))
    }

    fn with(picture: Picture, mut weights: Vec<f32>) -> Self {
        for weight in &mut weights {
            if !(weight.is_finite() && *weight > 0.0) {
                *weight = 0.0;
            }
        }
        let sum: f64 = weights.iter().map(|weight| f64::from(*weight)).sum();
        let inverse_sum = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        Self {
            picture,
            weights,
            inverse_sum,
        }
    }

    /// The picture to be met.
    #[must_use]
    pub fn picture(&self) -> &Picture {
        &self.picture
    }

    /// One weight a pixel, row by row.
    #[must_use]
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// What a pixel of weight 1 counts in the mean over all.
    pub(super) fn inverse_sum(&self) -> f64 {
        self.inverse_sum
    }

    /// Refuses a drawn picture, or derivatives by it, of another size.
    pub(super) fn check(&self, drawn: &Picture, by_pixel: &Picture) -> Result<(), GradientError> {
        let size = [self.picture.width(), self.picture.height()];
        drawn.check_size("the drawn picture", size)?;
        by_pixel.check_size("derivatives by pixels", size)
    }
}
