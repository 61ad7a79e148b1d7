//! Where a body is when nothing is known of the frames beside it.

use super::super::bindings::{Binding, COUNT};
use super::super::chain::Posture;
use super::super::reading::{Exchange, UNSEEN};
use super::super::solver::SkeletonSolver;
use super::super::terms::View;
use super::super::triangulate::{LocatedBody, pixel};
use crate::landmarks::BodyLandmarks;
use crate::landmarks::blazepose::{EARS, HIPS, SHOULDERS};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

/// Distances from a camera at which a person may be, metres.
const DEPTHS: (f64, f64) = (0.5, 30.0);

/// The most likely pose, turned as the trunk is, and placed where landmarks are on average.
pub(super) fn by_several(
    solver: &SkeletonSolver,
    bindings: &[Binding; COUNT],
    located: &LocatedBody,
) -> Posture {
    let mut posture = solver.prior.posture();
    if let Some(turn) = turn_of_trunk(located) {
        posture.rotations[0] = turn;
    }
    let at = |landmark: usize| located[landmark].map(|located| located.place);
    // The mean of what is located goes to the mean of the same on the body.
    let placed = solver.chain().place(&posture);
    let (mut shift, mut count) = (Vector3::zeros(), 0.0);
    for binding in bindings {
        if let Some(place) = at(binding.landmark) {
            shift += place - placed.point(&binding.drawn);
            count += 1.0;
        }
    }
    if count > 0.0 {
        posture.position += shift / count;
    }
    posture
}

/// How the trunk is turned in the world; without hips, as shoulders and head are. `None` where that is not located.
pub(super) fn turn_of_trunk(located: &LocatedBody) -> Option<UnitQuaternion<f64>> {
    let at = |landmark: usize| located[landmark].map(|located| located.place);
    let middle = |pair: [usize; 2]| Some((at(pair[0])? + at(pair[1])?) / 2.0);
    let apart = |pair: [usize; 2]| Some(at(pair[0])? - at(pair[1])?);
    let (shoulders, width) = (middle(SHOULDERS)?, apart(SHOULDERS)?);
    let up = (middle(HIPS).map(|hips| shoulders - hips))
        .or_else(|| middle(EARS).map(|head| head - shoulders))?;
    turned(&(width + apart(HIPS).unwrap_or_default()), &up)
}

/// The most likely pose as one camera sees its trunk: parallel to the picture, facing the camera or away from it as left and right say, and as far away
/// as the trunk's length in the picture says. `None` where hips and shoulders are not seen.
pub(super) fn by_one(
    solver: &SkeletonSolver,
    bindings: &[Binding; COUNT],
    view: &View,
    seen: &BodyLandmarks,
    exchange: Exchange,
) -> Option<Posture> {
    let at = |landmark: usize| {
        let (pixel, confidence) = pixel(Some(seen), landmark, exchange);
        (confidence >= UNSEEN).then_some(pixel)
    };
    let middle = |pair: [usize; 2]| Some((at(pair[0])? + at(pair[1])?) / 2.0);
    let (hips, shoulders) = (middle(HIPS)?, middle(SHOULDERS)?);
    let trunk: Vector2<f64> = shoulders - hips;
    let across = at(SHOULDERS[0])? - at(SHOULDERS[1])? + at(HIPS[0])? - at(HIPS[1])?;
    let world_from_camera = view.camera_from_world.transpose();
    let in_world = |v: Vector2<f64>| world_from_camera * v.push(0.0);
    // Square to the trunk, so that one who leans is not twisted.
    let square = Vector2::new(-trunk.y, trunk.x);
    let side = if across.dot(&square) < 0.0 { -1.0 } else { 1.0 };
    let mut posture = solver.prior.posture();
    posture.rotations[0] = turned(&in_world(square * side), &in_world(trunk))?;
    let placed = solver.chain().place(&posture);
    let on_body = |pair: [usize; 2]| {
        let mut points = bindings.iter().filter(|b| pair.contains(&b.landmark));
        let (a, b) = (points.next()?, points.next()?);
        Some((placed.point(&a.drawn) + placed.point(&b.drawn)) / 2.0)
    };
    let (own_hips, own_shoulders) = (on_body(HIPS)?, on_body(SHOULDERS)?);
    let length = (own_shoulders - own_hips).norm();
    let depth = (view.focal * length / trunk.norm()).clamp(DEPTHS.0, DEPTHS.1);
    let sight = ((hips - view.centre) / view.focal).push(1.0) * depth;
    posture.position += world_from_camera * (sight - view.translation) - own_hips;
    posture.is_finite().then_some(posture)
}

/// The turn of a body whose left is `across` and whose head is `up`, both in the world, neither of a length; `None` where they have no angle.
fn turned(across: &Vector3<f64>, up: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let forward = across.cross(up).try_normalize(1e-6)?;
    let x = across.try_normalize(1e-6)?;
    let axes = Matrix3::from_columns(&[x, forward.cross(&x), forward]);
    Some(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(axes),
    ))
}
