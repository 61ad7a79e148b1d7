//! The terms that look at Gaussians, controllers and vertices: their values and their differences in f64.

use crate::people::{Person, TINY, random_numbers};
use avatar_gradient::loss::{Pairs, Share, Surface, guide, scale};
use glam::DVec3;
use splat_gradient::Attributes;
use synthetic_person::Random;

const STEP: f64 = 1e-6;

/// Central difference of `loss` by number `k`.
fn difference(numbers: &[f32], k: usize, loss: &dyn Fn(&[f64]) -> f64) -> f64 {
    let mut wide: Vec<f64> = numbers.iter().map(|x| f64::from(*x)).collect();
    let mut side = |step: f64| {
        wide[k] = f64::from(numbers[k]) + step;
        loss(&wide)
    };
    (side(STEP) - side(-STEP)) / (2.0 * STEP)
}

/// Tries `tried` numbers: derivatives must be the differences, to `most` of the greatest.
fn assert_derivatives(
    got: &[f32],
    numbers: &[f32],
    tried: &[usize],
    most: f64,
    loss: &dyn Fn(&[f64]) -> f64,
) {
    let greatest = got.iter().fold(0.0f32, |most, x| most.max(x.abs()));
    assert!(greatest > 0.0, "a derivative");
    for k in tried {
        let expected = difference(numbers, *k, loss);
        let error = (f64::from(got[*k]) - expected).abs();
        assert!(
            error < most * f64::from(greatest),
            "number {k}: {}, {expected} expected, of {greatest}",
            got[*k]
        );
    }
}

fn some(count: usize, of: usize) -> Vec<usize> {
    let mut random = Random::new(6);
    (0..count).map(|_| random.below(of)).collect()
}

#[test]
fn guide_over_all_pairs_is_the_papers_sum() {
    let person = Person::new(TINY);
    let count = TINY.controllers;
    let offsets = random_numbers(3 * count, &mut Random::new(1));
    let pairs = Pairs::all(&person.puppet.controllers);
    assert_eq!(
        pairs.pairs().len(),
        count * (count - 1) / 2,
        "each pair once"
    );
    let brute = |offsets: &[f64]| {
        let mut sum = 0.0;
        for j in 0..count {
            for k in (0..count).filter(|k| *k != j) {
                for axis in 0..3 {
                    sum += (offsets[3 * j + axis] - offsets[3 * k + axis]).powi(2);
                }
            }
        }
        0.7 * sum
    };
    let mut by = vec![0.0; 3 * count];
    let loss = guide(&offsets, &pairs, 0.7, &mut by).expect("as many");
    let wide: Vec<f64> = offsets.iter().map(|x| f64::from(*x)).collect();
    assert!(
        (loss / brute(&wide) - 1.0).abs() < 1e-6,
        "{loss}, {}",
        brute(&wide)
    );
    let all: Vec<usize> = (0..3 * count).collect();
    assert_derivatives(&by, &offsets, &all, 1e-5, &brute);
}

#[test]
fn neighbours_are_controllers_that_hold_a_gaussian_together() {
    let person = Person::new(TINY);
    let controllers = &person.puppet.controllers;
    let pairs = Pairs::neighbouring(controllers);
    let together = |a: u16, b: u16| {
        let holds = controllers.neighbours().iter().zip(controllers.masses());
        holds.into_iter().any(|(held, masses)| {
            let has = |c: u16| (0..3).any(|k| held[k] == c && masses[k] > 0.0);
            has(a) && has(b)
        })
    };
    for [a, b] in Pairs::all(controllers).pairs() {
        assert_eq!(
            pairs.pairs().contains(&[*a, *b]),
            together(*a, *b),
            "{a}, {b}"
        );
    }
    assert!(
        pairs.pairs().len() < TINY.controllers * (TINY.controllers - 1) / 2,
        "not all"
    );
}

#[test]
fn only_scales_beyond_the_threshold_cost() {
    let count = 40;
    let mut gaussians = Attributes::zeros(count);
    let mut random = Random::new(2);
    for plane in 7..10 {
        for number in gaussians.plane_mut(plane) {
            *number = -4.0 + 1.5 * random.signed();
        }
    }
    let threshold = 0.03;
    let reference = |numbers: &[f64]| {
        let length = |i: usize| {
            let squares = (7..10).map(|plane| (2.0 * numbers[plane * count + i]).exp());
            squares.sum::<f64>().sqrt()
        };
        let more = (0..count).map(|i| (length(i) - f64::from(threshold)).max(0.0));
        3.0 * more.sum::<f64>()
    };
    let mut by = Attributes::zeros(count);
    let loss = scale(&gaussians, threshold, 3.0, &mut by).expect("as many");
    let wide: Vec<f64> = gaussians.numbers().iter().map(|x| f64::from(*x)).collect();
    assert!(
        (loss / reference(&wide) - 1.0).abs() < 1e-6,
        "{loss}, {}",
        reference(&wide)
    );
    let small = (0..count).filter(|i| by.plane(7)[*i] == 0.0).count();
    assert!((1..count).contains(&small), "{small} cost nothing");
    let tried: Vec<usize> = (0..14 * count).collect();
    assert_derivatives(by.numbers(), gaussians.numbers(), &tried, 1e-5, &reference);
}

/// The squared distance to a triangle: the least of inside, sides and corners, in f64.
fn square_distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let side = |a: DVec3, b: DVec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        (a + (b - a) * t - p).length_squared()
    };
    let normal = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|(from, to)| (*to - *from).cross(p - *from).dot(normal) >= 0.0);
    let plane = (p - a).dot(normal).powi(2) / normal.length_squared();
    let sides = side(a, b).min(side(b, c)).min(side(c, a));
    if inside { plane } else { sides }
}

#[test]
fn binding_measures_the_distance_to_the_triangles_around() {
    let person = Person::new(TINY);
    let puppet = &person.puppet;
    let posed = person.posed(&Random::new(3).motion(0.3));
    let (count, n) = (puppet.template.vertices().len(), TINY.gaussians);
    let mut gaussians = posed.gaussians().clone();
    let mut random = Random::new(8);
    for plane in 0..3 {
        for number in gaussians.plane_mut(plane) {
            *number += 0.01 * random.signed();
        }
    }
    let faces = puppet.template.faces();
    let around = |own: u32| {
        let corners = faces[own as usize];
        let shares = move |face: &&[u32; 3]| face.iter().any(|v| corners.contains(v));
        faces.iter().filter(shares).copied().collect::<Vec<_>>()
    };
    let near: Vec<Vec<[u32; 3]>> = puppet
        .gaussians
        .triangles()
        .iter()
        .map(|t| around(*t))
        .collect();
    // Places, then vertices.
    let mut numbers = gaussians.numbers()[..3 * n].to_vec();
    numbers.extend(posed.vertices());
    let distance = |numbers: &[f64], i: usize, faces: &[[u32; 3]]| {
        let point = |from: usize, count: usize, k: usize| {
            DVec3::from_array([0, 1, 2].map(|axis| numbers[from + axis * count + k]))
        };
        let place = point(0, n, i);
        let all = faces
            .iter()
            .map(|face| square_distance(place, face.map(|v| point(3 * n, count, v as usize))));
        all.fold(f64::INFINITY, f64::min)
    };
    let reference =
        |numbers: &[f64]| 2.0 * (0..n).map(|i| distance(numbers, i, &near[i])).sum::<f64>();
    let mut surface = Surface::new(&puppet.template, &puppet.gaussians).expect("bound");
    let mut by = Attributes::zeros(n);
    let mut by_vertices = vec![0.0; 3 * count];
    let loss = surface
        .bind(
            (&gaussians, posed.vertices()),
            Share::ALL,
            2.0,
            &mut by,
            &mut by_vertices,
        )
        .expect("as many");
    let wide: Vec<f64> = numbers.iter().map(|x| f64::from(*x)).collect();
    let expected = reference(&wide);
    assert!((loss / expected - 1.0).abs() < 1e-3, "{loss}, {expected}");
    let mut got = by.numbers()[..3 * n].to_vec();
    got.extend(&by_vertices);
    let tried: Vec<usize> = some(60, 3 * n)
        .into_iter()
        .chain(
            puppet.gaussians.corners()[..20]
                .iter()
                .map(|c| 3 * n + c[0] as usize),
        )
        .collect();
    assert_derivatives(&got, &numbers, &tried, 1e-2, &reference);
}

#[test]
fn the_shares_of_steps_that_follow_each_other_make_up_the_whole_binding_term() {
    let person = Person::new(TINY);
    let posed = person.posed(&Random::new(3).motion(0.3));
    let shown = (posed.gaussians(), posed.vertices());
    let puppet = &person.puppet;
    let mut surface = Surface::new(&puppet.template, &puppet.gaussians).expect("bound");
    let zeros = || (Attributes::zeros(TINY.gaussians), vec![0.0; shown.1.len()]);
    let ((mut by, mut by_vertices), (mut parts, mut parts_by_vertices)) = (zeros(), zeros());
    let whole = surface
        .bind(shown, Share::ALL, 3.0, &mut by, &mut by_vertices)
        .expect("as many");
    let steps = 40..47;
    let sum: f64 = steps
        .map(|step| {
            let share = Share::of_step(step, 7);
            let (by, by_vertices) = (&mut parts, &mut parts_by_vertices);
            let part = surface.bind(shown, share, 3.0, by, by_vertices);
            part.expect("as many")
        })
        .sum();
    assert!((sum / whole - 1.0).abs() < 1e-9, "{sum}, {whole}");
    assert_eq!(parts.numbers(), by.numbers(), "each Gaussian once");
    let most = by_vertices.iter().fold(0.0f32, |most, x| most.max(x.abs()));
    for (part, whole) in parts_by_vertices.iter().zip(&by_vertices) {
        assert!((part - whole).abs() < 1e-5 * most, "{part}, {whole}");
    }
}
