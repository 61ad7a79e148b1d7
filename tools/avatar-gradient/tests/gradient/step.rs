//! Adam's steps of the bases.

use crate::people::{Person, TINY, random_attributes};
use avatar_gradient::{Derivatives, ModelError, Moved, Parameters, Posed, step_bases};
use splat_gradient::Attributes;
use splat_gradient::adam::{Adam, Group};
use synthetic_person::Random;

const RATES: [f32; 14] = [
    1e-3, 1e-3, 1e-3, 2e-3, 2e-3, 2e-3, 2e-3, 0.0, 0.0, 0.0, 5e-3, 3e-3, 3e-3, 3e-3,
];

/// A backward pass with L_guide; returns the derivatives by the bases.
fn derived(person: &Person, posed: &mut Posed, by: &Attributes) -> Vec<f32> {
    let offsets = person.model.controller_offsets(&person.parameters, posed);
    let mut by_offsets = vec![0.0; offsets.expect("posed").len()];
    for (k, by) in (0u8..).zip(&mut by_offsets) {
        *by = f32::from(k % 5) - 2.0;
    }
    let by = Derivatives {
        gaussians: Some(by),
        offsets: Some(&by_offsets),
        ..Derivatives::default()
    };
    let mut gradients = Parameters::zeros(person.model.sizes());
    person
        .model
        .backward(&person.parameters, posed, &by, &mut gradients)
        .expect("fits");
    gradients.bases
}

#[test]
fn a_step_that_multiplies_as_it_goes_is_adams() {
    let mut person = Person::new(TINY);
    let mut wanted = person.parameters.bases.clone();
    let (mut adam, mut fused) = (Adam::new(wanted.len()), Adam::new(wanted.len()));
    let groups = RATES.map(|rate| Group {
        count: wanted.len() / 14,
        rate,
    });
    for seed in 0..3 {
        let mut posed = person.posed(&Random::new(seed).motion(0.5));
        let by = random_attributes(TINY.gaussians, &mut Random::new(seed));
        let gradients = derived(&person, &mut posed, &by);
        adam.step(&mut wanted, &gradients, &groups).expect("all");
        step_bases(
            &mut fused,
            &mut person.parameters.bases,
            &person.model,
            &posed,
            &RATES,
            Moved::All,
        )
        .expect("derivatives");
        assert_eq!(person.parameters.bases, wanted, "step {seed}");
    }
    assert_eq!(
        (fused.first, fused.second),
        (adam.first, adam.second),
        "moments"
    );
}

#[test]
fn gaussians_that_are_not_seen_keep_their_bases() {
    let mut person = Person::new(TINY);
    let mut posed = person.posed(&Random::new(1).motion(0.5));
    let mut by = random_attributes(TINY.gaussians, &mut Random::new(1));
    for plane in 0..14 {
        by.plane_mut(plane)[100..200].fill(0.0);
    }
    let derivatives = Derivatives {
        gaussians: Some(&by),
        ..Derivatives::default()
    };
    let mut gradients = Parameters::zeros_without_bases(person.model.sizes());
    person
        .model
        .backward(&person.parameters, &mut posed, &derivatives, &mut gradients)
        .expect("fits");
    let before = person.parameters.bases.clone();
    let mut adam = Adam::new(before.len());
    step_bases(
        &mut adam,
        &mut person.parameters.bases,
        &person.model,
        &posed,
        &[1e-3; 14],
        Moved::Seen,
    )
    .expect("derivatives");
    for (index, (before, after)) in before.iter().zip(&person.parameters.bases).enumerate() {
        let gaussian = index % TINY.gaussians;
        // Groups of 16.
        let hidden = (112..192).contains(&gaussian);
        let shown = !(96..208).contains(&gaussian);
        assert!(!hidden || before == after, "{gaussian} was not seen");
        assert!(!shown || before != after, "{gaussian} was seen");
    }
}

#[test]
fn a_step_needs_derivatives_of_the_pose() {
    let mut person = Person::new(TINY);
    let motion = Random::new(1).motion(0.5);
    let mut posed = person.posed(&motion);
    let mut adam = Adam::new(person.parameters.bases.len());
    let by = random_attributes(TINY.gaussians, &mut Random::new(1));
    derived(&person, &mut posed, &by);
    // Another pose into the same memory.
    person
        .model
        .pose(&person.parameters, &motion, None, &mut posed)
        .expect("fits");
    let before = person.parameters.bases.clone();
    let refused = step_bases(
        &mut adam,
        &mut person.parameters.bases,
        &person.model,
        &posed,
        &RATES,
        Moved::All,
    );
    assert!(
        matches!(refused, Err(ModelError::NotPosed(_))),
        "{refused:?}"
    );
    assert_eq!(person.parameters.bases, before, "unchanged");
}
