//! Place, size, pose and shape of the body model by Gauss-Newton: first by key points, then with the scan's surface.

use super::closed_in::closed_in;
use super::derivatives::Derivatives;
use super::landmarks::Targets;
use super::match_surface::{add, matched, residual};
use super::model::BodyModel;
use super::normal_equations::NormalEquations;
use super::state::{Posed, SCALE, SHAPES, State, TURNED, TURNS, USUAL_CLOTH};
use glam::{DVec3, Vec3};
use spmm3::Joint;

/// Rounds by key points alone, of which the first leave the shape as it is.
const POINT_ROUNDS: usize = 14;
const POSE_ROUNDS: usize = 5;

/// Rounds with the surface: reach in metres, and the surface's weight against the key points and what is usual. An eighth of these weights leaves the
/// joints of eight synthetic people (`eval rig --bodies 8`) 8.3 mm off on average instead of 6.0.
const SURFACE_ROUNDS: [(f64, f64); 12] = [
    (0.060, 1600.0),
    (0.050, 1600.0),
    (0.040, 1600.0),
    (0.030, 1600.0),
    (0.030, 2000.0),
    (0.025, 2000.0),
    (0.020, 2000.0),
    (0.020, 2000.0),
    (0.015, 2000.0),
    (0.015, 2000.0),
    (0.012, 2000.0),
    (0.012, 2000.0),
];

/// The number of points that those weights are for.
const POINTS: f64 = 6000.0;

/// How much thicker or thinner than usual clothes may be, metres.
const CLOTH: f64 = 0.004;

/// How much the diagonal is raised, as a share.
const DAMPING: f64 = 1e-3;

/// What the fit found.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub(super) state: State,
    pub(super) posed: Posed,
    /// Root mean square distance of the surface in the last round, metres.
    pub(super) residual: f64,
    /// Root mean square miss of the key points, metres.
    pub(super) key_points: f64,
    /// The last round's equations: the unknowns' precision.
    pub(super) equations: NormalEquations,
    /// `[body vertices]` what other skin closes in.
    pub(super) closed_in: Vec<bool>,
}

/// Fits the model; `start` is about where the pelvis is. `surface` are points and unit outward normals, in no particular order; without any, the key
/// points alone decide.
pub(super) fn fit(
    model: &BodyModel,
    targets: &Targets,
    surface: &[(Vec3, Vec3)],
    start: DVec3,
) -> Fitted {
    let mut state = State::rest(model, start);
    for round in 0..POINT_ROUNDS {
        let posed = Posed::new(model, &state);
        let mut equations = NormalEquations::new(state.unknowns());
        let derivatives = Derivatives::new(model, &state, &posed);
        targets.add(1.0, &posed, &derivatives, &mut equations);
        let shapes = if round < POSE_ROUNDS { 1e5 } else { 6.0 };
        add_priors(model, &state, shapes, &mut equations);
        if let Some(step) = equations.solved(DAMPING) {
            state.step(&step);
        }
    }
    let mut last = None;
    if !surface.is_empty() {
        #[expect(clippy::cast_precision_loss, reason = "thousands of points")]
        let share = POINTS / surface.len() as f64;
        for (reach, weight) in SURFACE_ROUNDS {
            let posed = Posed::new(model, &state);
            let closed_in = closed_in(model, &state, &posed);
            let pulls = matched(model, &posed, &closed_in, surface, state.cloth, reach);
            let mut equations = NormalEquations::new(state.unknowns());
            let derivatives = Derivatives::new(model, &state, &posed);
            targets.add(0.5, &posed, &derivatives, &mut equations);
            add(
                &pulls,
                weight * share,
                &derivatives,
                state.cloth_at(),
                &mut equations,
            );
            add_priors(model, &state, 3.0, &mut equations);
            log::trace!(
                "reach {:.0} mm: surface {:.1} mm, key points {:.1} mm, scale {:.3}, cloth {:.1} mm",
                reach * 1e3,
                residual(&pulls) * 1e3,
                targets.error(&posed) * 1e3,
                state.scale,
                state.cloth * 1e3
            );
            if let Some(step) = equations.solved(DAMPING) {
                state.step(&step);
            }
            last = Some((equations, residual(&pulls)));
        }
    }
    let posed = Posed::new(model, &state);
    let (equations, residual) = last.unwrap_or_else(|| {
        let mut equations = NormalEquations::new(state.unknowns());
        let derivatives = Derivatives::new(model, &state, &posed);
        targets.add(1.0, &posed, &derivatives, &mut equations);
        add_priors(model, &state, 6.0, &mut equations);
        (equations, 0.0)
    });
    Fitted {
        residual,
        closed_in: closed_in(model, &state, &posed),
        key_points: targets.error(&posed),
        state,
        posed,
        equations,
    }
}

/// Adds what is expected of anybody: a pose near rest, a shape near the average.
fn add_priors(model: &BodyModel, state: &State, shapes: f64, equations: &mut NormalEquations) {
    for (at, joint) in TURNED.into_iter().enumerate() {
        let precision = usual_bend(joint).powi(-2);
        // The step turns in the world's axes.
        let parent = joint.parent().map_or(joint, |parent| parent);
        let bend = state.rotations[parent.index()] * state.bend(joint);
        for (axis, back) in (-bend).to_array().into_iter().enumerate() {
            equations.add_one(TURNS + 3 * at + axis, precision, back);
        }
    }
    for (at, (weight, shape)) in state.shape.iter().zip(&model.shapes).enumerate() {
        let usual: f64 = match shape.name.as_str() {
            "gender" | "muscle" | "weight" | "height" => 0.3,
            _ => 0.5,
        };
        equations.add_one(SHAPES + at, shapes * usual.powi(-2), -weight);
    }
    equations.add_one(SCALE, 25.0, -state.scale.ln());
    equations.add_one(state.cloth_at(), CLOTH.powi(-2), USUAL_CLOTH - state.cloth);
}

/// How far a joint is usually bent from the rest pose, radians.
fn usual_bend(joint: Joint) -> f64 {
    match joint {
        Joint::Spine1 | Joint::Spine2 | Joint::Spine3 => 0.12,
        Joint::LeftCollar | Joint::RightCollar => 0.15,
        Joint::Neck => 0.2,
        Joint::Head => 0.25,
        Joint::LeftAnkle | Joint::RightAnkle | Joint::LeftWrist | Joint::RightWrist => 0.35,
        Joint::LeftHip | Joint::RightHip => 0.5,
        Joint::LeftKnee | Joint::RightKnee => 0.6,
        Joint::LeftShoulder | Joint::RightShoulder | Joint::LeftElbow | Joint::RightElbow => 0.8,
        _ => 9.0,
    }
}
