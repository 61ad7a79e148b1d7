//! The deform graph on ONNX Runtime against the f64 reference.

use npu_runtime::Session;
use onnx_schema::Model;
use prost::Message;
use spmm3::networks::{AttributeNetwork, Dialect, GraphParts, MeshNetwork};
use spmm3::{ATTRIBUTES, Avatar, SkinningTransforms};
use std::io::Cursor;
use synthetic_person::reference;
use synthetic_person::{Puppet, PuppetSize, Random};
use test_support::bound_person::{session, session_in};
use test_support::onnx::runtime;

#[test]
fn making_a_session_leaves_its_threads_arithmetic_unchanged() {
    let Some(runtime) = runtime() else { return };
    let half = || std::hint::black_box(f32::MIN_POSITIVE) * std::hint::black_box(0.5);
    assert!(half() > 0.0, "subnormal numbers are numbers");
    let _session = session(&runtime, &Puppet::small().avatar(), GraphParts::Whole);
    assert!(half() > 0.0, "and still are");
}

#[test]
fn the_graph_poses_mesh_and_attributes_as_in_f64() {
    poses_as_in_f64(Dialect::Package);
}

#[test]
fn the_graph_for_nnapi_poses_mesh_and_attributes_as_in_f64() {
    poses_as_in_f64(Dialect::Nnapi);
}

fn poses_as_in_f64(dialect: Dialect) {
    let Some(runtime) = runtime() else { return };
    let puppet = Puppet::small();
    let (vertices, gaussians) = (puppet.template.vertices().len(), puppet.gaussians.len());
    let mut session = session_in(&runtime, &puppet.avatar(), GraphParts::Whole, dialect);
    let mut outputs = session.outputs().expect("memory for them");
    let rest = puppet.skeleton.rest_positions();
    let (mut worst_vertex, mut largest_offset) = (0.0f64, 0.0f64);
    let mut worst_attribute = [0.0f64; ATTRIBUTES];
    let mut largest_attribute = [0.0f64; ATTRIBUTES];
    for seed in 0..20 {
        let motion = Random::new(seed).motion(0.6);
        let mut transforms = SkinningTransforms::default();
        puppet
            .skeleton
            .skinning(&puppet.skeleton.pose(&motion), &mut transforms);
        session.input_mut(0).copy_from_slice(motion.values());
        session.input_mut(1).copy_from_slice(&transforms.0);
        session.run(&mut outputs).expect("the graph runs");

        let posed = reference::posed_mesh(&puppet.template, rest, &puppet.mesh, motion.values());
        for (v, want) in posed.iter().enumerate() {
            let got = [0, 1, 2].map(|axis| f64::from(outputs.get(0)[axis * vertices + v]));
            worst_vertex = worst_vertex.max(reference::norm(reference::sub(*want, got)));
        }
        for offset in reference::mesh_offsets(&puppet.mesh, motion.values()) {
            largest_offset = largest_offset.max(reference::norm(offset));
        }
        let residuals =
            reference::residuals(&puppet.attributes, &puppet.controllers, motion.values());
        for (i, want) in residuals.iter().enumerate() {
            for (plane, want) in want.iter().enumerate() {
                let got = f64::from(outputs.get(1)[plane * gaussians + i]);
                worst_attribute[plane] = worst_attribute[plane].max((got - want).abs());
                largest_attribute[plane] = largest_attribute[plane].max(want.abs());
            }
        }
    }
    println!(
        "max vertex error {:.5} mm over offsets of up to {:.1} mm",
        worst_vertex * 1e3,
        largest_offset * 1e3
    );
    println!(
        "max attribute errors {:?} over residuals of up to {largest_attribute:.3?}",
        worst_attribute.map(|e| format!("{e:.1e}"))
    );
    assert!(
        worst_vertex <= 0.05e-3,
        "a vertex is {} mm off",
        worst_vertex * 1e3
    );
    assert!(
        (0.005..0.2).contains(&largest_offset),
        "F_mesh should matter: {largest_offset} m"
    );
    for plane in 0..ATTRIBUTES {
        let (error, reach) = (worst_attribute[plane], largest_attribute[plane]);
        assert!(reach > 0.0, "plane {plane} never moves");
        assert!(
            error <= 1e-5 * reach,
            "plane {plane} is {error} off over a reach of {reach}"
        );
    }
}

/// As the package's reader compares it, in order. The file was taken from a package that an earlier version had baked: a graph that differs is one that no package has,
/// and packages of format 2 would be refused.
#[test]
fn the_packages_graph_is_node_for_node_that_of_format_2() {
    let onnx = Puppet::small().graph().to_onnx(GraphParts::Whole);
    let model = Model::decode(&*onnx.expect("the networks fit")).expect("ONNX");
    let graph = model.graph.expect("a graph");
    let nodes = graph.node.iter().map(|node| {
        let operator = node.op_type.as_deref().expect("an operator");
        let (output, input) = (node.output.join(" "), node.input.join(" "));
        format!("node {operator} {output} <- {input}")
    });
    let tensors = graph.initializer.iter().map(|tensor| {
        let name = tensor.name.as_deref().expect("a name");
        let (kind, rank) = (tensor.data_type.expect("a type"), tensor.dims.len());
        format!("tensor {name} type {kind} rank {rank}")
    });
    let written: Vec<String> = nodes.chain(tensors).collect();
    let format: Vec<&str> = include_str!("deform_graph_format_2.txt").lines().collect();
    assert_eq!(written, format, "raise the format's version, and read both");
}

#[test]
fn outputs_of_another_graph_are_refused() {
    let Some(runtime) = runtime() else { return };
    let mut small = session(&runtime, &Puppet::small().avatar(), GraphParts::Whole);
    let other = Puppet::new(PuppetSize {
        gaussians: 1_000,
        ..PuppetSize::SMALL
    });
    let mut outputs = session(&runtime, &other.avatar(), GraphParts::Whole)
        .outputs()
        .expect("memory");
    let error = small.run(&mut outputs).expect_err("another shape");
    assert!(error.to_string().contains("[14, 1000]"), "{error}");
    assert!(outputs.get(0).is_empty(), "nothing was written");
}

#[test]
fn the_networks_can_be_read_back_from_the_graph() {
    let puppet = Puppet::small();
    let model = puppet
        .graph()
        .to_onnx(GraphParts::Whole)
        .expect("the networks fit");
    let attributes = AttributeNetwork::read(&model, &puppet.controllers).expect("F_attr is there");
    assert!(attributes == puppet.attributes, "F_attr came back changed");
    let mesh = MeshNetwork::read(&model, &puppet.template).expect("F_mesh is there");
    assert!(mesh.first == puppet.mesh.first, "the first layer changed");
    assert!(
        mesh.second == puppet.mesh.second,
        "the second layer changed"
    );
    assert!(mesh.code == puppet.mesh.code, "the code layer changed");
    let fields = |network: &MeshNetwork| network.decoder.dequantise();
    assert!(fields(&mesh) == fields(&puppet.mesh), "the fields changed");
    for (got, want) in mesh.decoder.mean().iter().zip(puppet.mesh.decoder.mean()) {
        assert!(
            (got - want).abs() < 2e-7,
            "mean offset {got} m was {want} m"
        );
    }
    let other = Puppet::new(PuppetSize {
        gaussians: 1_000,
        ..PuppetSize::SMALL
    });
    let error = AttributeNetwork::read(&model, &other.controllers).expect_err("fewer Gaussians");
    assert!(error.to_string().contains("bases"), "{error}");
}

#[test]
fn the_graphs_parts_compute_the_same_as_the_whole() {
    let Some(runtime) = runtime() else { return };
    let puppet = Puppet::small();
    let avatar = Avatar::read(Cursor::new(
        puppet.avatar().to_bytes().expect("the puppet is an avatar"),
    ))
    .expect("the package is sound");
    let [mut whole, mut skinned, mut networks] =
        [GraphParts::Whole, GraphParts::Skinned, GraphParts::Networks]
            .map(|parts| session(&runtime, &avatar, parts));
    let motion = Random::new(3).motion(0.6);
    let mut transforms = SkinningTransforms::default();
    puppet
        .skeleton
        .skinning(&puppet.skeleton.pose(&motion), &mut transforms);
    let run = |session: &mut Session| {
        session.input_mut(0).copy_from_slice(motion.values());
        // The networks' graph has no second input.
        if let input @ [_, ..] = session.input_mut(1) {
            input.copy_from_slice(&transforms.0);
        }
        let mut outputs = session.outputs().expect("memory for them");
        session.run(&mut outputs).expect("the parts run");
        outputs
    };
    let [whole, skinned, networks] = [&mut whole, &mut skinned, &mut networks].map(run);
    // The rest shape comes back from a sum of floats, so that equal means equal but for its rounding.
    for (got, want) in skinned.get(0).iter().zip(whole.get(0)) {
        assert!((got - want).abs() < 1e-6, "a vertex at {got}, not {want} m");
    }
    assert_eq!(skinned.get(1), networks.get(1), "potentials");
    let controllers = puppet.controllers.vertices().len();
    let wanted = reference::potentials(&puppet.attributes, controllers, motion.values()).concat();
    let got = networks.get(1);
    assert_eq!(got.len(), wanted.len(), "C x B potentials");
    for (got, want) in got.iter().zip(&wanted) {
        let error = (f64::from(*got) - want).abs();
        assert!(error < 1e-5, "a potential of {got}, not {want}");
    }
    let vertices = puppet.template.vertices();
    let offsets = reference::mesh_offsets(&puppet.mesh, motion.values());
    for (v, (rest, offset)) in vertices.iter().zip(offsets).enumerate() {
        let want = reference::add(reference::wide(*rest), offset);
        for (axis, want) in want.into_iter().enumerate() {
            let got = f64::from(networks.get(0)[axis * vertices.len() + v]);
            assert!((got - want).abs() < 5e-6, "vertex {v} at {got}, not {want}");
        }
    }
}
