//! The first avatar, and how its skeleton stands in every frame.

use anyhow::Context;
use avatar_trainer::pictures::check_cameras;
use avatar_trainer::{Options, TrainError, Trainer};
use capture::Capture;
use mon3tr::device_options::makehuman;
use person_template::{LEAST_GAUSSIANS, TemplateOptions, first_avatar};
use spmm3::{Avatar, MotionParams, fit_expression};
use std::path::Path;

/// What others may do with an avatar unless its maker says otherwise.
const LICENCE: &str = "all rights reserved by the person who was captured";

/// What a training begins with.
#[derive(Debug, Clone, Copy)]
pub(super) enum First<'a> {
    /// A package of the person.
    Package(&'a Path),
    /// One that is made of the capture.
    Made {
        /// Whether the body model grows to the person's outlines.
        clothes: bool,
        /// Whether the training begins with each frame's pose as it was fitted, and not as it was captured.
        poses: bool,
    },
}

/// A training of `capture` from the first avatar on.
///
/// Of one that is made here, each frame's own error is corrected in its pose already, but not what the registration corrected in all of them alike: poses
/// to come, which drive the avatar and on which it is measured, have no such correction, so the avatar has to learn it.
pub(super) fn begin<'a>(
    capture: &'a Capture,
    first: First<'_>,
    options: Options,
) -> anyhow::Result<Trainer<'a>> {
    // Before the first avatar, which takes minutes.
    options.check()?;
    check_cameras(capture)?;
    let (avatar, fitted) = match first {
        First::Package(path) => {
            let avatar = Avatar::load(path)
                .with_context(|| format!("cannot begin with {}", path.display()))?;
            (avatar, None)
        }
        First::Made { clothes, poses } => {
            let made = made(capture, options.gaussians, clothes)?;
            (made.avatar, poses.then_some(made.uncorrected))
        }
    };
    let motions = motions(capture, &avatar)?;
    let mut trainer = Trainer::new(capture, avatar, motions, options)?;
    if let Some(fitted) = fitted {
        trainer.begin_with_poses(&fitted)?;
    }
    Ok(trainer)
}

/// A first avatar of the capture, of half as many Gaussians as there will be, but no fewer than cover a person: pictures say where the others are
/// needed, and the training leaves out what is too many.
fn made(
    capture: &Capture,
    gaussians: usize,
    clothes: bool,
) -> anyhow::Result<person_template::First> {
    let name = capture.folder().file_name();
    let name = name.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let template = TemplateOptions {
        provenance: format!(
            "trained from the pictures of the capture {name} by mon3tr-dev reconstruct"
        ),
        name,
        licence: LICENCE.to_owned(),
        gaussians: (gaussians / 2).max(LEAST_GAUSSIANS),
        clothes,
        ..TemplateOptions::default()
    };
    let first = first_avatar(capture, &makehuman()?, &template, &|step| {
        eprintln!("first avatar: {step} ...");
    });
    let first = first.context("cannot make a first avatar of the capture")?;
    for warning in &first.report.warnings {
        eprintln!("first avatar: {warning}");
    }
    let report = &first.report;
    eprintln!(
        "first avatar: {:.2} m tall, overlaps the masks by {:.3}, poses of {} frames fitted; in the template's frames the pelvis moved by {:.0} mm and joints turned by {:.1} degrees on average",
        report.height,
        report.dressed_overlap,
        report.posed,
        1e3 * report.own_shift,
        report.own_turn.to_degrees()
    );
    Ok(first)
}

/// The capture's poses on the avatar's skeleton, the face in its basis.
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
