//! F_attr before it has learnt anything: residuals are 0, forces are features of the pose around each controller.

use super::inputs::InputStatistics;
use super::pairs::REACH;
use crate::random::normal;
use half::f16;
use spmm3::networks::{AttributeNetwork, Dense, QuantisedBases};
use spmm3::{ATTRIBUTES, Controllers, JOINTS, Joint, MotionParams, PARAMS, PersonError, Template};

/// Hidden units of a controller.
pub const CONTROLLER_HIDDEN: usize = 16;
/// B: bases of a Gaussian.
pub const BASES: usize = 15;

/// Its hidden units stand in pairs.
const PAIRS: usize = CONTROLLER_HIDDEN / 2;

/// Where the capture shows less variation of a controller's inputs together, features vary less in it.
const LEAST: f32 = 0.2;

/// How far each hidden unit's input spreads over the capture's poses.
const GAIN: f32 = 1.0;

/// Networks for `controllers` of a template, without effect on its Gaussians.
///
/// All controllers have the same features, of those joints that move the skin where they sit, of these joints' neighbours, and of the whole
/// person's orientation, as light depends on it: so neighbouring controllers agree from the start, as L_guide wants them to, and a sleeve is not
/// taught to follow a foot. They stand in pairs (see `fresh/pairs.rs`), so that no pose asks for more than a few times what the capture's do, and are of each motion
/// parameter as far as the capture shows it: what never varied in it says nothing of poses to come.
///
/// # Errors
/// Numbers that do not make a network, which takes motions that are not finite.
pub fn attribute_network(
    template: &Template,
    controllers: &Controllers,
    inputs: &InputStatistics,
    seed: u64,
) -> Result<AttributeNetwork, PersonError> {
    let seats = controllers.vertices();
    let units = CONTROLLER_HIDDEN * seats.len();
    let mut rng = fastrand::Rng::with_seed(seed);
    let features: Vec<f32> = (0..PARAMS * PAIRS).map(|_| normal(&mut rng)).collect();
    #[expect(clippy::cast_precision_loss, reason = "few units")]
    let spread = 1.0 / (PAIRS as f32).sqrt();
    let mut weighed = Vec::new();
    let mut middle = vec![0.0; BASES];
    for _ in 0..PAIRS {
        let row: Vec<f32> = (0..BASES)
            .map(|_| f16::from_f32(normal(&mut rng) * spread).to_f32())
            .collect();
        for (middle, weight) in middle.iter_mut().zip(&row) {
            *middle -= weight * REACH;
        }
        weighed.extend(row.iter().copied());
        weighed.extend(row.iter().map(|weight| -weight));
    }
    let mut weights = vec![0.0f32; PARAMS * units];
    let mut bias = vec![0.0f32; units];
    for (controller, vertex) in seats.iter().enumerate() {
        let relevance = relevance(&template.skin()[*vertex as usize].dense());
        let shares = relevance.iter().zip(&inputs.shown);
        let shares: Vec<f32> = shares.map(|(share, shown)| share * shown).collect();
        let total: f32 = shares.iter().map(|share| share * share).sum();
        let gain = GAIN / total.sqrt().max(LEAST);
        for (input, share) in shares.iter().enumerate() {
            let scale = gain * share / inputs.spread[input];
            for pair in 0..PAIRS {
                let weight = features[input * PAIRS + pair] * scale;
                let column = controller * CONTROLLER_HIDDEN + 2 * pair;
                for unit in [column, column + 1] {
                    weights[input * units + unit] = weight;
                    bias[unit] -= weight * inputs.mean[input];
                }
            }
        }
    }
    for pair in bias.chunks_exact_mut(2) {
        pair[0] += REACH;
        pair[1] -= REACH;
    }
    let gaussians = controllers.neighbours().len();
    let zeros = vec![0.0; ATTRIBUTES * BASES * gaussians];
    Ok(AttributeNetwork {
        first: Dense::new(PARAMS, units, &weights, bias)?,
        second: (0..seats.len())
            .flat_map(|_| weighed.iter().map(|weight| f16::from_f32(*weight)))
            .collect(),
        second_bias: (0..seats.len()).flat_map(|_| &middle).copied().collect(),
        bases: QuantisedBases::quantise(BASES, gaussians, &zeros)?,
    })
}

/// How much each motion parameter matters where the skin hangs on joints by these shares, 0..=1.
fn relevance(skin: &[f32; JOINTS]) -> [f32; PARAMS] {
    let mut joints = *skin;
    for joint in Joint::ALL {
        let Some(parent) = joint.parent() else {
            continue;
        };
        let (child, parent) = (joint.index(), parent.index());
        joints[child] += 0.5 * skin[parent];
        joints[parent] += 0.5 * skin[child];
    }
    joints[Joint::Pelvis.index()] += 0.5;
    let mut relevance = [0.0; PARAMS];
    for joint in Joint::ALL {
        let first = MotionParams::offset_of(joint);
        relevance[first..first + 3].fill(joints[joint.index()].min(1.0));
    }
    relevance
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic_person::{Puppet, Random};

    #[test]
    fn a_fresh_network_fits_its_person_and_changes_nothing() {
        let puppet = Puppet::small();
        let mut random = Random::new(4);
        let motions: Vec<MotionParams> = (0..20).map(|_| random.motion(0.4)).collect();
        let inputs = InputStatistics::new(motions.iter());
        let network = attribute_network(&puppet.template, &puppet.controllers, &inputs, 1)
            .expect("a network");
        network.check(16, puppet.gaussians.len()).expect("it fits");
        assert!(
            network.bases.values().iter().all(|value| *value == 0),
            "no residuals"
        );
        assert!(
            network.second.iter().any(|weight| weight.to_f32() != 0.0),
            "but forces"
        );
    }

    #[test]
    fn a_hand_does_not_follow_the_other_leg() {
        let mut skin = [0.0; JOINTS];
        skin[Joint::LeftWrist.index()] = 1.0;
        let relevance = relevance(&skin);
        let at = |joint| relevance[MotionParams::offset_of(joint)];
        assert!(at(Joint::LeftWrist) > 0.9, "itself");
        assert!(at(Joint::LeftElbow) > 0.4, "its neighbour");
        assert!(at(Joint::Pelvis) > 0.4, "the orientation");
        assert!(at(Joint::RightKnee).abs() < 1e-6, "no other limb");
    }
}
