//! F_attr that changes nothing, of the least size that a package may have.

use spmm3::networks::{AttributeNetwork, Dense, QuantisedBases};
use spmm3::{ATTRIBUTES, PARAMS, PersonError};

/// The network for `controllers` controllers and `gaussians` Gaussians.
///
/// # Errors
/// None that its arguments could cause.
pub(super) fn still(controllers: usize, gaussians: usize) -> Result<AttributeNetwork, PersonError> {
    Ok(AttributeNetwork {
        first: Dense::new(
            PARAMS,
            controllers,
            &vec![0.0; PARAMS * controllers],
            vec![0.0; controllers],
        )?,
        second: vec![half::f16::ZERO; controllers],
        second_bias: vec![0.0; controllers],
        bases: QuantisedBases::quantise(1, gaussians, &vec![0.0; ATTRIBUTES * gaussians])?,
    })
}
