//! Where the controllers sit on a scanned person, and the Gaussians in the order of their controllers.

use super::gaussians::reordered;
use crate::RigError;
use glam::Vec3;
use rayon::prelude::*;
use spmm3::{BoundGaussians, Controllers, EdgeGraph, Joint, NEIGHBOURS, Template};

/// How many controllers there are. The light that they carry changes over a hand's breadth.
const CONTROLLERS: usize = 160;

/// Gaussians and the controllers that move them.
pub(super) struct Tied {
    pub(super) gaussians: BoundGaussians,
    pub(super) controllers: Controllers,
}

/// Spreads controllers over the template, and sorts the Gaussians so that each controller's lie together: the deform graph
/// then gathers from neighbouring memory.
pub(super) fn tie(template: &Template, bound: &BoundGaussians) -> Result<Tied, RigError> {
    let vertices = spread(template, bound);
    let graph = EdgeGraph::new(template, &[]);
    let tied = Controllers::tie(template, &graph, bound, vertices)?;
    let mut order: Vec<usize> = (0..bound.len()).collect();
    order.sort_by_key(|i| (tied.neighbours()[*i], bound.triangles()[*i]));
    let gaussians = reordered(template, bound, &order)?;
    let controllers = Controllers::new(
        template,
        tied.vertices().to_vec(),
        order.iter().map(|i| tied.neighbours()[*i]).collect(),
        order.iter().map(|i| tied.masses()[*i]).collect(),
    )?;
    Ok(Tied {
        gaussians,
        controllers,
    })
}

/// Vertices that carry Gaussians, as evenly spread as can be (farthest-point sampling), the head and the hands thinner: their
/// light hardly changes with the pose.
fn spread(template: &Template, bound: &BoundGaussians) -> Vec<u32> {
    let mut used = vec![false; template.vertices().len()];
    for corner in bound.corners().iter().flatten() {
        if let Some(slot) = used.get_mut(*corner as usize) {
            *slot = true;
        }
    }
    let places: Vec<(u32, Vec3, f32)> = (0u32..)
        .zip(template.vertices())
        .zip(template.skin())
        .zip(&used)
        .filter(|(_, used)| **used)
        .map(|(((v, at), skin), _)| {
            let dense = skin.dense();
            let hand: f32 = dense.iter().skip(Joint::LeftIndex1.index()).sum();
            let head = dense[Joint::Head.index()] + dense[Joint::Jaw.index()];
            (v, *at, 1.0 - 0.5 * (hand + head).min(1.0))
        })
        .collect();
    let mut distance = vec![f32::INFINITY; places.len()];
    let mut chosen = Vec::with_capacity(CONTROLLERS);
    while chosen.len() < CONTROLLERS.max(NEIGHBOURS) {
        let score = |k: usize| distance[k].min(10.0) * places[k].2;
        let furthest =
            (0..places.len()).max_by(|a, b| score(*a).total_cmp(&score(*b)).then(b.cmp(a)));
        let Some(next) = furthest else { break };
        let (vertex, at, _) = places[next];
        chosen.push(vertex);
        distance
            .par_iter_mut()
            .zip(&places)
            .for_each(|(d, (_, p, _))| *d = d.min(p.distance(at)));
        distance[next] = -1.0;
    }
    // A template that carries fewer than three corners of Gaussians.
    let mut more = 0;
    while chosen.len() < NEIGHBOURS {
        chosen.push(more);
        more += 1;
    }
    chosen
}
