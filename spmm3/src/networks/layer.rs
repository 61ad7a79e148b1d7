//! A fully connected layer with half-precision weights.

use crate::PersonError;
use half::f16;

/// y = x W + b with W row-major [inputs, outputs].
///
/// Weights are stored as FP16: the NPU computes in it, and it halves the package. The CPU provider widens them at load.
#[derive(Debug, Clone, PartialEq)]
pub struct Dense {
    inputs: usize,
    outputs: usize,
    weights: Vec<f16>,
    bias: Vec<f32>,
}

impl Dense {
    /// Rounds `weights` (row-major [inputs, outputs]) to FP16.
    ///
    /// # Errors
    /// If the counts do not fit each other or a number does not fit FP16.
    pub fn new(
        inputs: usize,
        outputs: usize,
        weights: &[f32],
        bias: Vec<f32>,
    ) -> Result<Self, PersonError> {
        PersonError::check_count("layer weights", weights.len(), inputs * outputs)?;
        PersonError::check_count("layer bias", bias.len(), outputs)?;
        PersonError::check_range("layer weight", weights, -65504.0, 65504.0, "FP16's range")?;
        PersonError::check_range("layer bias", &bias, -65504.0, 65504.0, "FP16's range")?;
        Ok(Self {
            inputs,
            outputs,
            weights: weights.iter().map(|w| f16::from_f32(*w)).collect(),
            bias,
        })
    }

    /// Takes numbers that a graph stored, all finite.
    pub(super) fn from_stored(
        inputs: usize,
        outputs: usize,
        weights: Vec<f16>,
        bias: Vec<f32>,
    ) -> Result<Self, PersonError> {
        PersonError::check_count("layer weights", weights.len(), inputs * outputs)?;
        PersonError::check_count("layer bias", bias.len(), outputs)?;
        Ok(Self {
            inputs,
            outputs,
            weights,
            bias,
        })
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Weights, row-major [inputs, outputs].
    #[must_use]
    pub fn weights(&self) -> &[f16] {
        &self.weights
    }

    /// Bias, `[outputs]`.
    #[must_use]
    pub fn bias(&self) -> &[f32] {
        &self.bias
    }
}
