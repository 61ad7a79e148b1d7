//! The numbers of Gaussians, and in the same layout the derivatives of a loss by them.

use crate::error::{GradientError, check_count};

/// Numbers of one Gaussian.
pub const ATTRIBUTES: usize = 14;

/// Which planes hold what. The order is that of `spmm3::attribute`; the frame is the world.
pub mod plane {
    use std::ops::Range;
    /// Centre, metres.
    pub const POSITION: Range<usize> = 0..3;
    /// Quaternion x, y, z, w: world from the Gaussian's own axes. Of any length but 0: it is normalised where it is used.
    pub const ROTATION: Range<usize> = 3..7;
    /// Natural logarithm of the standard deviations along its own axes, in metres.
    pub const LOG_SCALE: Range<usize> = 7..10;
    /// Opacity before the sigmoid.
    pub const OPACITY: usize = 10;
    /// Display values of red, green and blue; below 0 is drawn as 0, and has no derivative.
    pub const COLOUR: Range<usize> = 11..14;
}

/// Fourteen planes of one number of each of N Gaussians: row-major [14, N]. [`plane`] says which is which.
///
/// A Gaussian with a number that is not finite, a rotation of length 0, a scale of 256 m or more, or one that lies behind the near
/// plane is not drawn, and its derivatives are 0. A logarithm or logit of minus infinity is a scale or opacity of 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Attributes {
    count: usize,
    numbers: Vec<f32>,
}

impl Attributes {
    /// `count` Gaussians whose numbers are all 0, as derivatives are before they are added up.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self {
            count,
            numbers: vec![0.0; ATTRIBUTES * count],
        }
    }

    /// From row-major [14, `count`].
    ///
    /// # Errors
    /// Another number of numbers.
    pub fn new(count: usize, numbers: Vec<f32>) -> Result<Self, GradientError> {
        check_count(
            "Gaussians' attributes",
            numbers.len(),
            count.saturating_mul(ATTRIBUTES),
        )?;
        Ok(Self { count, numbers })
    }

    /// How many Gaussians there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Row-major [14, N].
    #[must_use]
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// Row-major [14, N].
    pub fn numbers_mut(&mut self) -> &mut [f32] {
        &mut self.numbers
    }

    /// One number of every Gaussian; `index` is below 14.
    ///
    /// # Panics
    /// If it is not.
    #[must_use]
    pub fn plane(&self, index: usize) -> &[f32] {
        &self.numbers[index * self.count..(index + 1) * self.count]
    }

    /// One number of every Gaussian; `index` is below 14.
    ///
    /// # Panics
    /// If it is not.
    pub fn plane_mut(&mut self, index: usize) -> &mut [f32] {
        &mut self.numbers[index * self.count..(index + 1) * self.count]
    }

    /// All planes.
    pub(crate) fn planes(&self) -> [&[f32]; ATTRIBUTES] {
        std::array::from_fn(|index| self.plane(index))
    }

    /// All planes.
    pub(crate) fn planes_mut(&mut self) -> [&mut [f32]; ATTRIBUTES] {
        let mut rest = &mut self.numbers[..];
        std::array::from_fn(|_| {
            let (plane, others) = std::mem::take(&mut rest).split_at_mut(self.count);
            rest = others;
            plane
        })
    }
}
