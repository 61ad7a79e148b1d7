//! Where the 500 controllers sit: farthest-point sampling, denser at hands, face and loose cloth. The paper samples them
//! uniformly (section IV-B).

use crate::simulate::{Fabric, Puppet, arm_share};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::{BoundGaussians, Joint, NEIGHBOURS};

/// Extra distance between points of different surfaces, metres: a shirt and a jacket each get controllers of their own.
const APART: f32 = 0.03;

/// How many times nearer controllers are than on plain cloth.
fn density(puppet: &Puppet, vertex: usize) -> f32 {
    let skin = puppet.template.skin()[vertex].dense();
    let head: f32 = [Joint::Head, Joint::Jaw]
        .iter()
        .map(|j| skin[j.index()])
        .sum();
    let hand: f32 = skin[Joint::LeftIndex1.index()..].iter().sum::<f32>()
        + skin[Joint::LeftWrist.index()]
        + skin[Joint::RightWrist.index()];
    let fabric = match puppet.fabric[vertex] {
        Fabric::Face => 2.4,
        Fabric::Cloth => 1.2 + 0.4 * arm_share(&skin),
        Fabric::Skin => 1.1 + 0.9 * hand,
        Fabric::Rigid => 0.7,
    };
    let loose = if puppet.looseness[vertex] > 0.02 {
        0.3
    } else {
        0.0
    };
    fabric + loose + 0.2 * head
}

/// `count` vertices of the template, each on a triangle that carries Gaussians, as evenly spread as the density allows.
///
/// Starts from the densest vertex; ties go to the lower index, so the result depends on the arguments alone.
#[must_use]
pub fn scatter_controllers(puppet: &Puppet, gaussians: &BoundGaussians, count: usize) -> Vec<u32> {
    let points = puppet.template.vertices();
    let pieces = pieces(points.len(), puppet.template.faces());
    let mut used = vec![false; points.len()];
    gaussians
        .corners()
        .iter()
        .flatten()
        .for_each(|v| used[*v as usize] = true);
    let places: Vec<(u32, Vec3, u32, f32)> = (0u32..)
        .zip(points)
        .filter(|(v, _)| used[*v as usize])
        .map(|(v, p)| (v, *p, pieces[v as usize], density(puppet, v as usize)))
        .collect();
    let mut distance = vec![f32::INFINITY; places.len()];
    let mut chosen = Vec::with_capacity(count);
    let furthest = |distance: &[f32]| {
        (0..places.len()).max_by(|a, b| {
            let score = |k: usize| distance[k].min(10.0) * places[k].3;
            score(*a).total_cmp(&score(*b)).then(b.cmp(a))
        })
    };
    while chosen.len() < count.max(NEIGHBOURS) {
        let Some(next) = furthest(&distance) else {
            break;
        };
        let (vertex, at, piece, _) = places[next];
        chosen.push(vertex);
        distance
            .par_iter_mut()
            .zip(&places)
            .for_each(|(d, (_, p, other, _))| {
                let apart = p.distance(at) + if *other == piece { 0.0 } else { APART };
                *d = d.min(apart);
            });
        distance[next] = -1.0;
    }
    chosen
}

/// The smallest vertex of each vertex' connected piece of the mesh.
pub(crate) fn pieces(vertices: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..).take(vertices).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for [a, b, c] in faces {
        for (from, to) in [(a, b), (b, c)] {
            let (from, to) = (root(&mut parent, *from), root(&mut parent, *to));
            parent[from.max(to) as usize] = from.min(to);
        }
    }
    (0..).take(vertices).map(|v| root(&mut parent, v)).collect()
}
