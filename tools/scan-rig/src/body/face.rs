//! The face's landmarks on the model: which vertex each is, the head's turn, and the pairs for the displacement.

use super::face_vertices::FACE_VERTICES;
use super::follow::Similarity;
use super::model::BodyModel;
use super::state::{Posed, State};
use crate::points::KeyPoint;
use glam::DVec3;
use motion_fit::landmarks::FACE_LANDMARKS;
use spmm3::Joint;

/// A landmark whose rays miss one another by more is left out, metres.
const MISS: f64 = 0.003;

/// Landmarks with fewer views are left out.
const SUPPORT: f64 = 2.0;

/// Fewer landmarks are no face.
const FEWEST: usize = 60;

/// Landmarks farther from the face as a whole than this many times their median are left out.
const OUTLYING: f64 = 4.0;

/// Pairs of a vertex and where the face's landmark on it is, metres; empty where too few were seen well.
pub(super) fn pairs(
    model: &BodyModel,
    face: Option<&[KeyPoint; FACE_LANDMARKS]>,
) -> Vec<(usize, DVec3)> {
    let Some(face) = face else { return Vec::new() };
    let pairs: Vec<(usize, DVec3)> = (FACE_VERTICES.iter().zip(face))
        .filter(|(vertex, point)| {
            **vertex != u16::MAX
                && usize::from(**vertex) < model.body_vertices
                && point.position.is_finite()
                && point.residual < MISS
                && point.support >= SUPPORT
        })
        .map(|(vertex, point)| (usize::from(*vertex), point.position))
        .collect();
    let moved: Vec<(DVec3, DVec3)> = (pairs.iter())
        .map(|(vertex, place)| (model.rest[*vertex], *place))
        .collect();
    let whole = Similarity::between(&moved, (0.3, 3.0));
    let misses: Vec<f64> = (moved.iter())
        .map(|(from, to)| whole.apply(*from).distance(*to))
        .collect();
    let limit = OUTLYING * median(misses.clone());
    let kept: Vec<(usize, DVec3)> = (pairs.into_iter().zip(misses))
        .filter(|(_, miss)| *miss <= limit)
        .map(|(pair, _)| pair)
        .collect();
    if kept.len() < FEWEST { Vec::new() } else { kept }
}

/// Turns the head so that the face's vertices lie as the landmarks do.
pub(super) fn turn_head(pairs: &[(usize, DVec3)], state: &mut State, posed: &Posed) {
    let moved: Vec<(DVec3, DVec3)> = (pairs.iter())
        .map(|(vertex, place)| (posed.vertices[*vertex], *place))
        .collect();
    if moved.len() >= FEWEST {
        state.turn(Joint::Head, Similarity::between(&moved, (1.0, 1.0)).rotation);
    }
}

/// Median distance of the landmarks from their vertices, metres; none without landmarks.
pub(super) fn error(pairs: &[(usize, DVec3)], vertices: &[DVec3]) -> Option<f64> {
    let misses: Vec<f64> = (pairs.iter())
        .map(|(vertex, place)| vertices[*vertex].distance(*place))
        .collect();
    (!misses.is_empty()).then(|| median(misses))
}

/// The middle value; infinite of none.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::INFINITY)
}
