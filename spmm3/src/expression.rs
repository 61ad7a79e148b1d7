//! Named facial expressions of one avatar.
//!
//! Expression coefficients are of the avatar's own basis ([`crate::ExpressionBasis`]); a name such as `smile` says what to
//! set them to, so that a built-in motion can talk with any face, and a camera can move it.

use crate::EXPRESSION;
use std::collections::BTreeMap;

/// What one named expression sets.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpressionPreset {
    /// Expression coefficients at full strength.
    pub coefficients: [f32; EXPRESSION],
    /// Opening of the jaw joint at full strength, radians about its x axis.
    pub jaw: f32,
}

/// Presets by name. Names in use: `blink`, `smile`, `brows_up`, `brows_down`, and the visemes `a`, `e`, `i`, `o`, `u`,
/// `mbp`, `fv`.
pub type Expressions = BTreeMap<String, ExpressionPreset>;
