//! F_attr before it has learnt anything: residuals are 0, forces are features of the pose around each controller.

use super::inputs::InputStatistics;
use crate::random::normal;
use half::f16;
use spmm3::networks::{AttributeNetwork, Dense, QuantisedBases};
use spmm3::{ATTRIBUTES, Controllers, JOINTS, Joint, MotionParams, PARAMS, PersonError, Template};

/// Hidden units of a controller.
pub const CONTROLLER_HIDDEN: usize = 16;
/// B: bases of a Gaussian.
pub const BASES: usize = 15;

/// How far each hidden unit's input spreads over the capture's poses.
const GAIN: f32 = 1.0;

/// Networks for `controllers` of a template, without effect on its Gaussians.
///
/// All controllers have the same features, of those joints that move the skin where they sit, of these joints' neighbours, and of the whole
/// person's orientation, as light depends on it: so neighbouring controllers agree from the start, as L_guide wants them to, and a sleeve is not
/// taught to follow a foot. All inputs can be learnt.
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
    let features: Vec<f32> = (0..PARAMS * CONTROLLER_HIDDEN)
        .map(|_| normal(&mut rng))
        .collect();
    #[expect(clippy::cast_precision_loss, reason = "few units")]
    let spread = 1.0 / (CONTROLLER_HIDDEN as f32).sqrt();
    let weighed: Vec<f32> = (0..CONTROLLER_HIDDEN * BASES)
        .map(|_| normal(&mut rng) * spread)
        .collect();
    let mut weights = vec![0.0f32; PARAMS * units];
    let mut bias = vec![0.0f32; units];
    for (controller, vertex) in seats.iter().enumerate() {
        let relevance = relevance(&template.skin()[*vertex as usize].dense());
        let total: f32 = relevance.iter().map(|share| share * share).sum();
        let gain = GAIN / total.sqrt().max(1e-6);
        for (input, share) in relevance.iter().enumerate() {
            let scale = gain * share / inputs.spread[input];
            for unit in 0..CONTROLLER_HIDDEN {
                let weight = features[input * CONTROLLER_HIDDEN + unit] * scale;
                let column = controller * CONTROLLER_HIDDEN + unit;
                weights[input * units + column] = weight;
                bias[column] -= weight * inputs.mean[input];
            }
        }
    }
    let gaussians = controllers.neighbours().len();
    let zeros = vec![0.0; ATTRIBUTES * BASES * gaussians];
    Ok(AttributeNetwork {
        first: Dense::new(PARAMS, units, &weights, bias)?,
        second: (0..seats.len())
            .flat_map(|_| weighed.iter().map(|weight| f16::from_f32(*weight)))
            .collect(),
        second_bias: vec![0.0; seats.len() * BASES],
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
