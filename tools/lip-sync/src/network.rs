//! The network: one hidden layer, its weights as bytes.

use crate::CLASSES;
use crate::front_end::INPUTS;

/// Neurons of the hidden layer.
pub const HIDDEN: usize = 160;
/// Its outputs.
pub const OUTPUTS: usize = CLASSES.len();

/// What a file of weights begins with: its kind and version.
const MAGIC: &[u8; 8] = b"M3LIPS\x00\x01";
/// Bytes before the weights: kind, inputs, neurons and outputs as u16, a checksum.
const HEAD: usize = 8 + 6 + 4;

/// Why a file of weights is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// It begins with something else.
    #[error("the weights of the mouth's network are of another kind or version")]
    Kind,
    /// It is for another network.
    #[error(
        "the weights of the mouth's network are for {inputs} inputs, {hidden} neurons and {outputs} outputs"
    )]
    Size {
        /// Numbers that it sees.
        inputs: u16,
        /// Neurons.
        hidden: u16,
        /// Classes.
        outputs: u16,
    },
    /// It is cut short, or has been changed.
    #[error("the weights of the mouth's network are damaged")]
    Damaged,
}

/// The weights of both layers, each row a neuron's, its bias last.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    /// `[HIDDEN][INPUTS + 1]`.
    pub hidden: Vec<f32>,
    /// `[OUTPUTS][HIDDEN + 1]`.
    pub outputs: Vec<f32>,
}

impl Network {
    /// The network that comes with this crate.
    ///
    /// # Errors
    /// If the file that was built in is none.
    pub fn built_in() -> Result<Self, WeightsError> {
        Self::read(include_bytes!("../weights.bin"))
    }

    /// Reads what [`Self::write`] wrote.
    ///
    /// # Errors
    /// If it is something else, or damaged.
    pub fn read(bytes: &[u8]) -> Result<Self, WeightsError> {
        let (head, body) = bytes.split_at_checked(HEAD).ok_or(WeightsError::Kind)?;
        let (kind, rest) = head.split_at(MAGIC.len());
        if kind != MAGIC {
            return Err(WeightsError::Kind);
        }
        let size = |k: usize| u16::from_le_bytes([rest[2 * k], rest[2 * k + 1]]);
        let [inputs, hidden, outputs] = [size(0), size(1), size(2)];
        let wanted = [INPUTS, HIDDEN, OUTPUTS];
        if [inputs, hidden, outputs].map(usize::from) != wanted {
            return Err(WeightsError::Size {
                inputs,
                hidden,
                outputs,
            });
        }
        let sum = u32::from_le_bytes([rest[6], rest[7], rest[8], rest[9]]);
        let length = HIDDEN * row_bytes(INPUTS) + OUTPUTS * row_bytes(HIDDEN);
        if body.len() != length || checksum(body) != sum {
            return Err(WeightsError::Damaged);
        }
        let (first, second) = body.split_at(HIDDEN * row_bytes(INPUTS));
        let network = Self {
            hidden: read_layer(first, INPUTS),
            outputs: read_layer(second, HIDDEN),
        };
        let mut all = network.hidden.iter().chain(&network.outputs);
        if all.any(|weight| !weight.is_finite()) {
            return Err(WeightsError::Damaged);
        }
        Ok(network)
    }

    /// As bytes: of each neuron a scale and a bias as f32 and a weight as i8 for each input.
    #[must_use]
    pub fn write(&self) -> Vec<u8> {
        let mut body = Vec::new();
        write_layer(&self.hidden, INPUTS, &mut body);
        write_layer(&self.outputs, HIDDEN, &mut body);
        let mut bytes = MAGIC.to_vec();
        for size in [INPUTS, HIDDEN, OUTPUTS] {
            #[allow(clippy::cast_possible_truncation, reason = "constants below 65536")]
            bytes.extend((size as u16).to_le_bytes());
        }
        bytes.extend(checksum(&body).to_le_bytes());
        bytes.extend(body);
        bytes
    }

    /// Probabilities of [`CLASSES`], and in `neurons` what the hidden layer answered.
    pub fn judge(&self, seen: &[f32; INPUTS], neurons: &mut [f32; HIDDEN]) -> [f32; OUTPUTS] {
        for (neuron, row) in neurons.iter_mut().zip(self.hidden.chunks_exact(INPUTS + 1)) {
            *neuron = weighted(row, seen).max(0.0);
        }
        let mut outputs = [0.0; OUTPUTS];
        for (output, row) in outputs
            .iter_mut()
            .zip(self.outputs.chunks_exact(HIDDEN + 1))
        {
            *output = weighted(row, neurons);
        }
        let most = outputs.iter().copied().fold(f32::MIN, f32::max);
        let parts = outputs.map(|output| (output - most).exp());
        let sum: f32 = parts.iter().sum();
        parts.map(|part| part / sum)
    }
}

/// A row's weights times the inputs, and its bias. Eight sums at a time, which the processor adds at once.
fn weighted(row: &[f32], seen: &[f32]) -> f32 {
    let (weights, bias) = row.split_at(seen.len());
    let mut sums = [0.0f32; 8];
    let (weights, inputs) = (weights.chunks_exact(8), seen.chunks_exact(8));
    let rest = weights.remainder().iter().zip(inputs.remainder());
    let rest: f32 = rest.map(|(w, x)| w * x).sum();
    for (w, x) in weights.zip(inputs) {
        for k in 0..8 {
            sums[k] += w[k] * x[k];
        }
    }
    sums.iter().sum::<f32>() + rest + bias.iter().sum::<f32>()
}

fn row_bytes(inputs: usize) -> usize {
    8 + inputs
}

fn read_layer(bytes: &[u8], inputs: usize) -> Vec<f32> {
    let mut layer = Vec::new();
    for row in bytes.chunks_exact(row_bytes(inputs)) {
        let number = |k: usize| f32::from_le_bytes([row[k], row[k + 1], row[k + 2], row[k + 3]]);
        let (scale, bias) = (number(0), number(4));
        layer.extend(
            row[8..]
                .iter()
                .map(|byte| f32::from(byte.cast_signed()) * scale),
        );
        layer.push(bias);
    }
    layer
}

fn write_layer(layer: &[f32], inputs: usize, out: &mut Vec<u8>) {
    for row in layer.chunks_exact(inputs + 1) {
        let (weights, bias) = row.split_at(inputs);
        let most = weights.iter().fold(0.0f32, |most, w| most.max(w.abs()));
        let scale = (most / 127.0).max(f32::MIN_POSITIVE);
        out.extend(scale.to_le_bytes());
        out.extend(bias.iter().flat_map(|bias| bias.to_le_bytes()));
        #[allow(clippy::cast_possible_truncation, reason = "-127..=127 by its scale")]
        out.extend(
            weights
                .iter()
                .map(|w| ((w / scale).round() as i8).cast_unsigned()),
        );
    }
}

/// FNV-1a (Fowler, Noll and Vo), 32 bits.
fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |sum, byte| {
        (sum ^ u32::from(*byte)).wrapping_mul(0x0100_0193)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_cut_short_or_changed_anywhere_are_refused() {
        let good = include_bytes!("../weights.bin");
        let network = Network::read(good).expect("the weights that come with it");
        assert_eq!(network.write(), good, "written as they were");
        for length in [0, 7, HEAD - 1, HEAD, good.len() / 2, good.len() - 1] {
            assert!(Network::read(&good[..length]).is_err(), "{length} bytes");
        }
        for at in (0..good.len()).step_by(97).chain([0, 8, 10, 12, 14]) {
            let mut bytes = good.to_vec();
            bytes[at] ^= 0x40;
            assert!(Network::read(&bytes).is_err(), "byte {at} changed");
        }
    }
}
