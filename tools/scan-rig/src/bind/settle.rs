//! What is bound is tried in other poses: what would stand off the body there is split, or left out.

use super::ground::Ground;
use super::triangles::Faces;
use super::{Bound, GROWTH, carried, growth, is_outer, samples, split};
use crate::RigError;
use crate::body::{BodyModel, Registered};
use glam::Vec3;

/// Gaussians shorter than this (standard deviation) are not split where the body bends, metres.
const SHORT: f32 = 0.008;
/// How much farther from the body the end of a Gaussian may be in another pose before it is split, metres.
const STANDS_OFF: f32 = 0.01;
/// How much farther from the body a Gaussian may be in another pose, metres: one that shows little in the scan, and any other. Its ends
/// may be twice as much farther.
const LEAVES: (f32, f32) = (0.005, 0.01);
/// Only a part of a split Gaussian that is nearer to another triangle than this moves to it, metres.
const REBOUND: f32 = 0.015;
/// A Gaussian whose largest blending weight is less shows little.
const LITTLE: f32 = 0.1;

/// Splits what would stand off the body in any of the sample poses, and leaves out what still does; what is worn stays. `peak` is how much
/// each Gaussian shows.
pub(super) fn settle(
    bound: &mut Bound,
    mut peak: Vec<f32>,
    model: &BodyModel,
    registered: &Registered,
    faces: &Faces,
    ground: &Ground<'_>,
) -> Result<(), RigError> {
    let rest = bound.rest(model, registered)?;
    let poses: Vec<Vec<Vec3>> = samples::samples()
        .iter()
        .map(|motion| rest.posed(&bound.mesh.weights, motion))
        .collect();
    let here = bound.vertices();
    let seen: Vec<[u32; 3]> = (0..model.faces.len())
        .filter(|face| is_outer(model, *face))
        .map(|face| model.faces[face])
        .collect();
    let growth = |bound: &Bound| {
        growth::growth(
            &bound.scan,
            &bound.carried(),
            &bound.triangles,
            &bound.mesh.faces,
            &seen,
            &here,
            &poses,
        )
    };
    let mut found = growth(bound);
    let before = bound.scan.len();
    let whole: Vec<bool> = (0..before)
        .map(|at| {
            let long = bound.scan.scales[at].max_element() > SHORT;
            !(bound.accessory[at] == 0 && long && found[at].ends > STANDS_OFF)
        })
        .collect();
    let mut of: Vec<(u32, u8, f32)> = (0..before)
        .map(|at| (bound.triangles[at], bound.accessory[at], peak[at]))
        .collect();
    let parts = split::split_where(
        &mut bound.scan,
        &mut of,
        bound.report.given * GROWTH,
        |_, at| !whole[at],
    );
    if parts > 0 {
        bound.triangles = of.iter().map(|of| of.0).collect();
        bound.accessory = of.iter().map(|of| of.1).collect();
        peak = of.iter().map(|of| of.2).collect();
        let is_part = |at: usize| at >= before || !whole[at];
        for at in (0..bound.scan.len()).filter(|at| is_part(*at)) {
            let position = bound.scan.positions[at];
            let near = |face: u32| {
                let corners = model.faces[face as usize].map(|v| here[v as usize]);
                carried::nearest_point(position, corners).distance(position) < REBOUND
            };
            let normal = ground.place(position).normal;
            if let Some(face) = faces.nearest(position, normal).filter(|face| near(*face)) {
                bound.triangles[at] = face;
            }
        }
        found = growth(bound);
    }
    bound.report.split += bound.scan.len() - before;
    let stays: Vec<bool> = (0..bound.scan.len())
        .map(|at| {
            let most = if peak[at] < LITTLE {
                LEAVES.0
            } else {
                LEAVES.1
            };
            bound.accessory[at] != 0 || (found[at].centre <= most && found[at].ends <= most * 2.0)
        })
        .collect();
    bound.report.leaving = stays.iter().filter(|stays| !**stays).count();
    bound.retain(&stays);
    Ok(())
}
