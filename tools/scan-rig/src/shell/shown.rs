//! Which of the body's faces the scan shows as it stands: what is seen there is the person's look, however it came about. Gloss is made of
//! Gaussians far below the surface, so a line through the skin alone would find a hole.

use crate::bind::Bound;
use crate::body::BodyModel;
use crate::mesh_depth;
use crate::surface::{DepthView, around, raster};
use glam::DVec3;
use rayon::prelude::*;

/// Of the views around the person one in so many is looked at.
const STRIDE: usize = 2;

/// A view shows a face that turns to it at least so far: cosine of the angle.
const FACING: f64 = 0.3;

/// How far other faces may lie before the face, metres.
const BEFORE: f64 = 0.012;

/// How far before the face Gaussians may lie, metres: what lies farther is an arm's, or of what is held.
const OWN: f32 = 0.05;

/// How far behind the face they may lie, metres: gloss does, and what lies farther is the other side of the body, seen through a hole.
const GLOSS: f32 = 0.12;

/// `[N_f]` of the model's faces.
pub(crate) fn shown(bound: &Bound, model: &BodyModel) -> Vec<bool> {
    let (vertices, faces) = (&bound.mesh.vertices, &bound.mesh.faces);
    let middles: Vec<(DVec3, DVec3)> = (faces.iter().take(model.faces.len()))
        .map(|face| {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            ((a + b + c) / 3.0, (b - a).cross(c - a).normalize_or_zero())
        })
        .collect();
    let views = around(&bound.scan);
    let by_view: Vec<Vec<bool>> = (views.par_iter().step_by(STRIDE))
        .map(|view| {
            let mesh = mesh_depth::depths(vertices, faces, view);
            let scan = DepthView::new(*view, raster::draw(&bound.scan, view));
            let of = |(middle, normal): &(DVec3, DVec3)| {
                let facing = normal.dot((view.eye - *middle).normalize_or_zero());
                let Some((seen, own)) = scan.depth_at(*middle) else {
                    return false;
                };
                facing > FACING
                    && (own - OWN..own + GLOSS).contains(&seen)
                    && view
                        .pixel(*middle)
                        .is_some_and(|at| f64::from(own) < mesh[at] + BEFORE)
            };
            middles.iter().map(of).collect()
        })
        .collect();
    (0..middles.len())
        .map(|face| by_view.iter().any(|view| view[face]))
        .collect()
}
