//! The first avatar, and how its skeleton stands in every frame.

use anyhow::Context;
use avatar_trainer::{Options, TrainError, Trainer};
use capture::Capture;
use mon3tr::device_options::makehuman;
use person_template::{TemplateOptions, first_avatar};
use spmm3::{Avatar, MotionParams, fit_expression};
use std::path::Path;

/// What others may do with an avatar unless its maker says otherwise.
const LICENCE: &str = "all rights reserved by the person who was captured";

/// A training of the avatar at `template`, or of a first one that is made of the capture.
pub(super) fn begin<'a>(
    capture: &'a Capture,
    template: Option<&Path>,
    options: Options,
) -> anyhow::Result<Trainer<'a>> {
    let first = match template {
        Some(path) => {
            Avatar::load(path).with_context(|| format!("cannot begin with {}", path.display()))?
        }
        None => made(capture, options.gaussians)?,
    };
    let motions = motions(capture, &first)?;
    Ok(Trainer::new(capture, first, motions, options)?)
}

/// A first avatar of the capture, of half as many Gaussians as there will be: pictures say where the others are needed.
fn made(capture: &Capture, gaussians: usize) -> anyhow::Result<Avatar> {
    let name = capture.folder().file_name();
    let name = name.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let template = TemplateOptions {
        provenance: format!(
            "trained from the pictures of the capture {name} by mon3tr-dev reconstruct"
        ),
        name,
        licence: LICENCE.to_owned(),
        gaussians: (gaussians / 2).max(1),
        ..TemplateOptions::default()
    };
    let first = first_avatar(capture, &makehuman()?, &template, &|step| {
        eprintln!("first avatar: {step} ...");
    });
    Ok(first
        .context("cannot make a first avatar of the capture")?
        .avatar)
}

/// The capture's poses on the avatar's skeleton, the face in its basis.
///
/// They are taken as the capture has them, without what the first avatar's registration corrected in all of them: poses to come, which drive the
/// avatar and on which it is measured, have no such correction, so the avatar has to learn it.
fn motions(capture: &Capture, first: &Avatar) -> Result<Vec<MotionParams>, TrainError> {
    let poses = capture.poses().ok_or(TrainError::NoMotion)?;
    let basis = capture.expression_basis();
    let mut shown = true;
    let motions = poses.iter().map(|pose| {
        let mut motion = pose.on(&first.skeleton);
        if let Some(basis) = basis {
            let (to, presets) = (&first.expression_basis, &first.expressions);
            shown &= fit_expression(&mut motion, basis, to, presets);
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
