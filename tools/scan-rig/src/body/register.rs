//! The whole registration: fit, face, surface.

use super::confidence::{Heeded, confidence};
use super::face::{error, landmarks};
use super::fit::fit;
use super::follow::follow;
use super::landmarks::Targets;
use super::model::BodyModel;
use super::nonrigid::displaced;
use super::{Hint, Registered};
use crate::RigError;
use crate::points::KeyPoint;
use crate::prepare::landmarks::{HIPS, SHOULDERS};
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
    /// What the user's hints did.
    pub hints: Vec<Heeded>,
    /// What the user should look at, in words.
    pub warnings: Vec<String>,
}

/// Points of the surface that the fit uses at most.
const POINTS: usize = 12_000;

/// Registers the model to what was seen of a person.
///
/// # Errors
/// If shoulders and hips have neither landmarks nor hints: nothing says where the person is.
pub fn register(
    model: &BodyModel,
    seen: &Observed<'_>,
) -> Result<(Registered, FitReport), RigError> {
    let (mut registered, mut report) = registered(model, seen)?;
    if seen.hints.is_empty() {
        return Ok((registered, report));
    }
    let without = Observed {
        hints: &[],
        ..*seen
    };
    let without = self::registered(model, &without).ok();
    for hint in seen.hints {
        let at = hint.joint.index();
        let found = without.as_ref().map(|(found, _)| found);
        let heeded = Heeded {
            joint: hint.joint,
            apart: found.map(|found| found.joints[at].distance(hint.position)),
            sure_without: found.map_or(0.0, |found| found.confidence[at]),
            missed: registered.joints[at].distance(hint.position),
        };
        registered.confidence[at] = registered.confidence[at].min(heeded.confidence());
        report.warnings.extend(heeded.warning());
        report.hints.push(heeded);
    }
    Ok((registered, report))
}

/// Where a landmark or, before it, a hint says that a joint is.
fn place(seen: &Observed<'_>, joint: Joint, landmark: usize) -> Option<DVec3> {
    let hint = seen.hints.iter().find(|hint| hint.joint == joint);
    let point = seen.body[landmark];
    let found = (point.support > 0.0).then_some(point.position);
    hint.map(|hint| hint.position)
        .or(found)
        .filter(|place| place.is_finite())
}

fn registered(model: &BodyModel, seen: &Observed<'_>) -> Result<(Registered, FitReport), RigError> {
    let trunk = [
        (Joint::LeftHip, HIPS[0]),
        (Joint::RightHip, HIPS[1]),
        (Joint::LeftShoulder, SHOULDERS[0]),
        (Joint::RightShoulder, SHOULDERS[1]),
    ];
    let [Some(left), Some(right), Some(_), Some(_)] =
        trunk.map(|(joint, landmark)| place(seen, joint, landmark))
    else {
        return Err(RigError::unsuited(
            "shoulders and hips were not found in the scan: is it a whole person, upright and alone? Cut away what surrounds the person, say which \
             axis points up, or say where these joints are, with --joint left_hip=x,y,z and so on",
        ));
    };
    let start = (left + right) / 2.0;
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
    let displaced = displaced(model, &fitted, &surface, &wanted);
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
        hints: Vec::new(),
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
