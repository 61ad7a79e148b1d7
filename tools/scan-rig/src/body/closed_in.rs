//! Skin that other skin closes in as the scan stands: between arm and flank, thigh and thigh.

use super::model::BodyModel;
use super::posing::t_pose;
use super::state::{Posed, State};
use crate::apart::{CLOSED_IN, InTwoPoses, come_apart};
use crate::normals::vertex_normals;
use glam::DVec3;

/// More of a finger than this is a finger's: fingers close each other in always, and are seen from without.
const FINGER: f64 = 0.3;

/// `[body vertices]` which vertices of the model, as a state puts it, are closed in by other skin. Views see no gap there, but a sheet of surface from
/// the one part to the other, which is neither's.
pub(super) fn closed_in(model: &BodyModel, state: &State, posed: &Posed) -> Vec<bool> {
    let straight = State {
        root: DVec3::ZERO,
        rotations: t_pose(&posed.rest_joints),
        ..state.clone()
    };
    let straight = Posed::new(model, &straight);
    let outer: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v] && model.finger_share(*v) < FINGER)
        .collect();
    let normals = vertex_normals(&posed.vertices, &model.faces, DVec3::ZERO);
    let skin: Vec<InTwoPoses> = (outer.iter())
        .map(|v| InTwoPoses {
            outwards: normals[*v].as_vec3(),
            scanned: posed.vertices[*v].as_vec3(),
            straight: straight.vertices[*v].as_vec3(),
        })
        .collect();
    let mut closed_in = vec![false; model.body_vertices];
    #[expect(clippy::cast_possible_truncation, reason = "about 1")]
    let bounds = (
        CLOSED_IN.0 * state.scale as f32,
        CLOSED_IN.1 * state.scale as f32,
    );
    for (v, [found]) in outer.iter().zip(come_apart(&skin, &skin, [bounds])) {
        closed_in[*v] = found;
    }
    closed_in
}
