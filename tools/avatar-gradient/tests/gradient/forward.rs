//! What the model computes against the receiver's own kernels, `spmm3`, and the f64 reference of a person's motion.

use crate::people::Person;
use app_kernels::state::{GaussianState, plane};
use app_kernels::{Attributes, PoseInputs, Poser, Skinner};
use avatar_gradient::Posed;
use spmm3::{GaussianSet, PlanarVertices, SkinningTransforms};
use synthetic_person::reference::{self, norm, sub, wide};
use synthetic_person::{PuppetSize, Random};

/// Metres: the receiver and a training may differ by so much.
const MOST: f64 = 0.05e-3;

#[test]
fn the_mesh_and_the_potentials_are_those_of_the_networks_in_f64() {
    let person = Person::new(PuppetSize::SMALL);
    let puppet = &person.puppet;
    let count = puppet.template.vertices().len();
    let mut worst = (0.0f64, 0.0f64);
    for seed in 0..5 {
        let motion = Random::new(seed).motion(0.6);
        let posed = person.posed(&motion);
        let rest = puppet.skeleton.rest_positions();
        let mesh = reference::posed_mesh(&puppet.template, rest, &puppet.mesh, motion.values());
        for (v, want) in mesh.iter().enumerate() {
            let got = [0, 1, 2].map(|axis| f64::from(posed.vertices()[axis * count + v]));
            let want = reference::add(*want, wide(motion.root_translation));
            worst.0 = worst.0.max(norm(sub(got, want)));
        }
        let controllers = puppet.controllers.vertices().len();
        let wanted = reference::potentials(&puppet.attributes, controllers, motion.values());
        for (got, want) in posed.potentials().iter().zip(wanted.iter().flatten()) {
            worst.1 = worst.1.max((f64::from(*got) - want).abs());
        }
    }
    println!(
        "vertices {:.5} mm, potentials {:.1e}",
        1e3 * worst.0,
        worst.1
    );
    assert!(worst.0 < MOST, "vertices are {} m off", worst.0);
    assert!(worst.1 < 1e-4, "potentials are {} off", worst.1);
}

#[test]
fn jitter_is_seen_by_the_networks_and_by_nothing_else() {
    let mut person = Person::new(PuppetSize::SMALL);
    let motion = Random::new(8).motion(0.6);
    let mut random = Random::new(9);
    let jitter: Vec<f32> = (0..spmm3::PARAMS).map(|_| 0.1 * random.signed()).collect();
    let mut inputs = motion.values().to_vec();
    inputs
        .iter_mut()
        .zip(&jitter)
        .for_each(|(input, jitter)| *input += jitter);
    person.model.jitter = jitter;
    let posed = person.posed(&motion);
    let controllers = person.puppet.controllers.vertices().len();
    let wanted = reference::potentials(&person.puppet.attributes, controllers, &inputs);
    for (got, want) in posed.potentials().iter().zip(wanted.iter().flatten()) {
        assert!((f64::from(*got) - want).abs() < 1e-4, "{got}, not {want}");
    }
    // A layer's derivative is its input times that of its bias, whatever comes after it.
    let sizes = *person.model.sizes();
    let mut gradients = avatar_gradient::Parameters::zeros(&sizes);
    let mut posed = posed;
    let by_gaussians = crate::people::random_attributes(sizes.gaussians, &mut random);
    let by = avatar_gradient::Derivatives {
        gaussians: Some(&by_gaussians),
        ..Default::default()
    };
    (person.model)
        .backward(&person.parameters, &mut posed, &by, &mut gradients)
        .expect("it was posed");
    for layer in [&gradients.controllers_first, &gradients.mesh_first] {
        let width = layer.bias.len();
        let most = layer.bias.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        assert!(most > 0.0, "something is learnt");
        for (row, input) in layer.weights.chunks(width).zip(&inputs) {
            for (weight, bias) in row.iter().zip(&layer.bias) {
                assert!((weight - input * bias).abs() <= 1e-5 * most, "{weight}");
            }
        }
    }
    // Without networks nothing is changed.
    person.model.parts.mesh = false;
    person.model.parts.attributes = false;
    let with = person.posed(&motion);
    person.model.jitter.clear();
    assert_eq!(
        with.gaussians().numbers(),
        person.posed(&motion).gaussians().numbers(),
        "the skeleton"
    );
}

#[test]
fn the_gaussians_are_those_that_spmm3_poses() {
    let person = Person::new(PuppetSize::SMALL);
    let puppet = &person.puppet;
    let motion = Random::new(3).motion(0.6);
    let posed = person.posed(&motion);
    let mut residuals = posed.local().to_vec();
    for (residual, template) in residuals.iter_mut().zip(&person.parameters.gaussians) {
        *residual -= template;
    }
    let vertices = PlanarVertices::new(posed.vertices(), puppet.template.vertices().len());
    let mut set = GaussianSet::zeroed(puppet.gaussians.len());
    puppet
        .gaussians
        .pose(
            vertices.expect("as many"),
            Some(&residuals),
            glam::Vec3::ZERO,
            &mut set,
        )
        .expect("as many");
    let all = posed.gaussians();
    for i in 0..set.len() {
        let got = |k: usize| all.plane(k)[i];
        let place = glam::Vec3::new(got(0), got(1), got(2));
        assert!(
            place.distance(set.positions[i]) < 5e-6,
            "{i}: at {place}, not {}",
            set.positions[i]
        );
        let turn = glam::Quat::from_xyzw(got(3), got(4), got(5), got(6));
        assert!(
            turn.dot(set.rotations[i]).abs() > 1.0 - 1e-5,
            "{i}: turned by {turn}"
        );
        for axis in 0..3 {
            let scale = (got(7 + axis) - set.log_scales[i][axis]).abs();
            let colour = (got(11 + axis) - 0.5 - spmm3::SH_C0 * set.colours[i][axis]).abs();
            assert!(scale < 1e-5 && colour < 1e-5, "{i}: {scale}, {colour}");
        }
        assert!(
            (got(10) - set.opacity_logits[i]).abs() < 1e-5,
            "{i}: opacity"
        );
    }
}

#[test]
fn the_gaussians_are_those_of_the_receivers_kernels_to_a_twentieth_of_a_millimetre() {
    let person = Person::new(PuppetSize::SMALL);
    let avatar = person.puppet.avatar();
    let poser = Poser::with_tail(&avatar).expect("the puppet's graph");
    let mut skinner = Skinner::new(&avatar.template);
    let mut worst = [0.0f32; 5];
    for seed in 0..4 {
        let motion = Random::new(seed).motion(0.6);
        let posed = person.posed(&motion);
        let mut transforms = SkinningTransforms::default();
        let joints = avatar.skeleton.pose(&motion);
        avatar.skeleton.skinning(&joints, &mut transforms);
        let mut vertices = vec![0.0; posed.canonical().len()];
        skinner
            .skin(posed.canonical(), &transforms, &mut vertices)
            .expect("as many");
        let inputs = PoseInputs {
            vertices: &vertices,
            attributes: Attributes::Potentials(posed.potentials()),
            root: motion.root_translation,
        };
        let mut state = GaussianState::new(avatar.gaussians.len());
        poser
            .pose(&inputs, 0..avatar.gaussians.len(), None, &mut state)
            .expect("as many");
        for (worst, error) in worst.iter_mut().zip(differences(&posed, &state)) {
            *worst = worst.max(error);
        }
    }
    println!(
        "place {:.1e} m, rotation {:.1e}, ln scale {:.1e}, opacity {:.1e}, colour {:.1e}",
        worst[0], worst[1], worst[2], worst[3], worst[4]
    );
    assert!(f64::from(worst[0]) < MOST, "{} m", worst[0]);
    assert!(worst[1..].iter().all(|error| *error < 1e-4), "{worst:?}");
}

/// Greatest differences of place, rotation (1 - |cosine|), logarithm of scale, opacity and colour.
fn differences(posed: &Posed, state: &GaussianState) -> [f32; 5] {
    let ours = posed.gaussians();
    let mut worst = [0.0f32; 5];
    for i in 0..ours.len() {
        let pair = |k: usize| (ours.plane(k)[i], state.plane(k)[i]);
        let mut note = |kind: usize, error: f32| worst[kind] = worst[kind].max(error);
        for k in plane::POSITION {
            note(0, (pair(k).0 - pair(k).1).abs());
        }
        let cosine: f32 = plane::ROTATION.map(|k| pair(k).0 * pair(k).1).sum();
        note(1, (1.0 - cosine.abs()).abs());
        for k in plane::LOG2_SCALE {
            note(2, (pair(k).0 - pair(k).1 / std::f32::consts::LOG2_E).abs());
        }
        let (logit, opacity) = pair(plane::OPACITY);
        note(3, (1.0 / (1.0 + (-logit).exp()) - opacity).abs());
        for k in plane::COLOUR {
            note(4, (pair(k).0 - pair(k).1).abs());
        }
    }
    worst
}
