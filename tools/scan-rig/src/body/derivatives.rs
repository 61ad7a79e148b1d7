//! How vertices and joints move when the fit's unknowns change: rows of the Jacobian along a direction.

use super::model::BodyModel;
use super::state::{Posed, SCALE, SHAPES, State, TURNED, TURNS, influences, is_above};
use glam::{DMat3, DVec3};
use spmm3::{JOINTS, Joint};

/// What all rows at one state share.
pub(super) struct Derivatives<'a> {
    model: &'a BodyModel,
    state: &'a State,
    posed: &'a Posed,
    /// For each joint, which of [`TURNED`] carry it or are it.
    carriers: [Vec<usize>; JOINTS],
    /// `[55][shapes]` how a joint moves with a shape's weight.
    joints: Vec<Vec<DVec3>>,
    /// `[55][shapes]` how a joint's flesh moves with the shape's weight, its own offset left out.
    flesh: Vec<Vec<DVec3>>,
}

impl<'a> Derivatives<'a> {
    pub(super) fn new(model: &'a BodyModel, state: &'a State, posed: &'a Posed) -> Self {
        let carriers = Joint::ALL.map(|joint| {
            (0..TURNED.len())
                .filter(|at| is_above(TURNED[*at], joint))
                .collect()
        });
        let mut joints = vec![vec![DVec3::ZERO; model.shapes.len()]; JOINTS];
        let mut flesh = joints.clone();
        for (at, shape) in model.shapes.iter().enumerate() {
            for joint in Joint::ALL {
                let here = joint.index();
                if let Some(parent) = joint.parent() {
                    let from = parent.index();
                    let bone = shape.joints[here] - shape.joints[from];
                    joints[here][at] = joints[from][at] + posed.maps[from].matrix3 * bone;
                }
                flesh[here][at] = joints[here][at] - posed.maps[here].matrix3 * shape.joints[here];
            }
        }
        Self {
            model,
            state,
            posed,
            carriers,
            joints,
            flesh,
        }
    }

    /// Fills `row` with the derivatives of a vertex's place along `direction`.
    pub(super) fn of_vertex(&self, vertex: usize, direction: DVec3, row: &mut [f64]) {
        row.fill(0.0);
        self.of_place(self.posed.vertices[vertex], direction, row);
        let mut blended = DMat3::ZERO;
        for (joint, weight) in influences(&self.model.weights[vertex]) {
            let map = &self.posed.maps[joint];
            blended += map.matrix3 * weight;
            let place = map.transform_point3(self.posed.rest[vertex]);
            self.add_turns(joint, place, weight, direction, row);
            for (slot, move_) in row[SHAPES..].iter_mut().zip(&self.flesh[joint]) {
                *slot += weight * direction.dot(*move_);
            }
        }
        let in_rest = blended.transpose() * direction;
        for (slot, shape) in row[SHAPES..].iter_mut().zip(&self.model.shapes) {
            *slot += in_rest.dot(shape.vertices[vertex]);
        }
    }

    /// Fills `row` with the derivatives of a joint's place along `direction`.
    pub(super) fn of_joint(&self, joint: Joint, direction: DVec3, row: &mut [f64]) {
        row.fill(0.0);
        let at = joint.index();
        let place = self.posed.joints[at];
        self.of_place(place, direction, row);
        self.add_turns(at, place, 1.0, direction, row);
        for (slot, move_) in row[SHAPES..].iter_mut().zip(&self.joints[at]) {
            *slot += direction.dot(*move_);
        }
    }

    fn of_place(&self, place: DVec3, direction: DVec3, row: &mut [f64]) {
        row[..3].copy_from_slice(&direction.to_array());
        row[SCALE] = direction.dot(place - self.state.root);
    }

    fn add_turns(
        &self,
        joint: usize,
        place: DVec3,
        weight: f64,
        direction: DVec3,
        row: &mut [f64],
    ) {
        for carrier in &self.carriers[joint] {
            let arm = place - self.posed.joints[TURNED[*carrier].index()];
            let turn = weight * arm.cross(direction);
            let from = TURNS + 3 * carrier;
            row[from] += turn.x;
            row[from + 1] += turn.y;
            row[from + 2] += turn.z;
        }
    }
}
