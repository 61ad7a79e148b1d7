//! The first avatar, and how its skeleton stands in every frame.

use anyhow::Context;
use avatar_trainer::{Options, TrainError, Trainer};
use capture::Capture;
use spmm3::{Avatar, MotionParams, fit_expression};
use std::path::Path;

/// A training of the avatar at `template`, or of a first one that is made of the capture.
pub(super) fn begin<'a>(
    capture: &'a Capture,
    template: Option<&Path>,
    options: Options,
) -> anyhow::Result<Trainer<'a>> {
    let (first, motions) = match template {
        Some(path) => {
            let first = Avatar::load(path)
                .with_context(|| format!("cannot begin with {}", path.display()))?;
            let motions = motions(capture, &first)?;
            (first, motions)
        }
        None => anyhow::bail!("--template is needed"),
    };
    Ok(Trainer::new(capture, first, motions, options)?)
}

/// The capture's poses on the avatar's skeleton, the face in its basis.
fn motions(capture: &Capture, first: &Avatar) -> Result<Vec<MotionParams>, TrainError> {
    let poses = capture.poses().ok_or(TrainError::NoMotion)?;
    let basis = capture.expression_basis();
    let mut shown = true;
    let motions = poses.iter().map(|pose| {
        let mut motion = pose.on(&first.skeleton);
        if let Some(basis) = basis {
            shown &= fit_expression(
                &mut motion,
                basis,
                &first.expression_basis,
                &first.expressions,
            );
        }
        motion
    });
    let motions = motions.collect();
    if !shown {
        log::warn!(
            "the faces in the capture are of another basis than the avatar's and are left out: only jaw and eyes move"
        );
    }
    Ok(motions)
}
