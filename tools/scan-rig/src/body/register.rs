//! The whole registration: fit, face, surface.

use super::confidence::confidence;
use super::face::{error, landmarks};
use super::fit::fit;
use super::follow::follow;
use super::landmarks::Targets;
use super::model::BodyModel;
use super::nonrigid::displaced;
use super::{Hint, Registered};
use crate::RigError;
use crate::points::KeyPoint;
use glam::{DVec3, Vec3};
use motion_fit::landmarks::{BODY_LANDMARKS, FACE_LANDMARKS};
use spmm3::Joint;

/// What was seen of a person, in the person's space.
#[derive(Debug, Clone, Copy)]
pub struct Observed<'a> {
    /// BlazePose's landmarks.
    pub body: &'a [KeyPoint; BODY_LANDMARKS],
    /// The face mesh's landmarks, where a face was seen.
    pub face: Option<&'a [KeyPoint; FACE_LANDMARKS]>,
    /// Points of the outer surface, metres.
    pub points: &'a [Vec3],
    /// Their unit outward normals.
    pub normals: &'a [Vec3],
    /// Joints that the user placed.
    pub hints: &'a [Hint],
}

/// How well the model fits.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitReport {
    /// Root mean square distance of the surface from the posed and shaped model, metres.
    pub surface: f64,
    /// Root mean square miss of the body's landmarks, metres.
    pub key_points: f64,
    /// How thick the clothes were found to be, metres.
    pub cloth: f64,
    /// Median distance of the displaced model from the surface, metres.
    pub displaced: f64,
    /// Median distance of the face's landmarks from their vertices, metres; none without a face.
    pub face: Option<f64>,
    /// What the user should look at, in words.
    pub warnings: Vec<String>,
}

/// Points of the surface that the fit uses at most.
const POINTS: usize = 12_000;

/// Registers the model to what was seen of a person.
///
/// # Errors
/// If the landmarks of shoulders and hips are missing: nothing says where the person is.
pub fn register(
    model: &BodyModel,
    seen: &Observed<'_>,
) -> Result<(Registered, FitReport), RigError> {
    let hips = [seen.body[23], seen.body[24]];
    let known = |point: &KeyPoint| point.support > 0.0 && point.position.is_finite();
    if !hips.iter().all(known) || ![11, 12].iter().all(|k| known(&seen.body[*k])) {
        return Err(RigError::unsuited(
            "shoulders and hips were not found in the scan: is it a whole person, upright and alone? Cut away what surrounds the person, or say which \
             axis points up",
        ));
    }
    let start = (hips[0].position + hips[1].position) / 2.0;
    let mut surface: Vec<(Vec3, Vec3)> = (seen.points.iter().zip(seen.normals))
        .filter(|(point, normal)| point.is_finite() && normal.is_finite())
        .map(|(point, normal)| (*point, *normal))
        .collect();
    // Any order will do, so long as it is the same each time and a part of it is spread over the body.
    fastrand::Rng::with_seed(1).shuffle(&mut surface);
    let face = landmarks(model, seen.face);
    let targets = Targets::new(model, seen.body, &face, seen.hints);
    let clock = std::time::Instant::now();
    let fitted = fit(
        model,
        &targets,
        &surface[..surface.len().min(POINTS)],
        start,
    );
    log::debug!("fit {:.2} s", clock.elapsed().as_secs_f64());
    let clock = std::time::Instant::now();
    let head = &fitted.posed.maps[Joint::Head.index()];
    let wanted: Vec<(usize, DVec3)> = face.iter().map(|on| (on.vertex, on.wanted(head))).collect();
    let displaced = displaced(model, &fitted.posed.vertices, &surface, &wanted);
    log::debug!("displaced {:.2} s", clock.elapsed().as_secs_f64());
    let mut vertices: Vec<DVec3> = fitted.posed.vertices.clone();
    vertices[..model.body_vertices].copy_from_slice(&displaced.vertices);
    follow(model, &fitted.posed.vertices, &mut vertices);
    let (confidence, warnings) = confidence(model, seen.body, &targets, &fitted, &displaced);
    let report = FitReport {
        surface: fitted.residual,
        key_points: fitted.key_points,
        cloth: fitted.state.cloth,
        displaced: displaced.residual,
        face: error(&face, head, &vertices),
        warnings,
    };
    Ok((
        Registered {
            shape: fitted.state.shape,
            rotations: fitted.state.rotations,
            scale: fitted.state.scale,
            joints: fitted.posed.joints,
            vertices,
            confidence,
        },
        report,
    ))
}
