//! How sure each joint is, and what to tell the user of those that are not.

use super::derivatives::Derivatives;
use super::fit::Fitted;
use super::landmarks::{Place, Source, Targets};
use super::model::BodyModel;
use super::nonrigid::Displaced;
use super::posing::strongest;
use crate::points::KeyPoint;
use glam::DVec3;
use motion_fit::landmarks::BODY_LANDMARKS;
use nalgebra::DVector;
use spmm3::{JOINTS, Joint};

/// Joints less sure than this are pointed out.
pub const UNSURE: f64 = 0.5;

/// An error that makes a joint as doubtful as not, metres.
const DOUBTFUL: f64 = 0.03;
/// A hint may be this far from where a sure joint was found, metres: networks err alike in all views where clothes mislead them.
const CONTRADICTED: f64 = 0.06;

/// Landmarks may be off by this much though all is well, metres.
const USUAL_MISS: f64 = 0.025;
const USUAL_RESIDUAL: f64 = 0.018;

/// A surface that was not seen may be this far from the model, metres.
const UNSEEN: f64 = 0.04;

/// What the deviation that the fit's own equations leave open counts. With all doubts together the joints of eight synthetic people err by less than half
/// of what the confidence stands for (`examples/registration`): it is cautious.
const CERTAINTY: f64 = 0.5;

/// The joints that have words for the user, of SMPL-X's: those before the jaw.
const NAMED: usize = 22;

/// What makes a joint doubtful, each an error in metres.
#[derive(Debug, Clone, Copy, Default)]
struct Doubt {
    /// By the fit's own equations.
    fit: f64,
    /// Its landmark's rays miss one another.
    rays: f64,
    /// Its landmark is elsewhere than the fit has it.
    miss: f64,
    /// The model is off the surface around it.
    surface: f64,
    /// The surface around it was not seen.
    unseen: f64,
}

impl Doubt {
    fn error(&self) -> f64 {
        [self.fit, self.rays, self.miss, self.surface, self.unseen]
            .iter()
            .map(|part| part * part)
            .sum::<f64>()
            .sqrt()
    }

    /// The largest part, in words.
    fn reason(&self) -> String {
        let mm = |metres: f64| (1e3 * metres).round();
        let most = [self.rays, self.miss, self.surface, self.unseen]
            .into_iter()
            .fold(self.fit, f64::max);
        if most == self.rays {
            let residual = mm(self.rays + USUAL_RESIDUAL);
            format!("the views place its landmark {residual} mm apart")
        } else if most == self.miss {
            let miss = mm(self.miss + USUAL_MISS);
            format!("its landmark and the surface around it differ by {miss} mm")
        } else if most == self.unseen {
            "little of the surface around it was seen".to_owned()
        } else if most == self.surface {
            format!(
                "the surface around it is {} mm off the model",
                mm(self.surface)
            )
        } else {
            "nothing says where it is".to_owned()
        }
    }
}

/// How sure the joints are, 0..=1: 0.5 where an error of about 30 mm is to be expected. And warnings of those below.
pub(super) fn confidence(
    model: &BodyModel,
    points: &[KeyPoint; BODY_LANDMARKS],
    targets: &Targets,
    fitted: &Fitted,
    displaced: &Displaced,
) -> ([f64; JOINTS], Vec<String>) {
    let mut doubts = [Doubt::default(); JOINTS];
    by_equations(model, fitted, &mut doubts);
    by_landmarks(points, targets, fitted, &mut doubts);
    by_surface(model, displaced, &mut doubts);
    // What has no evidence of its own is no surer than what carries it; what the user placed is sure.
    let hinted: Vec<Place> = (targets.all.iter())
        .filter(|target| target.source == Source::Hint)
        .map(|target| target.place)
        .collect();
    let mut errors = doubts.map(|doubt| doubt.error());
    for joint in Joint::ALL {
        let at = joint.index();
        if hinted.contains(&Place::Joint(joint)) {
            errors[at] = doubts[at].fit;
        } else if let Some(parent) = joint.parent()
            && at >= NAMED
        {
            errors[at] = errors[at].max(errors[parent.index()]);
        }
    }
    let confidence = errors.map(sure);
    let warnings = (Joint::ALL.into_iter().take(NAMED))
        .filter(|joint| confidence[joint.index()] < UNSURE)
        .map(|joint| {
            let name = joint.name();
            format!(
                "the {} is unsure: {}; if it is wrong in the avatar, give --joint {name}=x,y,z",
                name.replace('_', " "),
                doubts[joint.index()].reason()
            )
        })
        .collect();
    (confidence, warnings)
}

/// The error, metres, that such a confidence (0..=1) stands for.
#[must_use]
pub fn error_of(confidence: f64) -> f64 {
    DOUBTFUL * (1.0 / confidence - 1.0).max(0.0).sqrt()
}

/// How sure a joint with such an error is, metres.
fn sure(error: f64) -> f64 {
    1.0 / (1.0 + (error / DOUBTFUL).powi(2))
}

/// What one of the user's hints did.
#[derive(Debug, Clone, PartialEq)]
pub struct Heeded {
    /// The joint.
    pub joint: Joint,
    /// How far the hint is from where the joint is found without any hint, metres; nothing where it is not found.
    pub apart: Option<f64>,
    /// How sure the joint is without any hint, 0..=1.
    pub sure_without: f64,
    /// How far the joint is from the hint in the end, metres.
    pub missed: f64,
}

impl Heeded {
    /// How far the hint is from where everything else surely has the joint, metres; nothing where that is near enough, or unsure.
    fn contradicted(&self) -> Option<f64> {
        self.apart
            .filter(|apart| self.sure_without >= UNSURE && *apart > CONTRADICTED)
    }

    /// How sure the joint can be.
    pub(super) fn confidence(&self) -> f64 {
        sure(self.missed.max(self.contradicted().unwrap_or(0.0)))
    }

    /// What to tell the user of a hint that nothing else agrees with.
    pub(super) fn warning(&self) -> Option<String> {
        let name = self.joint.name();
        let words = name.replace('_', " ");
        if let Some(apart) = self.contradicted() {
            let mm = 1e3 * apart;
            return Some(format!(
                "--joint {name} is {mm:.0} mm from where all else has the {words}: check its numbers, or leave it out"
            ));
        }
        (self.missed > DOUBTFUL).then(|| {
            let mm = 1e3 * self.missed;
            format!("the {words} stays {mm:.0} mm from --joint {name}: a body does not reach there; check its numbers")
        })
    }
}

/// The deviation of each joint that the last equations leave open.
fn by_equations(model: &BodyModel, fitted: &Fitted, doubts: &mut [Doubt; JOINTS]) {
    let Some(factor) = fitted.equations.factor(0.0) else {
        doubts
            .iter_mut()
            .for_each(|doubt| doubt.fit = f64::INFINITY);
        return;
    };
    let derivatives = Derivatives::new(model, &fitted.state, &fitted.posed);
    let mut row = vec![0.0; fitted.state.unknowns()];
    for joint in Joint::ALL {
        let variance: f64 = (DVec3::AXES.iter())
            .map(|axis| {
                derivatives.of_joint(joint, *axis, &mut row);
                let row = DVector::from_column_slice(&row);
                row.dot(&factor.solve(&row))
            })
            .sum();
        doubts[joint.index()].fit = CERTAINTY * variance.max(0.0).sqrt();
    }
}

fn by_landmarks(
    points: &[KeyPoint; BODY_LANDMARKS],
    targets: &Targets,
    fitted: &Fitted,
    doubts: &mut [Doubt; JOINTS],
) {
    for target in &targets.all {
        if let (Place::Joint(joint), Source::Body(landmark)) = (target.place, target.source) {
            let doubt = &mut doubts[joint.index()];
            let miss = Targets::miss(target, &fitted.posed).length();
            doubt.miss = (miss - USUAL_MISS).max(0.0);
            doubt.rays = (points[landmark].residual - USUAL_RESIDUAL).max(0.0);
        }
    }
}

/// What other skin closes in was not seen either.
fn by_surface(model: &BodyModel, displaced: &Displaced, doubts: &mut [Doubt; JOINTS]) {
    let mut sums = [(0.0_f64, 0.0_f64, 0.0_f64); JOINTS];
    for (vertex, distance) in displaced.offsets.iter().enumerate() {
        if !model.outer[vertex] {
            continue;
        }
        let (all, seen, squared) = &mut sums[strongest(&model.weights[vertex])];
        *all += 1.0;
        if let Some(distance) = distance {
            *seen += 1.0;
            *squared += distance * distance;
        }
    }
    for joint in Joint::ALL.into_iter().take(NAMED) {
        let (all, seen, squared) = sums[joint.index()];
        if all > 0.0 {
            let doubt = &mut doubts[joint.index()];
            doubt.surface = (squared / f64::max(seen, 1.0)).sqrt();
            doubt.unseen = UNSEEN * (1.0 - seen / all).powi(2);
        }
    }
}
