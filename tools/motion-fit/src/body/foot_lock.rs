//! Standing feet held in their places after smoothing, which would let them slide.

use super::{
    chain::{Attachment, BODY_JOINTS, Chain, Posture, body_index, wide},
    prior::PosePrior,
    so3,
    soles::soles,
    solver::SkeletonSolver,
    stances::{self, Held},
    terms::Term,
};
use glam::Quat;
use nalgebra::{Matrix3, Vector3};
use spmm3::{Joint, MotionParams, Skeleton};

/// A foot further from where it should stand is let go, metres.
const TORN: f64 = 0.12;
/// A held foot creeps towards its own way, where it may have been put down wrongly: too slowly to be seen, m/s.
const CREEP: f64 = 0.03;
/// How fast a foot that was let go comes back to its own way, seconds.
const RELEASE: f64 = 0.2;
/// Corrections smaller than this are left out, metres.
const SMALLEST: f64 = 2e-4;
/// Standard deviations of a sole from its place and of the root's shift, metres; of joints of the legs and others, radians.
const PLACE: f64 = 0.001;
const ROOT: f64 = 0.01;
const LEGS: f64 = 0.1;
const OTHERS: f64 = 0.002;
const STEPS: usize = 3;

/// Holds standing feet in place by bending the legs, and lets lifted feet come back to their own way.
#[derive(Debug, Clone)]
pub struct FootLock {
    solver: SkeletonSolver,
    pelvis: Vector3<f64>,
    soles: [Attachment; 4],
    feet: [Foot; 2],
    last_seconds: Option<f64>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Foot {
    /// Which sole holds, heel 0 or ball 1, and where on the floor.
    anchor: Option<(usize, Vector3<f64>)>,
    /// By how much the foot is moved from its own way, metres.
    offset: Vector3<f64>,
}

impl FootLock {
    /// A lock for the feet of `skeleton`.
    #[must_use]
    pub fn new(skeleton: &Skeleton) -> Self {
        let mut solver = SkeletonSolver::new(Chain::new(skeleton), PosePrior::default());
        solver.prior_weight = 0.0;
        Self {
            solver,
            pelvis: wide(skeleton.rest_positions()[Joint::Pelvis.index()]),
            soles: soles(skeleton),
            feet: [Foot::default(); 2],
            last_seconds: None,
        }
    }

    /// Holds the feet of `motion`, which is of `seconds`. `standing` says of the left and the right foot whether heel and ball stand,
    /// as [`super::BodyPose::standing`].
    pub fn apply(&mut self, seconds: f64, motion: &mut MotionParams, standing: [[bool; 2]; 2]) {
        let step = self.last_seconds.map_or(0.0, |last| seconds - last);
        let step = if step.is_finite() {
            step.clamp(0.0, 1.0)
        } else {
            0.0
        };
        self.last_seconds = seconds.is_finite().then_some(seconds);
        if !motion.is_finite() {
            return;
        }
        let posture = self.posture(motion);
        let placed = self.solver.chain().place(&posture);
        let mut held = [Held::default(); 2];
        for (index, (foot, held)) in self.feet.iter_mut().zip(&mut held).enumerate() {
            let at = [0, 1].map(|sole| placed.point(&self.soles[2 * index + sole]));
            foot.follow(&at, standing[index], step);
            *held = Held {
                sole: foot.anchor.map_or(1, |(sole, _)| sole),
                offset: foot.offset,
                stands: foot.anchor.is_some(),
            };
        }
        self.bend(&posture, &held, motion);
    }

    /// Holds standing feet of a whole recording where they are on average while they stand, from the frame in which they are put down. `standing` is as of
    /// [`Self::apply`], for each of `motions`; of uneven lengths the rest does not stand. What moves a standing foot moves the whole body first, evenly,
    /// and the legs are bent by what is left. Motions with a number that is not finite stay as they are, and all with them.
    pub fn apply_all(&mut self, motions: &mut [MotionParams], standing: &[[[bool; 2]; 2]]) {
        if !motions.iter().all(MotionParams::is_finite) {
            return;
        }
        let postures: Vec<Posture> = motions.iter().map(|m| self.posture(m)).collect();
        let soles: Vec<[[Vector3<f64>; 2]; 2]> = (postures.iter())
            .map(|posture| {
                let placed = self.solver.chain().place(posture);
                [0, 1].map(|foot| [0, 1].map(|sole| placed.point(&self.soles[2 * foot + sole])))
            })
            .collect();
        let feet = [0, 1].map(|foot| {
            let soles: Vec<_> = soles.iter().map(|soles| soles[foot]).collect();
            let standing: Vec<_> = standing.iter().map(|standing| standing[foot]).collect();
            stances::held(&soles, &standing)
        });
        let shifts = stances::shifts(&feet);
        let [left, right] = &feet;
        let feet = left.iter().zip(right);
        let frames = motions.iter_mut().zip(postures).zip(feet.zip(shifts));
        for ((motion, mut posture), ((left, right), shift)) in frames {
            posture.position += shift;
            let held = [left, right].map(|held| Held {
                offset: held.offset - shift,
                ..*held
            });
            self.write_to(&posture, motion);
            self.bend(&posture, &held, motion);
        }
    }

    fn posture(&self, motion: &MotionParams) -> Posture {
        let mut posture = Posture {
            position: wide(motion.root_translation) + self.pelvis,
            ..Posture::default()
        };
        for (joint, rotation) in Joint::ALL.into_iter().zip(&mut posture.rotations) {
            *rotation = so3::exp(&wide(motion.axis_angle(joint)));
        }
        posture
    }

    /// Bends the legs of `posture` so that both feet are moved as said, and writes them to `motion`.
    fn bend(&mut self, posture: &Posture, held: &[Held; 2], motion: &mut MotionParams) {
        if held.iter().all(|held| held.offset.norm() <= SMALLEST) {
            return;
        }
        let placed = self.solver.chain().place(posture);
        self.solver.terms.clear();
        for (index, held) in held.iter().enumerate() {
            let point = self.soles[2 * index + held.sole];
            let firm = Matrix3::identity() / (PLACE * PLACE);
            let target = placed.point(&point) + held.offset;
            self.solver.terms.push(Term::at(point, target, firm));
            let ankle = [Joint::LeftAnkle, Joint::RightAnkle][index];
            let rotation = placed.rotations[body_index(ankle)];
            let rotation = nalgebra::Rotation3::from_matrix_unchecked(rotation);
            self.solver.terms.push(Term::Orientation {
                joint: ankle,
                target: nalgebra::UnitQuaternion::from_rotation_matrix(&rotation),
                information: Matrix3::identity() / (LEGS * LEGS / 100.0),
                robust: None,
            });
        }
        let pelvis = Attachment::centre(Joint::Pelvis);
        let loose = Matrix3::identity() / (ROOT * ROOT);
        self.solver
            .terms
            .push(Term::at(pelvis, posture.position, loose));
        for joint in Joint::ALL.into_iter().take(BODY_JOINTS) {
            let spread = if leg(joint) { LEGS } else { OTHERS };
            self.solver.terms.push(Term::Rotation {
                joint,
                target: posture.rotations[joint.index()],
                information: Matrix3::identity() / (spread * spread),
                robust: None,
            });
        }
        let mut bent = *posture;
        self.solver.solve(&mut bent, STEPS);
        self.write_to(&bent, motion);
    }

    #[allow(clippy::cast_possible_truncation, reason = "motion parameters are f32")]
    fn write_to(&self, posture: &Posture, motion: &mut MotionParams) {
        for joint in Joint::ALL.into_iter().take(BODY_JOINTS).filter(|j| leg(*j)) {
            let q = &posture.rotations[joint.index()];
            let [x, y, z, w] = [q.i, q.j, q.k, q.w].map(|v| v as f32);
            motion.set_rotation(joint, Quat::from_xyzw(x, y, z, w).normalize());
        }
        let root = posture.position - self.pelvis;
        motion.root_translation = glam::DVec3::new(root.x, root.y, root.z).as_vec3();
    }
}

impl Foot {
    /// `at`: where heel and ball would be by themselves.
    fn follow(&mut self, at: &[Vector3<f64>; 2], standing: [bool; 2], step: f64) {
        // The ball stands longest; a foot rolls from the heel onto it.
        let wanted = match standing {
            [_, true] => Some(1),
            [true, false] => Some(0),
            [false, false] => None,
        };
        match (wanted, self.anchor) {
            (Some(sole), Some((held, place))) if sole == held => {
                let mut offset = place - at[sole];
                offset.y = 0.0;
                if offset.norm() > TORN {
                    self.anchor = None;
                } else {
                    let creep = (CREEP * step / offset.norm().max(1e-6)).min(1.0);
                    self.offset = offset * (1.0 - creep);
                    self.anchor = Some((sole, at[sole] + self.offset));
                }
            }
            (Some(sole), _) => {
                self.anchor = Some((sole, at[sole] + self.offset));
            }
            (None, _) => self.anchor = None,
        }
        if self.anchor.is_none() {
            self.offset *= (-step / RELEASE).exp();
        }
    }
}

fn leg(joint: Joint) -> bool {
    use Joint::{LeftAnkle, LeftHip, LeftKnee, RightAnkle, RightHip, RightKnee};
    matches!(
        joint,
        LeftHip | LeftKnee | LeftAnkle | RightHip | RightKnee | RightAnkle
    )
}
