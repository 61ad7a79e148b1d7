//! Inputs at the borders: nothing that is finite gives a number that is not, and what does not fit is refused.

use crate::people::{Person, TINY, random_attributes};
use avatar_gradient::{Derivatives, Model, ModelError, Networks, Parameters, Posed};
use spmm3::MotionParams;
use synthetic_person::{Puppet, Random};

fn all_finite(person: &Person, posed: &mut Posed) {
    let by = random_attributes(TINY.gaussians, &mut Random::new(4));
    let by = Derivatives {
        gaussians: Some(&by),
        ..Derivatives::default()
    };
    let mut gradients = Parameters::zeros(person.model.sizes());
    let by_pose = person
        .model
        .backward(&person.parameters, posed, &by, &mut gradients)
        .expect("fits");
    let finite = |numbers: &[f32]| numbers.iter().all(|x| x.is_finite());
    assert!(finite(posed.gaussians().numbers()), "Gaussians");
    assert!(finite(&by_pose.0), "by the pose");
    for (name, array) in gradients.arrays() {
        assert!(finite(array), "by {name}");
    }
}

#[test]
fn rotations_of_no_length_are_the_identity_and_have_no_derivative() {
    let mut person = Person::new(TINY);
    person.model.parts.attributes = false;
    let n = TINY.gaussians;
    person.parameters.gaussians[3 * n..7 * n].fill(0.0);
    let mut posed = person.posed(&MotionParams::default());
    all_finite(&person, &mut posed);
}

#[test]
fn collapsed_triangles_give_finite_gaussians_and_derivatives() {
    let mut person = Person::new(TINY);
    person.model.parts.mesh = false;
    let vertices = person.puppet.template.vertices().to_vec();
    let count = vertices.len();
    let corners = person.puppet.gaussians.corners().to_vec();
    // To a point, to a line, and nearly so.
    for (kind, squash) in [0.0f32, 1e-7, 1e-4].into_iter().enumerate() {
        for (k, [a, b, c]) in corners.iter().enumerate() {
            let to = vertices[*a as usize];
            for corner in if k % 2 == 0 { vec![b, c] } else { vec![c] } {
                for axis in 0..3 {
                    let from = vertices[*corner as usize];
                    person.parameters.mesh_mean[axis * count + *corner as usize] =
                        (to + (from - to) * squash - from)[axis];
                }
            }
        }
        for motion in [MotionParams::default(), Random::new(5).motion(1.0)] {
            let mut posed = person.posed(&motion);
            all_finite(&person, &mut posed);
            println!("kind {kind} is finite");
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let person = Person::new(TINY);
    let motion = MotionParams::default();
    let mut posed = Posed::new();
    let mut short = person.parameters.clone();
    short.mesh_mean.pop();
    let refused = person.model.pose(&short, &motion, None, &mut posed);
    assert!(
        refused.is_err_and(|why| why.to_string().contains("mesh.mean")),
        "a number too few"
    );
    let mut gradients = Parameters::zeros(person.model.sizes());
    let refused = person.model.backward(
        &person.parameters,
        &mut posed,
        &Derivatives::default(),
        &mut gradients,
    );
    assert!(matches!(refused, Err(ModelError::NotPosed(_))), "not posed");

    let mut posed = person.posed(&motion);
    let few = random_attributes(3, &mut Random::new(1));
    let numbers = vec![0.0; 5];
    for by in [
        Derivatives {
            gaussians: Some(&few),
            ..Derivatives::default()
        },
        Derivatives {
            vertices: Some(&numbers),
            ..Derivatives::default()
        },
        Derivatives {
            offsets: Some(&numbers),
            ..Derivatives::default()
        },
    ] {
        let refused = person
            .model
            .backward(&person.parameters, &mut posed, &by, &mut gradients);
        assert!(
            matches!(refused, Err(ModelError::Count { .. })),
            "{refused:?}"
        );
    }
    let mut other = person.model.clone();
    other.parts.attributes = false;
    let refused = other.backward(
        &person.parameters,
        &mut posed,
        &Derivatives::default(),
        &mut gradients,
    );
    assert!(
        matches!(refused, Err(ModelError::NotPosed(_))),
        "other parts"
    );
}

#[test]
fn networks_of_another_person_are_refused() {
    let person = Person::new(TINY);
    let other = Puppet::small();
    let networks = Networks {
        gaussians: other.gaussians,
        mesh: other.mesh,
        attributes: other.attributes,
    };
    let puppet = &person.puppet;
    let refused = Model::new(
        &puppet.skeleton,
        &puppet.template,
        &puppet.controllers,
        &networks,
    );
    assert!(refused.is_err(), "300 Gaussians are held, not 2,000");
}
