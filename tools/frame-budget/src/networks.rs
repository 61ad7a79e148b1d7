//! The networks on the GPU: one pose by the renderer's shaders, layer after layer.

use crate::chip::Chip;
use crate::estimate::Estimate;
use crate::processors::Person;
use crate::shader_costs::{ShaderCosts, TableError};
use crate::stages::{Load, StageEstimate, waves};

/// Inputs, or fields, that an invocation reads at once.
const AT_ONCE: f64 = 4.0;

/// One pose's networks.
///
/// # Errors
/// A table of other shaders.
pub fn networks(
    person: &Person,
    costs: &ShaderCosts,
    chip: &Chip,
) -> Result<StageEstimate, TableError> {
    let (weights, outputs) = (person.weights as f64, person.outputs as f64);
    let coordinates = 3.0 * person.vertices as f64;
    let fields = person.fields as f64;
    // An invocation computes two outputs, from a mean number of inputs of which one is left over; or four coordinates.
    let dense = [
        ("", 1.0),
        ("1", weights / outputs.max(1.0) / AT_ONCE),
        ("2", 1.0),
    ];
    let decode = [("", 1.0), ("1", fields / AT_ONCE), ("2", 0.0)];
    let dense = costs.issued("dense compute 64", &dense)? * waves(outputs / 2.0);
    let decode = costs.issued("decode_vertices compute 64", &decode)? * waves(coordinates / 4.0);
    // Halves; a byte a field, with a half of scale, the mesh at rest and what is written in floats.
    let bytes = 2.0 * weights + coordinates * (fields + 2.0 + 4.0 + 4.0);
    Ok(Load::new(chip, 4.0)
        .issues(dense + decode)
        .bytes(bytes)
        // The mesh's layers have too few outputs to hide what they wait for.
        .chain(Estimate::exactly((person.depth as f64 + fields) / AT_ONCE))
        .end("networks"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::QUEST_3;
    use crate::stages::Limit;

    #[test]
    fn a_pose_waits_for_its_layers_and_then_for_its_weights() {
        let person = Person {
            vertices: 1_000,
            weights: 4_000_000,
            outputs: 20_000,
            depth: 700,
            fields: 100,
            ..Person::default()
        };
        let costs = ShaderCosts::of_table();
        let chip = Chip {
            // A megabyte a millisecond, and nothing to wait for.
            memory: Estimate::exactly(1e6),
            latency: Estimate::NONE,
            barrier: Estimate::NONE,
            ..QUEST_3
        };
        let bound = networks(&person, &costs, &chip).expect("the table's shaders");
        // 8 MB of halves; 3,000 coordinates of 100 bytes and 10 more.
        assert_eq!(bound.limit, Limit::Memory, "{bound:?}");
        assert!((bound.ms.likely - 8.33).abs() < 1e-9, "{bound:?}");
        let slow = Chip {
            // A tenth of a millisecond for every four of 800.
            latency: Estimate::exactly(0.1),
            ..chip
        };
        let bound = networks(&person, &costs, &slow).expect("the table's shaders");
        assert_eq!(bound.limit, Limit::Latency, "{bound:?}");
        assert!((bound.ms.likely - 20.0).abs() < 1e-9, "{bound:?}");
    }
}
