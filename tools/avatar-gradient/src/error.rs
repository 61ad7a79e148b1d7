//! What can be wrong with the inputs.

use spmm3::PersonError;

/// Why Gaussians or derivatives were not computed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Numbers that are not as many as the avatar's shape says.
    #[error("{what}: {got} numbers, {expected} expected")]
    Count {
        /// What they are.
        what: &'static str,
        /// How many there are.
        got: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The pose that derivatives are asked for was not computed by this model, or with other parts of it switched on.
    #[error(
        "{0} were not computed for this pose: call `Model::pose` first, with the same parts of the model"
    )]
    NotPosed(&'static str),
    /// Numbers that do not make networks or Gaussians.
    #[error(transparent)]
    Person(#[from] PersonError),
}

/// Refuses an array whose length is not `expected`.
pub(crate) fn check_count(
    what: &'static str,
    got: usize,
    expected: usize,
) -> Result<(), ModelError> {
    if got == expected {
        return Ok(());
    }
    Err(ModelError::Count {
        what,
        got,
        expected,
    })
}
