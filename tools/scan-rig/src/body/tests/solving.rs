//! Derivatives and the solver, against small steps and a dense solver.

use super::super::derivatives::Derivatives;
use super::super::laplacian::{Laplacian, Pulled};
use super::super::model::Neighbours;
use super::super::state::{Posed, SCALE, SHAPES, TURNED, TURNS};
use super::{model, posed_body};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use spmm3::Joint;

#[test]
fn the_derivatives_are_those_of_small_steps() {
    let Some(model) = model() else { return };
    let state = posed_body(model);
    let posed = Posed::new(model, &state);
    let derivatives = Derivatives::new(model, &state, &posed);
    let mut row = vec![0.0; state.unknowns()];
    let direction = DVec3::new(0.5, -0.7, 0.4);
    let vertices = [454, 3000, 7000, 11_000];
    for at in [
        0,
        SCALE,
        TURNS + 1,
        TURNS + 3 * 14 + 2,
        TURNS + 3 * 13,
        SHAPES,
        SHAPES + 9,
    ] {
        let mut step = DVector::zeros(state.unknowns());
        step[at] = 1e-6;
        let mut there = state.clone();
        there.step(&step);
        step[at] = -1e-6;
        let mut back = state.clone();
        back.step(&step);
        let (there, back) = (Posed::new(model, &there), Posed::new(model, &back));
        for vertex in vertices {
            derivatives.of_vertex(vertex, direction, &mut row);
            let moved = (there.vertices[vertex] - back.vertices[vertex]).dot(direction) / 2e-6;
            assert!(
                (row[at] - moved).abs() < 1e-5,
                "vertex {vertex}, unknown {at}: {} is not {moved}",
                row[at]
            );
        }
        let joint = Joint::LeftWrist;
        derivatives.of_joint(joint, direction, &mut row);
        let moved = there.joints[joint.index()] - back.joints[joint.index()];
        let moved = moved.dot(direction) / 2e-6;
        assert!((row[at] - moved).abs() < 1e-5, "the wrist, unknown {at}");
    }
    assert_eq!(TURNED.len(), 20, "turned joints");
}

#[test]
fn the_smoothest_displacement_is_that_of_a_dense_solver() {
    // A strip of quads, pulled at both ends.
    let rings: Vec<[u32; 4]> = (0..9)
        .map(|k| [2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2])
        .collect();
    let neighbours = Neighbours::new(20, &rings);
    let stiffness: Vec<f64> = (0..20).map(|v| 1.0 + 0.3 * f64::from(v % 3)).collect();
    let mut pulled = vec![Pulled::default(); 20];
    for (v, towards) in [
        (0, DVec3::X),
        (1, DVec3::Z),
        (19, DVec3::new(0.0, 2.0, -1.0)),
    ] {
        pulled[v].every_way = 3.0;
        pulled[v].towards = 3.0 * towards;
    }
    pulled[10].normal = DVec3::Y;
    pulled[10].along = 2.0;
    pulled[10].towards = DVec3::Y * -1.0;
    let mut found = vec![DVec3::ZERO; 20];
    Laplacian::new(&neighbours, stiffness.clone()).solve(1.7, &pulled, &mut found);
    let mut laplacian = DMatrix::<f64>::identity(20, 20);
    for v in 0..20 {
        let near = neighbours.of(v);
        for n in near {
            laplacian[(v, *n as usize)] = -1.0 / f64::from(neighbours.count(v));
        }
        assert!(near.len() >= 2, "vertex {v} has {} neighbours", near.len());
    }
    let weights = DMatrix::from_diagonal(&DVector::from_vec(stiffness));
    let smooth = laplacian.transpose() * weights * laplacian * 1.7;
    let mut whole = DMatrix::<f64>::zeros(60, 60);
    let mut right = DVector::<f64>::zeros(60);
    for v in 0..20 {
        for axis in 0..3 {
            for n in 0..20 {
                whole[(3 * v + axis, 3 * n + axis)] += smooth[(v, n)];
            }
            whole[(3 * v + axis, 3 * v + axis)] += 0.002 + pulled[v].every_way;
            right[3 * v + axis] = pulled[v].towards[axis];
            for other in 0..3 {
                let normal = pulled[v].normal;
                whole[(3 * v + axis, 3 * v + other)] +=
                    pulled[v].along * normal[axis] * normal[other];
            }
        }
    }
    let exact = whole.lu().solve(&right).expect("not singular");
    for v in 0..20 {
        for axis in 0..3 {
            let (a, b) = (found[v][axis], exact[3 * v + axis]);
            assert!(
                (a - b).abs() < 1e-3,
                "vertex {v}, axis {axis}: {a} is not {b}"
            );
        }
    }
}
