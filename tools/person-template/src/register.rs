//! The body's shape, once for all frames, by Gauss-Newton: rim vertices against the outlines of the masks.
//!
//! Unknown are the shape (its weights, scale, thickness of clothes), one correction that all frames share (the captured skeleton's joints are not quite
//! ours), and a small one of each frame (captured poses are noisy). The frames' own are eliminated frame by frame (Schur's complement), so that the
//! equations that remain are small whatever the number of frames.

use crate::body::{Body, Canonical, Shape};
use crate::observe::View;
use crate::posing::{CORRECTION, Correction, Derivatives, Posed};
use crate::rim::{PosedMesh, Pull, overlap, pulls};
use capture::FramePose;
use glam::{DMat3, DVec3};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use scan_rig::body::normal_equations::NormalEquations;
use scan_rig::normals::vertex_normals;
use std::f64::consts::PI;

/// How near pulls must be in each round, metres.
const ROUNDS: [f64; 16] = [
    0.16, 0.13, 0.11, 0.09, 0.08, 0.07, 0.06, 0.05, 0.04, 0.035, 0.03, 0.03, 0.025, 0.025, 0.02,
    0.02,
];

/// Rounds before poses are corrected: first the size must be about right.
const SIZE_ROUNDS: usize = 4;

/// How far off an outline usually is, metres: what lies beside one another on it is off together, so this is more than a mask's own error.
const OUTLINE: f64 = 0.03;

/// Views of a frame beyond so many tell little that is new.
const VIEWS: f64 = 10.0;

/// How far captured poses are off: in one frame, and in all frames alike, where body models differ by centimetres in where a pelvis is; metres and radians.
const OWN: (f64, f64) = (0.010, 2.0 * PI / 180.0);
const SHARED: (f64, f64) = (0.150, 2.5 * PI / 180.0);

/// All frames together say as much of the shape, and of what is shared, as so many whose errors are independent: clothes are thick at the same places
/// in all of them. Were every frame to count, a loose jacket would be explained by a body that nobody has.
const TOGETHER: f64 = 0.5;

/// How far a camera's direction is off in one step, radians: what is left is asked for again in the next.
const DIRECTION: f64 = 0.5 * PI / 180.0;

/// How far people differ from the average: the four macro shapes, the others, the logarithm of the scale.
const MACRO: f64 = 0.4;
const OTHER: f64 = 0.5;
const SCALE: f64 = 0.04;

/// Thickness of clothes: usual, how much it differs, and at most, metres.
const CLOTH: f64 = 0.006;
const CLOTH_DIFFERS: f64 = 0.006;
const MOST_CLOTH: f64 = 0.04;

/// The largest weight of a shape.
const MOST_SHAPE: f64 = 1.5;

/// How much the diagonal is raised, as a share.
const DAMPING: f64 = 1e-3;

/// The chosen frames: their poses, and what was seen in them.
#[derive(Debug)]
pub(crate) struct Scene<'a> {
    pub(crate) body: &'a Body,
    /// One for each chosen frame.
    pub(crate) poses: Vec<FramePose>,
    /// Ordered by slot.
    pub(crate) views: &'a [View],
}

/// What the registration found.
#[derive(Debug, Clone)]
pub(crate) struct Registration {
    pub(crate) shape: Shape,
    /// Of every frame.
    pub(crate) shared: Correction,
    /// Of each chosen frame, in addition.
    pub(crate) own: Vec<Correction>,
}

impl Registration {
    /// The whole correction of a chosen frame.
    pub(crate) fn correction(&self, slot: usize) -> Correction {
        self.own
            .get(slot)
            .map_or(self.shared, |own| self.shared.plus(own))
    }
}

/// A mesh as it stands in a chosen frame, and what pulls it.
struct Pulled<'a> {
    posed: Posed,
    /// Metres.
    vertices: Vec<DVec3>,
    by_view: Vec<(&'a View, Vec<Pull>)>,
}

impl Scene<'_> {
    fn views_of(&self, slot: usize) -> &[View] {
        let from = self.views.partition_point(|view| view.slot < slot);
        let until = self.views.partition_point(|view| view.slot <= slot);
        &self.views[from..until]
    }

    /// The pulls of all views of a chosen frame on a mesh in T-pose, and the mesh' pose.
    pub(crate) fn pulls(
        &self,
        slot: usize,
        canonical: &Canonical,
        correction: &Correction,
        reach: f64,
    ) -> (Posed, Vec<Pull>) {
        let pulled = self.pulled(slot, canonical, correction, reach);
        let share = (VIEWS / pulled.by_view.len().max(1) as f64).min(1.0);
        let all = pulled.by_view.into_iter().flat_map(|(_, pulls)| pulls);
        let shared = all.map(|pull| Pull {
            weight: pull.weight * share,
            ..pull
        });
        (pulled.posed, shared.collect())
    }

    /// A mesh in T-pose as a chosen frame poses it, and the pulls of each view on it.
    fn pulled(
        &self,
        slot: usize,
        canonical: &Canonical,
        correction: &Correction,
        reach: f64,
    ) -> Pulled<'_> {
        let posed = Posed::new(&canonical.joints, &self.poses[slot], correction);
        let vertices = posed.vertices(&self.body.skin, &canonical.vertices);
        let normals = vertex_normals(&vertices, &self.body.model.faces, DVec3::ZERO);
        let mesh = PosedMesh {
            vertices: &vertices,
            normals: &normals,
        };
        let by_view = (self.views_of(slot).iter())
            .map(|view| (view, pulls(self.body, mesh, view, reach)))
            .collect();
        Pulled {
            posed,
            vertices,
            by_view,
        }
    }

    /// How each camera of the capture should turn about its own axes, radians, so that a mesh in T-pose meets the outlines of its pictures: Gauss-Newton's
    /// step for each camera alone, `[cameras]`. Zero for one that sees nothing.
    pub(crate) fn turns(
        &self,
        canonical: &Canonical,
        found: &Registration,
        reach: f64,
        cameras: usize,
    ) -> Vec<DVec3> {
        let of_frames: Vec<Vec<(usize, DVec3, Pull)>> = (0..self.poses.len())
            .into_par_iter()
            .map(|slot| {
                let correction = found.correction(slot);
                let pulled = self.pulled(slot, canonical, &correction, reach);
                let of_view = |(view, pulls): (&View, Vec<Pull>)| {
                    let camera_from_world = view.camera.camera_from_world;
                    let row = |pull: Pull| {
                        let arm = camera_from_world.transform_point3(pulled.vertices[pull.vertex]);
                        // A turn w moves the place by w x arm.
                        let along = camera_from_world.matrix3 * pull.direction;
                        (view.index, arm.cross(along), pull)
                    };
                    pulls.into_iter().map(row).collect::<Vec<_>>()
                };
                pulled.by_view.into_iter().flat_map(of_view).collect()
            })
            .collect();
        let mut sums = vec![(DMat3::ZERO, DVec3::ZERO); cameras];
        for (camera, row, pull) in of_frames.into_iter().flatten() {
            if let Some((products, gradient)) = sums.get_mut(camera) {
                let weight = pull.weight / (OUTLINE * OUTLINE);
                *products += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
                *gradient += row * (pull.distance * weight);
            }
        }
        let frames = self.poses.len().max(1) as f64;
        sums.into_iter()
            .map(|(products, gradient)| {
                // As in the shape, all frames together say as much as some whose errors are independent.
                let prior = DMat3::from_diagonal(DVec3::splat(DIRECTION.powi(-2)));
                let share = (TOGETHER / frames).min(1.0);
                (products * share + prior).inverse() * (gradient * share)
            })
            .collect()
    }

    /// Intersection over union of mesh and masks over all views, 0..=1.
    pub(crate) fn overlap(&self, canonical: &Canonical, found: &Registration) -> f64 {
        let counts: Vec<(usize, usize)> = (0..self.poses.len())
            .into_par_iter()
            .map(|slot| {
                let posed = Posed::new(
                    &canonical.joints,
                    &self.poses[slot],
                    &found.correction(slot),
                );
                let vertices = posed.vertices(&self.body.skin, &canonical.vertices);
                let counts =
                    (self.views_of(slot).iter()).map(|view| overlap(self.body, &vertices, view));
                counts.fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1))
            })
            .collect();
        let both: usize = counts.iter().map(|count| count.0).sum();
        let either: usize = counts.iter().map(|count| count.1).sum();
        both as f64 / either.max(1) as f64
    }

    /// Finds shape and corrections.
    pub(crate) fn register(&self) -> Registration {
        let shapes = self.body.model.shapes.len();
        let mut found = Registration {
            shape: Shape {
                weights: vec![0.0; shapes],
                log_scale: 0.0,
                cloth: CLOTH,
            },
            shared: Correction::default(),
            own: vec![Correction::default(); self.poses.len()],
        };
        let mut fields = Vec::new();
        for (round, reach) in ROUNDS.into_iter().enumerate() {
            let canonical = Canonical::clothed(self.body, &found.shape);
            // Bodies change nearly linearly with the shape: every fourth round is enough.
            if round % 4 == 0 {
                fields = Canonical::fields(self.body, &found.shape);
            }
            let looser = if round < SIZE_ROUNDS { 0.1 } else { 1.0 };
            let frames: Vec<Reduced> = (0..self.poses.len())
                .into_par_iter()
                .map(|slot| {
                    let correction = found.correction(slot);
                    let (posed, pulls) = self.pulls(slot, &canonical, &correction, reach);
                    let derivatives = Derivatives::new(self.body, &posed, &fields);
                    let equations = summed(&canonical, &derivatives, &pulls);
                    let deviation = (OWN.0 * looser, OWN.1 * looser);
                    Reduced::new(&equations, &found.own[slot], deviation)
                })
                .collect();
            self.step(&mut found, &frames, looser);
            log::debug!(
                "round {round}: scale {:.3}, cloth {:.1} mm, shared shift {:.1} mm",
                found.shape.log_scale.exp(),
                found.shape.cloth * 1e3,
                found.shared.pelvis.length() * 1e3
            );
        }
        found
    }

    fn step(&self, found: &mut Registration, frames: &[Reduced], looser: f64) {
        let shapes = self.body.model.shapes.len();
        let unknowns = CORRECTION + shapes + 2;
        let mut products = DMatrix::zeros(unknowns, unknowns);
        let mut gradient = DVector::zeros(unknowns);
        let share = (TOGETHER / frames.len().max(1) as f64).min(1.0);
        for frame in frames {
            products += &frame.products * share;
            gradient += &frame.gradient * share;
        }
        let mut prior = |at: usize, deviation: f64, off: f64| {
            products[(at, at)] += deviation.powi(-2);
            gradient[at] -= off * deviation.powi(-2);
        };
        let shared = (SHARED.0 * looser, SHARED.1 * looser);
        for (at, value) in found.shared.values().into_iter().enumerate() {
            prior(at, deviation(at, shared), value);
        }
        for (at, (weight, shape)) in
            (found.shape.weights.iter().zip(&self.body.model.shapes)).enumerate()
        {
            let usual = match shape.name.as_str() {
                "gender" | "muscle" | "weight" | "height" => MACRO,
                _ => OTHER,
            };
            prior(CORRECTION + at, usual, *weight);
        }
        prior(CORRECTION + shapes, SCALE, found.shape.log_scale);
        prior(
            CORRECTION + shapes + 1,
            CLOTH_DIFFERS,
            found.shape.cloth - CLOTH,
        );
        for at in 0..unknowns {
            products[(at, at)] *= 1.0 + DAMPING;
        }
        let Some(factor) = Cholesky::new(products) else {
            return;
        };
        let step = factor.solve(&gradient);
        if !step.iter().all(|value| value.is_finite()) {
            return;
        }
        for (own, frame) in found.own.iter_mut().zip(frames) {
            own.step(frame.own_step(&step).as_slice());
        }
        found.shared.step(&step.as_slice()[..CORRECTION]);
        let shape = &mut found.shape;
        for (weight, step) in shape.weights.iter_mut().zip(&step.as_slice()[CORRECTION..]) {
            *weight = (*weight + step.clamp(-0.5, 0.5)).clamp(-MOST_SHAPE, MOST_SHAPE);
        }
        shape.log_scale += step[CORRECTION + shapes].clamp(-0.1, 0.1);
        let cloth = shape.cloth + step[CORRECTION + shapes + 1];
        shape.cloth = cloth.clamp(0.0, MOST_CLOTH);
    }

    /// The chosen frames' own corrections once more, for a mesh in T-pose that does not change.
    pub(crate) fn correct_poses(
        &self,
        canonical: &Canonical,
        found: &mut Registration,
        reach: f64,
    ) {
        let steps: Vec<Option<DVector<f64>>> = (0..self.poses.len())
            .into_par_iter()
            .map(|slot| {
                let correction = found.correction(slot);
                let (posed, pulls) = self.pulls(slot, canonical, &correction, reach);
                let derivatives = Derivatives::new(self.body, &posed, &[]);
                let mut equations = summed(canonical, &derivatives, &pulls);
                for (at, value) in found.own[slot].values().into_iter().enumerate() {
                    equations.add_one(at, deviation(at, OWN).powi(-2), -value);
                }
                equations.solved(DAMPING)
            })
            .collect();
        for (own, step) in found.own.iter_mut().zip(steps) {
            if let Some(step) = step {
                own.step(step.as_slice());
            }
        }
    }
}

/// The deviation of number `at` of a correction.
fn deviation(at: usize, (shift, turn): (f64, f64)) -> f64 {
    if at < 3 { shift } else { turn }
}

fn summed(canonical: &Canonical, derivatives: &Derivatives<'_>, pulls: &[Pull]) -> NormalEquations {
    let mut equations = NormalEquations::new(derivatives.unknowns());
    let mut row = vec![0.0; derivatives.unknowns()];
    for pull in pulls {
        let tpose = canonical.vertices[pull.vertex];
        derivatives.of_vertex(pull.vertex, tpose, pull.direction, &mut row);
        equations.add(&row, pull.weight / (OUTLINE * OUTLINE), pull.distance);
    }
    equations
}

/// A frame's equations without its own correction.
#[derive(Debug)]
struct Reduced {
    /// In the shared unknowns: the shared correction, which moves what the frame's own moves, and the fields.
    products: DMatrix<f64>,
    gradient: DVector<f64>,
    /// For the frame's own step: what the shared step takes away, and what it is without one.
    by_shared: DMatrix<f64>,
    alone: DVector<f64>,
}

impl Reduced {
    fn new(equations: &NormalEquations, own: &Correction, deviations: (f64, f64)) -> Self {
        let unknowns = equations.unknowns();
        let whole = DMatrix::from_fn(unknowns, unknowns, |i, j| equations.product(i, j));
        let gradient = DVector::from_column_slice(equations.gradient());
        let mixed = whole.rows(0, CORRECTION).into_owned();
        let mut block = mixed.columns(0, CORRECTION).into_owned();
        let mut right = gradient.rows(0, CORRECTION).into_owned();
        for (at, value) in own.values().into_iter().enumerate() {
            let precision = deviation(at, deviations).powi(-2);
            block[(at, at)] += precision;
            right[at] -= precision * value;
        }
        // The prior makes the block positive definite.
        let Some(factor) = Cholesky::new(block) else {
            return Self {
                products: DMatrix::zeros(unknowns, unknowns),
                gradient: DVector::zeros(unknowns),
                by_shared: DMatrix::zeros(CORRECTION, unknowns),
                alone: DVector::zeros(CORRECTION),
            };
        };
        let by_shared = factor.solve(&mixed);
        let alone = factor.solve(&right);
        Self {
            products: whole - mixed.transpose() * &by_shared,
            gradient: gradient - mixed.transpose() * &alone,
            by_shared,
            alone,
        }
    }

    /// The frame's own step that goes with a shared one.
    fn own_step(&self, shared: &DVector<f64>) -> DVector<f64> {
        &self.alone - &self.by_shared * shared
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eliminating_a_frames_own_correction_gives_the_step_of_the_whole_system() {
        let mut random = fastrand::Rng::with_seed(5);
        let unknowns = CORRECTION + 4;
        let mut equations = NormalEquations::new(unknowns);
        for _ in 0..300 {
            let row: Vec<f64> = (0..unknowns).map(|_| random.f64() - 0.5).collect();
            equations.add(&row, 1.0 + random.f64(), random.f64() - 0.5);
        }
        let mut own = Correction {
            pelvis: DVec3::new(0.01, -0.02, 0.005),
            ..Correction::default()
        };
        own.turns[3] = DVec3::new(0.0, 0.03, -0.01);
        let reduced = Reduced::new(&equations, &own, (0.5, 0.7));
        let ridge = 0.3;
        // The whole: own and shared corrections have the same columns.
        let size = CORRECTION + unknowns;
        let column = |at: usize| if at < CORRECTION { at } else { at - CORRECTION };
        let mut whole =
            DMatrix::from_fn(size, size, |i, j| equations.product(column(i), column(j)));
        let mut right = DVector::from_fn(size, |i, _| equations.gradient()[column(i)]);
        for (at, value) in own.values().into_iter().enumerate() {
            let precision = deviation(at, (0.5, 0.7)).powi(-2);
            whole[(at, at)] += precision;
            right[at] -= precision * value;
        }
        for at in CORRECTION..size {
            whole[(at, at)] += ridge;
        }
        let expected = Cholesky::new(whole).expect("definite").solve(&right);
        let products = &reduced.products + DMatrix::identity(unknowns, unknowns) * ridge;
        let shared = Cholesky::new(products)
            .expect("definite")
            .solve(&reduced.gradient);
        let both: Vec<f64> = (reduced.own_step(&shared).iter().chain(shared.iter()))
            .copied()
            .collect();
        for (at, (got, expected)) in both.iter().zip(expected.iter()).enumerate() {
            assert!(
                (got - expected).abs() < 1e-8,
                "unknown {at}: {got} is not {expected}"
            );
        }
    }
}
