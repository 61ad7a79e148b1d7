//! Which controllers move which Gaussian, and the Gaussians' order.

use super::{BakeOptions, Subject};
use crate::fit::scatter_controllers;
use glam::Vec3;
use spmm3::{ATTRIBUTES, BoundGaussians, Controllers, EdgeGraph, PersonError};

/// Scatters the controllers, assigns the Gaussians to them, and sorts the Gaussians so that each controller's lie together:
/// the deform graph then gathers from neighbouring memory.
pub(super) fn sorted_by_controller(
    options: &BakeOptions,
    subject: &Subject<'_>,
) -> Result<(BoundGaussians, Vec<Vec3>, Controllers), PersonError> {
    let template = &subject.puppet.template;
    let bound = &subject.gaussians;
    let vertices = scatter_controllers(&subject.puppet, bound, options.controllers);
    let graph = EdgeGraph::new(template, &subject.bridges);
    let tied = Controllers::tie(template, &graph, bound, vertices)?;
    let mut order: Vec<usize> = (0..bound.len()).collect();
    order.sort_by_key(|i| (tied.neighbours()[*i], bound.triangles()[*i]));
    let pick = |plane: usize| {
        order
            .iter()
            .map(move |i| bound.attributes()[plane * bound.len() + i])
    };
    let attributes = (0..ATTRIBUTES).flat_map(pick).collect();
    let gaussians = BoundGaussians::new(
        template,
        order.iter().map(|i| bound.triangles()[*i]).collect(),
        order.iter().map(|i| bound.barycentrics()[*i]).collect(),
        attributes,
    )?;
    let controllers = Controllers::new(
        template,
        tied.vertices().to_vec(),
        order.iter().map(|i| tied.neighbours()[*i]).collect(),
        order.iter().map(|i| tied.masses()[*i]).collect(),
    )?;
    Ok((
        gaussians,
        order.iter().map(|i| subject.albedo[*i]).collect(),
        controllers,
    ))
}
