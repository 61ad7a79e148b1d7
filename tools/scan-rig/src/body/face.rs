//! The face's landmarks on the model: which vertex each is, and which of them were seen well.

use super::alignment::Alignment;
use super::face_vertices::FACE_VERTICES;
use super::model::BodyModel;
use crate::median::median;
use crate::points::KeyPoint;
use glam::{DAffine3, DVec3};
use motion_fit::landmarks::FACE_LANDMARKS;

/// A landmark whose rays miss one another by more is left out, metres.
const MISS: f64 = 0.003;

/// Landmarks with fewer views are left out.
const SUPPORT: f64 = 2.0;

/// Fewer landmarks are no face.
const FEWEST: usize = 60;

/// Landmarks farther from the face as a whole than this many times their median are left out.
const OUTLYING: f64 = 4.0;

/// A landmark of the face on the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OnFace {
    pub(super) vertex: usize,
    /// Where the landmark is from the vertex in the model's rest pose, metres.
    pub(super) offset: DVec3,
    /// Where it was seen, metres.
    pub(super) place: DVec3,
}

impl OnFace {
    /// Where the vertex should be if `head` carries the head's flesh from rest, metres.
    pub(super) fn wanted(&self, head: &DAffine3) -> DVec3 {
        self.place - head.transform_vector3(self.offset)
    }
}

/// The landmarks of the face that were seen well; none where those are too few.
pub(super) fn landmarks(
    model: &BodyModel,
    face: Option<&[KeyPoint; FACE_LANDMARKS]>,
) -> Vec<OnFace> {
    let Some(face) = face else { return Vec::new() };
    let seen: Vec<OnFace> = (FACE_VERTICES.iter().zip(face))
        .filter_map(|(on_model, point)| {
            let (vertex, offset) = (*on_model)?;
            let good = usize::from(vertex) < model.body_vertices
                && point.position.is_finite()
                && point.residual < MISS
                && point.support >= SUPPORT;
            good.then(|| OnFace {
                vertex: usize::from(vertex),
                offset: DVec3::from_array(offset.map(f64::from)) * 1e-5,
                place: point.position,
            })
        })
        .collect();
    let moved: Vec<(DVec3, DVec3)> = (seen.iter())
        .map(|on| (model.rest[on.vertex] + on.offset, on.place))
        .collect();
    let whole = Alignment::between(&moved, (0.3, 3.0));
    let misses: Vec<f64> = (moved.iter())
        .map(|(from, to)| whole.apply(*from).distance(*to))
        .collect();
    let limit = OUTLYING * median(misses.iter().copied()).unwrap_or(f64::INFINITY);
    let kept: Vec<OnFace> = (seen.into_iter().zip(misses))
        .filter(|(_, miss)| *miss <= limit)
        .map(|(on, _)| on)
        .collect();
    if kept.len() < FEWEST {
        Vec::new()
    } else {
        kept
    }
}

/// Median distance of the landmarks from their vertices, metres; none without landmarks.
pub(super) fn error(landmarks: &[OnFace], head: &DAffine3, vertices: &[DVec3]) -> Option<f64> {
    median((landmarks.iter()).map(|on| vertices[on.vertex].distance(on.wanted(head))))
}
