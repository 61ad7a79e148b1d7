//! The poses of all frames that are trained on, once shape and clothes are known: a few Gauss-Newton steps for each, against its own outlines.

use crate::body::{Body, Canonical};
use crate::error::TemplateError;
use crate::observe::seen;
use crate::posing::Correction;
use crate::register::{Registration, Scene};
use capture::{Capture, FramePose};

/// How near pulls must be in each round, metres.
const ROUNDS: [f64; 6] = [0.06, 0.045, 0.035, 0.03, 0.025, 0.02];

/// More frames than this are not fitted: the others' corrections lie between those of the frames before and after, as a tracker's errors do.
const MOST_FRAMES: usize = 600;

/// So many frames' outlines are in memory at a time.
const TOGETHER: usize = 24;

/// More cameras, and larger pictures, say little that is new of one pose.
const MOST_CAMERAS: usize = 8;
const SIDE: u32 = 288;

/// A correction beyond these is not believed: metres and radians.
const MOST_SHIFT: f64 = 0.12;
const MOST_TURN: f64 = 0.4;

/// What is fitted: the dressed body in T-pose, and the corrections that the chosen frames (ascending) have.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known<'a> {
    pub(crate) body: &'a Body,
    pub(crate) canonical: &'a Canonical,
    pub(crate) found: &'a Registration,
    pub(crate) chosen: &'a [usize],
}

/// Every frame's own correction, in addition to the shared one: fitted to the outlines of `cameras` in the frames of `training` (ascending); none in the
/// others, which are not looked at. Also returns how many frames were fitted.
pub(crate) fn own_corrections(
    capture: &Capture,
    poses: &[FramePose],
    known: Known<'_>,
    training: &[usize],
    cameras: &[usize],
) -> Result<(Vec<Correction>, usize), TemplateError> {
    let mut fitted: Vec<(usize, Correction)> = (known
        .chosen
        .iter()
        .copied()
        .zip(known.found.own.iter().copied()))
    .collect();
    let open: Vec<usize> = (training.iter().copied())
        .filter(|frame| known.chosen.binary_search(frame).is_err())
        .collect();
    let step = open.len().div_ceil(MOST_FRAMES).max(1);
    let open: Vec<usize> = open.into_iter().step_by(step).collect();
    let some = cameras.len().div_ceil(MOST_CAMERAS).max(1);
    let cameras: Vec<usize> = cameras.iter().copied().step_by(some).collect();
    for frames in open.chunks(TOGETHER) {
        let views = seen(capture, frames, &cameras, SIDE)?;
        let scene = Scene {
            body: known.body,
            poses: frames.iter().map(|frame| poses[*frame].clone()).collect(),
            views: &views,
        };
        let mut found = Registration {
            own: vec![Correction::default(); frames.len()],
            ..known.found.clone()
        };
        for reach in ROUNDS {
            scene.correct_poses(known.canonical, &mut found, reach);
        }
        let seen = |slot: usize| views.iter().any(|view| view.slot == slot);
        let believed = found.own.into_iter().enumerate();
        let believed = believed.filter(|(slot, own)| seen(*slot) && is_small(own));
        fitted.extend(believed.map(|(slot, own)| (frames[slot], own)));
    }
    fitted.sort_unstable_by_key(|(frame, _)| *frame);
    let mut own = vec![Correction::default(); poses.len()];
    for frame in training {
        own[*frame] = between(&fitted, *frame);
    }
    Ok((own, fitted.len()))
}

fn is_small(own: &Correction) -> bool {
    own.pelvis.length() < MOST_SHIFT && own.turns.iter().all(|turn| turn.length() < MOST_TURN)
}

/// The correction of a frame: its own where it was fitted, else one between those before and after it.
fn between(fitted: &[(usize, Correction)], frame: usize) -> Correction {
    let after = fitted.partition_point(|(other, _)| *other < frame);
    match (after.checked_sub(1).map(|k| fitted[k]), fitted.get(after)) {
        (_, Some((at, own))) if *at == frame => *own,
        (Some((from, first)), Some((to, second))) => {
            let share = (frame - from) as f64 / (to - from) as f64;
            Correction {
                pelvis: first.pelvis.lerp(second.pelvis, share),
                turns: std::array::from_fn(|k| first.turns[k].lerp(second.turns[k], share)),
            }
        }
        (Some((_, own)), None) => own,
        (None, Some((_, own))) => *own,
        (None, None) => Correction::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn frames_between_fitted_ones_have_corrections_between_theirs() {
        let shifted = |x: f64| Correction {
            pelvis: DVec3::new(x, 0.0, 0.0),
            ..Correction::default()
        };
        let fitted = [(3, shifted(0.03)), (7, shifted(0.07))];
        for (frame, expected) in [
            (0, 0.03),
            (3, 0.03),
            (4, 0.04),
            (6, 0.06),
            (7, 0.07),
            (9, 0.07),
        ] {
            let got = between(&fitted, frame).pelvis.x;
            assert!((got - expected).abs() < 1e-12, "frame {frame}: {got}");
        }
        assert_eq!(between(&[], 5), Correction::default(), "nothing is known");
    }
}
