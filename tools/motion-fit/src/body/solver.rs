//! Levenberg-Marquardt over a skeleton's position and rotations.
//!
//! Unknowns: the pelvis' position and, for each joint, a small turn from the left of its rotation (in its parent's axes). Every term has three
//! rows and an analytic Jacobian of 3x3 blocks, one for each joint that moves it.

use super::{
    chain::{Attachment, BODY_JOINTS, Chain, Placed, Posture, body_index},
    limits::Limits,
    prior::PosePrior,
    so3,
    terms::{NEAREST, Term, View},
};
use nalgebra::{Matrix3, Vector3};

/// Blocks of three unknowns: the position, then the joints.
const BLOCKS: usize = 1 + BODY_JOINTS;
/// Unknowns of the solver: 3 of the position, 3 of each joint.
pub const UNKNOWNS: usize = 3 * BLOCKS;
/// A joint turns no further in one iteration, radians.
const LARGEST_TURN: f64 = 0.6;
/// The pelvis moves no further in one iteration, metres.
const LARGEST_MOVE: f64 = 1.0;

/// Terms, views and prior of one frame, and the room that solving needs.
///
/// It allocates at its creation and while the list of terms grows for the first time.
#[derive(Debug, Clone)]
pub struct SkeletonSolver {
    chain: Chain,
    limits: Limits,
    /// What a body's pose is like before anything is seen, and the weight of that; 0 leaves it out.
    pub prior: PosePrior,
    /// Weight of [`Self::prior`].
    pub prior_weight: f64,
    /// Weight of the joints' ranges; 0 leaves them out.
    pub limit_weight: f64,
    /// The cameras that [`Term::Pixel`] names by index; a term that names none here is left out.
    pub views: Vec<View>,
    /// What to bring together.
    pub terms: Vec<Term>,
    system: Box<System>,
}

/// What solving came to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Solved {
    /// Sum of squared weighted residuals with their robust kernels, prior and limits, at the end.
    pub cost: f64,
    /// Iterations done.
    pub iterations: usize,
}

/// The normal equations `hessian * step = -gradient`.
#[derive(Debug, Clone)]
struct System {
    /// Lower triangle, by rows.
    hessian: [[f64; UNKNOWNS]; UNKNOWNS],
    factor: [[f64; UNKNOWNS]; UNKNOWNS],
    gradient: [f64; UNKNOWNS],
    cost: f64,
}

/// The derivative of three rows by the unknowns.
struct Rows {
    blocks: [Matrix3<f64>; BLOCKS],
    /// Which blocks are not zero, as bits.
    used: u32,
}

impl Rows {
    fn new() -> Self {
        Self {
            blocks: [Matrix3::zeros(); BLOCKS],
            used: 0,
        }
    }

    fn add(&mut self, block: usize, value: &Matrix3<f64>) {
        if self.used & 1 << block == 0 {
            self.blocks[block] = *value;
            self.used |= 1 << block;
        } else {
            self.blocks[block] += value;
        }
    }
}

/// The blocks whose bits are set.
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let at = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            at
        })
    })
}

impl System {
    fn clear(&mut self) {
        self.cost = 0.0;
        self.gradient = [0.0; UNKNOWNS];
        for row in &mut self.hessian {
            *row = [0.0; UNKNOWNS];
        }
    }

    fn add_block(&mut self, row: usize, column: usize, value: &Matrix3<f64>) {
        for i in 0..3 {
            for k in 0..3 {
                self.hessian[3 * row + i][3 * column + k] += value[(i, k)];
            }
        }
    }

    fn add_gradient(&mut self, row: usize, value: &Vector3<f64>) {
        for i in 0..3 {
            self.gradient[3 * row + i] += value[i];
        }
    }

    /// Rows with information `w` and weighted residual `b`: J^T w J and J^T b.
    fn add_rows(&mut self, rows: &Rows, w: &Matrix3<f64>, b: &Vector3<f64>) {
        for row in bits(rows.used) {
            let weighted = (w * rows.blocks[row]).transpose();
            self.add_gradient(row, &rows.blocks[row].tr_mul(b));
            for column in bits(rows.used & ((2 << row) - 1)) {
                self.add_block(row, column, &(weighted * rows.blocks[column]));
            }
        }
    }

    /// The step of the damped equations; `None` where they are not positive definite.
    fn step(&mut self, damping: f64) -> Option<[f64; UNKNOWNS]> {
        for i in 0..UNKNOWNS {
            for k in 0..=i {
                let (above, from) = self.factor.split_at_mut(i);
                let row = &mut from[0];
                let damped = if i == k {
                    self.hessian[i][i] * (1.0 + damping) + 1e-9
                } else {
                    self.hessian[i][k]
                };
                if i == k {
                    let rest = damped - row[..k].iter().map(|v| v * v).sum::<f64>();
                    if rest.is_nan() || rest <= 1e-12 {
                        return None;
                    }
                    row[i] = rest.sqrt();
                } else {
                    let other = &above[k];
                    let known: f64 = row[..k].iter().zip(&other[..k]).map(|(a, b)| a * b).sum();
                    row[k] = (damped - known) / other[k];
                }
            }
        }
        let mut step = [0.0; UNKNOWNS];
        for i in 0..UNKNOWNS {
            let known: f64 = (0..i).map(|k| self.factor[i][k] * step[k]).sum();
            step[i] = (-self.gradient[i] - known) / self.factor[i][i];
        }
        for i in (0..UNKNOWNS).rev() {
            let known: f64 = (i + 1..UNKNOWNS).map(|k| self.factor[k][i] * step[k]).sum();
            step[i] = (step[i] - known) / self.factor[i][i];
        }
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}

/// Most damping of a step.
const STIFFEST: f64 = 1e6;

impl SkeletonSolver {
    /// A solver for the bones of `chain`, with the ranges of a person's joints.
    #[must_use]
    pub fn new(chain: Chain, prior: PosePrior) -> Self {
        Self {
            chain,
            limits: Limits::default(),
            prior,
            prior_weight: 1.0,
            limit_weight: 1.0,
            views: Vec::with_capacity(1),
            terms: Vec::with_capacity(256),
            system: Box::new(System {
                hessian: [[0.0; UNKNOWNS]; UNKNOWNS],
                factor: [[0.0; UNKNOWNS]; UNKNOWNS],
                gradient: [0.0; UNKNOWNS],
                cost: 0.0,
            }),
        }
    }

    /// The bones.
    #[must_use]
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// The bones, to change their lengths.
    pub(super) fn chain_mut(&mut self) -> &mut Chain {
        &mut self.chain
    }

    /// Moves `posture` towards the least cost by at most `iterations` steps. Where nothing finite comes out, `posture` stays.
    pub fn solve(&mut self, posture: &mut Posture, iterations: usize) -> Solved {
        let mut best = *posture;
        let mut best_cost = f64::INFINITY;
        let mut at = best;
        let mut damping = 1e-3;
        let mut done = 0;
        // One more assembly than steps: the last one judges the last step.
        for round in 0..=iterations {
            self.assemble(&at);
            let cost = self.system.cost;
            if cost.is_finite() && cost <= best_cost {
                let gained = best_cost - cost;
                best = at;
                best_cost = cost;
                damping = f64::max(damping * 0.3, 1e-6);
                if gained <= 1e-7 * cost {
                    break;
                }
            } else {
                if !best_cost.is_finite() {
                    break;
                }
                damping = f64::min(damping * 20.0, STIFFEST);
                if round < iterations {
                    self.assemble(&best);
                }
            }
            if round == iterations {
                break;
            }
            // More damping makes any system definite.
            let step = loop {
                match self.system.step(damping) {
                    Some(step) => break Some(step),
                    None if damping >= STIFFEST => break None,
                    None => damping = f64::min(damping * 100.0 + 1e-2, STIFFEST),
                }
            };
            let Some(step) = step else {
                break;
            };
            at = moved(&best, &step);
            done = round + 1;
        }
        if best.is_finite() && best_cost.is_finite() {
            *posture = best;
        }
        Solved {
            cost: best_cost,
            iterations: done,
        }
    }

    /// The cost of `posture` and its gradient by the unknowns: for checks, and for comparing postures.
    pub fn cost(&mut self, posture: &Posture) -> (f64, &[f64; UNKNOWNS]) {
        self.assemble(posture);
        (self.system.cost, &self.system.gradient)
    }

    fn assemble(&mut self, posture: &Posture) {
        let placed = self.chain.place(posture);
        let system = &mut *self.system;
        system.clear();
        let frames = Frames {
            chain: &self.chain,
            placed: &placed,
        };
        for term in &self.terms {
            frames.add(term, posture, &self.views, system);
        }
        let logs: [Vector3<f64>; BODY_JOINTS] =
            std::array::from_fn(|joint| so3::log(&posture.rotations[joint]));
        let turns: [Matrix3<f64>; BODY_JOINTS] =
            std::array::from_fn(|joint| so3::log_by_left_turn(&logs[joint]));
        if self.limit_weight > 0.0 {
            for joint in 1..BODY_JOINTS {
                let (over, information) = self.limits.excess(joint, &logs[joint]);
                if information == Vector3::zeros() {
                    continue;
                }
                let w = Matrix3::from_diagonal(&(information * self.limit_weight));
                let b = w * over;
                system.cost += over.dot(&b);
                let mut rows = Rows::new();
                rows.add(1 + joint, &turns[joint]);
                system.add_rows(&rows, &w, &b);
            }
        }
        if self.prior_weight > 0.0 {
            let deviations: [Vector3<f64>; BODY_JOINTS] =
                std::array::from_fn(|joint| logs[joint] - self.prior.mean(joint));
            for row in 1..BODY_JOINTS {
                let turned = turns[row].transpose() * self.prior_weight;
                let mut pull = Vector3::zeros();
                for column in 1..BODY_JOINTS {
                    let information = self.prior.information(row, column);
                    pull += information * deviations[column];
                    if column <= row {
                        system.add_block(
                            1 + row,
                            1 + column,
                            &(turned * information * turns[column]),
                        );
                    }
                }
                system.cost += self.prior_weight * deviations[row].dot(&pull);
                system.add_gradient(1 + row, &(turned * pull));
            }
        }
    }
}

/// A posture's joints, to differentiate what they carry.
struct Frames<'a> {
    chain: &'a Chain,
    placed: &'a Placed,
}

impl Frames<'_> {
    /// The axes that a joint's small turn is given in.
    fn axes(&self, joint: usize) -> Matrix3<f64> {
        if joint == 0 {
            Matrix3::identity()
        } else {
            self.placed.rotations[self.chain.parents[joint]]
        }
    }

    /// Adds the derivative of a carried point, `weight` times, and returns the point.
    fn point(&self, at: &Attachment, weight: f64, rows: &mut Rows) -> Vector3<f64> {
        let point = self.placed.point(at);
        rows.add(0, &(Matrix3::identity() * weight));
        for joint in bits(self.chain.movers[at.joint]) {
            let arm = (point - self.placed.positions[joint]) * -weight;
            rows.add(1 + joint, &(so3::skew(&arm) * self.axes(joint)));
        }
        point
    }

    /// Adds `factor` times the derivative of a joint's small turn in the world.
    fn turn(&self, joint: usize, factor: &Matrix3<f64>, rows: &mut Rows) {
        for mover in bits(self.chain.movers[joint]) {
            rows.add(1 + mover, &(factor * self.axes(mover)));
        }
    }

    fn add(&self, term: &Term, posture: &Posture, views: &[View], system: &mut System) {
        let mut rows = Rows::new();
        match term {
            Term::Place {
                points,
                target,
                information,
                robust,
            } => {
                let mut residual = -target;
                for (at, weight) in points.iter().filter(|(_, weight)| *weight != 0.0) {
                    residual += self.point(at, *weight, &mut rows) * *weight;
                }
                finish(system, &rows, &residual, information, *robust);
            }
            Term::Pixel {
                point,
                view,
                target,
                information,
                robust,
            } => {
                let Some(view) = views.get(*view) else {
                    return;
                };
                let at = self.point(point, 1.0, &mut rows);
                let p = view.camera_from_world * at + view.translation;
                let depth = p.z.max(NEAREST);
                let scale = view.focal / depth;
                let residual = p.xy() * scale + view.centre - target;
                // The third row is empty: a pixel says nothing of itself along its own ray.
                let mut by_point = Matrix3::zeros();
                by_point[(0, 0)] = scale;
                by_point[(1, 1)] = scale;
                if p.z > NEAREST {
                    by_point[(0, 2)] = -scale * p.x / depth;
                    by_point[(1, 2)] = -scale * p.y / depth;
                }
                let by_point = by_point * view.camera_from_world;
                let residual = Vector3::new(residual.x, residual.y, 0.0);
                let squares = residual.norm_squared() * information;
                let (cost, weight) = kernel(squares, *robust);
                system.cost += cost;
                let information = information * weight;
                let w = by_point.transpose() * by_point * information;
                let b = by_point.transpose() * residual * information;
                system.add_rows(&rows, &w, &b);
            }
            Term::Orientation {
                joint,
                target,
                information,
                robust,
            } => {
                let joint = body_index(*joint);
                let rotation =
                    nalgebra::Rotation3::from_matrix_unchecked(self.placed.rotations[joint]);
                let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
                let residual = so3::log(&(rotation * target.inverse()));
                self.turn(joint, &so3::log_by_left_turn(&residual), &mut rows);
                finish(system, &rows, &residual, information, *robust);
            }
            Term::Rotation {
                joint,
                target,
                information,
                robust,
            } => {
                let joint = body_index(*joint);
                let residual = so3::log(&(posture.rotations[joint] * target.inverse()));
                rows.add(1 + joint, &so3::log_by_left_turn(&residual));
                finish(system, &rows, &residual, information, *robust);
            }
            Term::Direction {
                joint,
                axis,
                target,
                information,
                robust,
            } => {
                let joint = body_index(*joint);
                let axis = self.placed.rotations[joint] * axis;
                self.turn(joint, &-so3::skew(&axis), &mut rows);
                finish(system, &rows, &(axis - target), information, *robust);
            }
        }
    }
}

/// Adds three rows with a residual.
fn finish(
    system: &mut System,
    rows: &Rows,
    residual: &Vector3<f64>,
    information: &Matrix3<f64>,
    robust: Option<f64>,
) {
    let b = information * residual;
    let (cost, weight) = kernel(residual.dot(&b), robust);
    system.cost += cost;
    system.add_rows(rows, &(information * weight), &(b * weight));
}

/// Cauchy's kernel: the cost of a squared weighted residual, and the weight that it has in the normal equations.
fn kernel(squares: f64, robust: Option<f64>) -> (f64, f64) {
    match robust {
        Some(sigmas) => {
            let square = sigmas * sigmas;
            let part = squares / square;
            (square * part.ln_1p(), 1.0 / (1.0 + part))
        }
        None => (squares, 1.0),
    }
}

/// `posture` after a step, whose moves and turns are bounded.
fn moved(posture: &Posture, step: &[f64; UNKNOWNS]) -> Posture {
    let part = |block: usize, largest: f64| {
        let v = Vector3::new(step[3 * block], step[3 * block + 1], step[3 * block + 2]);
        let length = v.norm();
        if length > largest {
            v * (largest / length)
        } else {
            v
        }
    };
    let mut out = *posture;
    out.position += part(0, LARGEST_MOVE);
    for (joint, rotation) in out.rotations.iter_mut().enumerate() {
        *rotation = so3::exp(&part(1 + joint, LARGEST_TURN)) * *rotation;
        rotation.renormalize();
    }
    out
}
