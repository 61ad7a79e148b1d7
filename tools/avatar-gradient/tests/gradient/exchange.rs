//! Numbers to the networks of a package and back.

use crate::people::{Person, TINY};
use avatar_gradient::{ModelError, Networks, Parameters};
use spmm3::networks::{DeformGraph, GraphParts};
use synthetic_person::Random;

fn exported(person: &Person, parameters: &Parameters) -> Result<Networks, ModelError> {
    let puppet = &person.puppet;
    parameters.to_networks(&puppet.template, &puppet.controllers, &puppet.gaussians)
}

#[test]
fn a_package_keeps_every_number_within_its_quantisation() {
    let mut person = Person::new(TINY);
    let mut random = Random::new(8);
    for (_, array) in person.parameters.arrays_mut() {
        for number in array {
            *number *= 1.0 + 0.1 * random.signed();
        }
    }
    let networks = exported(&person, &person.parameters).expect("a person");
    let back = networks.parameters();
    for ((name, before), (_, after)) in person.parameters.arrays().into_iter().zip(back.arrays()) {
        let most = before.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        for (before, after) in before.iter().zip(after) {
            // 8 bits of the greatest of a row, 11 bits of a number, all bits of a bias.
            let room = match name {
                "bases" | "mesh.fields" => 0.51 * most / 127.0,
                name if name.ends_with("bias") || name == "mesh.mean" => 0.0,
                _ => before.abs() / 2048.0 + 1e-7,
            };
            assert!((before - after).abs() <= room, "{name}: {before}, {after}");
        }
    }
    let graph = DeformGraph {
        template: &person.puppet.template,
        controllers: &person.puppet.controllers,
        mesh: &networks.mesh,
        attributes: &networks.attributes,
    };
    assert!(
        graph.to_onnx(GraphParts::Whole).is_ok(),
        "a graph is made of them"
    );
}

#[test]
fn what_a_package_holds_comes_back_as_it_was() {
    let person = Person::new(TINY);
    let once = exported(&person, &person.parameters).expect("a person");
    assert_eq!(once.gaussians, person.puppet.gaussians, "half precision");
    assert_eq!(once.mesh.first, person.puppet.mesh.first, "half precision");
    assert_eq!(
        once.attributes.second, person.puppet.attributes.second,
        "half precision"
    );
    let twice = exported(&person, &once.parameters()).expect("a person");
    assert_eq!(
        twice.attributes.bases.values(),
        once.attributes.bases.values(),
        "8 bits"
    );
}

#[test]
fn numbers_that_a_package_cannot_hold_are_refused() {
    let person = Person::new(TINY);
    let broken = |change: &dyn Fn(&mut Parameters)| {
        let mut parameters = person.parameters.clone();
        change(&mut parameters);
        exported(&person, &parameters).is_err()
    };
    assert!(broken(&|p| p.gaussians[7] = f32::NAN), "an attribute");
    assert!(broken(&|p| p.bases[7] = f32::INFINITY), "a basis");
    assert!(broken(&|p| p.controllers_second[2] = 1e6), "a weight");
    assert!(broken(&|p| p.mesh_mean[2] = 3.0), "a mean offset");
    assert!(broken(&|p| p.mesh_fields.truncate(9)), "too few numbers");
}
