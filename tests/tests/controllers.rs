//! Virtual masses against the paper's equation, recomputed in f64.

use std::collections::HashMap;
use synthetic_person::reference::{V3, add, norm, scale, sub, wide};
use synthetic_person::{Puppet, PuppetSize, Random};

/// The paper's eps, metres.
const EPSILON: f64 = 1e-3;

/// All-pairs walking distance from `source` over edges and across adjacent triangles, by relaxation until nothing
/// changes: slower than any queue and too simple to be wrong.
fn walk(points: &[V3], edges: &[(u32, u32, f64)], source: u32) -> Vec<f64> {
    let mut distance = vec![f64::INFINITY; points.len()];
    distance[source as usize] = 0.0;
    loop {
        let mut changed = false;
        for (a, b, length) in edges {
            for (from, to) in [(*a as usize, *b as usize), (*b as usize, *a as usize)] {
                if distance[from] + length < distance[to] {
                    distance[to] = distance[from] + length;
                    changed = true;
                }
            }
        }
        if !changed {
            return distance;
        }
    }
}

/// Mesh edges, the diagonals across every pair of triangles that share an edge, and the bridges.
fn edges(puppet: &Puppet, points: &[V3]) -> Vec<(u32, u32, f64)> {
    let mut across: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
    for [a, b, c] in puppet.template.faces() {
        for (p, q, other) in [(a, b, c), (b, c, a), (c, a, b)] {
            across
                .entry([*p.min(q), *p.max(q)])
                .or_default()
                .push(*other);
        }
    }
    let mut pairs: Vec<(u32, u32)> = puppet.bridges.clone();
    for ([a, b], others) in &across {
        pairs.push((*a, *b));
        assert!(others.len() <= 2, "the puppet's tubes are manifold");
        if let [c, d] = others[..] {
            pairs.push((c, d));
        }
    }
    let length = |a: u32, b: u32| norm(sub(points[a as usize], points[b as usize]));
    pairs
        .into_iter()
        .map(|(a, b)| (a, b, length(a, b)))
        .collect()
}

fn dense_weights(puppet: &Puppet, vertex: u32) -> [f64; 55] {
    let skin = puppet.template.skin()[vertex as usize];
    let mut dense = [0.0; 55];
    for (joint, weight) in skin.joints.iter().zip(skin.weights) {
        dense[usize::from(*joint)] += f64::from(weight);
    }
    dense
}

fn similarity(a: &[f64; 55], b: &[f64; 55]) -> f64 {
    let product = |x: &[f64; 55], y: &[f64; 55]| x.iter().zip(y).map(|(p, q)| p * q).sum::<f64>();
    product(a, b) / (product(a, a) * product(b, b)).sqrt()
}

/// Recomputes the masses of `cases` Gaussians; gives how many have no controller that shares a joint.
fn check_masses(puppet: &Puppet, cases: usize) -> usize {
    let points: Vec<V3> = (puppet.template.vertices().iter())
        .map(|v| wide(*v))
        .collect();
    let edges = edges(puppet, &points);
    let seats = puppet.controllers.vertices();
    let distances: Vec<Vec<f64>> = seats.iter().map(|s| walk(&points, &edges, *s)).collect();
    let seat_weights: Vec<[f64; 55]> = seats.iter().map(|s| dense_weights(puppet, *s)).collect();
    let mut random = Random::new(5);
    let mut alone = 0;
    for _ in 0..cases {
        let i = random.below(puppet.gaussians.len());
        let corners = puppet.gaussians.corners()[i];
        let [v, w] = puppet.gaussians.barycentrics()[i].map(f64::from);
        let shares = [1.0 - v - w, v, w];
        let mut anchor = [0.0; 3];
        let mut weights = [0.0; 55];
        for (corner, share) in corners.iter().zip(shares) {
            anchor = add(anchor, scale(points[*corner as usize], share));
            for (sum, weight) in weights.iter_mut().zip(dense_weights(puppet, *corner)) {
                *sum += share * weight;
            }
        }
        let nearness = |controller: usize| {
            let to = |corner: &u32| {
                let last = norm(sub(points[*corner as usize], anchor));
                distances[controller][*corner as usize] + last
            };
            let distance = corners.iter().map(to).fold(f64::INFINITY, f64::min);
            1.0 / (distance + EPSILON)
        };
        let force = |controller: usize| {
            similarity(&weights, &seat_weights[controller]) * nearness(controller)
        };
        let kept = puppet.controllers.neighbours()[i].map(usize::from);
        // Where nothing near shares a joint, the nearest controllers hold the Gaussian.
        let lonely = kept.iter().all(|c| force(*c) == 0.0);
        alone += usize::from(lonely);
        let pull = |controller: usize| {
            if lonely {
                nearness(controller)
            } else {
                force(controller)
            }
        };
        let forces = kept.map(pull);
        let total: f64 = forces.iter().sum();
        for (mass, force) in puppet.controllers.masses()[i].iter().zip(forces) {
            assert!(
                (f64::from(*mass) - force / total).abs() < 1e-4,
                "Gaussian {i}: mass {mass} is not {}",
                force / total
            );
        }
        let weakest = forces.iter().copied().fold(f64::INFINITY, f64::min);
        for other in (0..seats.len()).filter(|c| !kept.contains(c)) {
            assert!(
                pull(other) <= weakest + 1e-4 * total,
                "Gaussian {i} passed over controller {other}, which pulls {} beside {forces:?}",
                pull(other)
            );
        }
    }
    alone
}

#[test]
fn virtual_masses_are_skinning_similarity_over_geodesic_distance() {
    let many = PuppetSize {
        controllers: 120,
        ..PuppetSize::SMALL
    };
    let alone = check_masses(&Puppet::new(many), 500);
    assert!(
        alone < 50,
        "{alone} of 500 Gaussians share no joint with a controller"
    );
}

#[test]
fn gaussians_far_from_any_similar_controller_follow_the_nearest() {
    // 16 controllers leave some fingers without one.
    let alone = check_masses(&Puppet::small(), 1000);
    assert!(
        alone > 0,
        "the puppet has no such Gaussian: the test proves nothing"
    );
}

#[test]
fn masses_sum_to_one_and_name_three_different_controllers() {
    let puppet = Puppet::small();
    for (masses, named) in puppet
        .controllers
        .masses()
        .iter()
        .zip(puppet.controllers.neighbours())
    {
        let sum: f32 = masses.iter().sum();
        assert!((sum - 1.0).abs() < 1e-6, "masses {masses:?}");
        let [a, b, c] = named;
        assert!(a != b && b != c && a != c, "controllers {named:?}");
    }
}
