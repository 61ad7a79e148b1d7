//! What can be wrong with the inputs.

/// Why pictures or derivatives were not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GradientError {
    /// A camera by which nothing can be projected.
    #[error("the camera cannot be used: {0}")]
    View(&'static str),
    /// Numbers that are not as many as the shape says.
    #[error("{what}: {got} numbers, {expected} expected")]
    Count {
        /// What they are.
        what: &'static str,
        /// How many there are.
        got: usize,
        /// How many there should be.
        expected: usize,
    },
    /// Pictures that should have one size.
    #[error("{what}: {got:?} pixels, {expected:?} expected (width, height)")]
    Size {
        /// Which picture.
        what: &'static str,
        /// Its width and height.
        got: [usize; 2],
        /// Those it should have.
        expected: [usize; 2],
    },
    /// A device that draws has too little memory, or failed.
    #[error("drawing on the device")]
    Device(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// A network that judges pictures failed.
    #[error("the perceptual loss")]
    Perceptual(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// Refuses an array whose length is not `expected`.
///
/// # Errors
/// [`GradientError::Count`], of `what`.
pub fn check_count(what: &'static str, got: usize, expected: usize) -> Result<(), GradientError> {
    if got == expected {
        return Ok(());
    }
    Err(GradientError::Count {
        what,
        got,
        expected,
    })
}
