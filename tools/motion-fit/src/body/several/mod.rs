//! One body in the pictures of several calibrated, synchronous cameras: one solve a frame with the 2-D terms of all of them.
//!
//! The whole recording is there, so frames are smoothed by what comes before and after: nothing lags. Where the person was not seen for two frames or more, they
//! are found anew, and the frames between are filled from both sides.

mod begin;
mod between;
mod pose;
mod recording;

pub use pose::{RoomPose, Sight};

use super::labels::label;
use super::lengths::{Lengths, Places};
use super::reading::Exchange;
use super::terms::View;
use super::triangulate::{LocatedBody, locate};
use crate::landmarks::BodyLandmarks;
use nalgebra::{Matrix3, Vector3};
use recording::Recording;
use spmm3::Skeleton;

/// Sweeps that smooth.
const SWEEPS: usize = 2;
/// Lengths are measured in so many frames, so many times: distances between landmarks depend on the pose, and the pose on the lengths.
const MEASURED: usize = 24;
const MEASURINGS: usize = 4;

/// A recording's body.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomMotion {
    /// A pose for each frame.
    pub poses: Vec<RoomPose>,
    /// The skeleton that was fitted: as long as the person.
    pub skeleton: Skeleton,
    /// The landmarks in the world for each frame, where two cameras agree; not smoothed.
    pub located: Vec<LocatedBody>,
}

/// Fits one body to what cameras saw, `frames[frame][camera]` with pixels on the camera's [`View`], `step_seconds` apart. What a frame holds beyond the
/// views is left out, and a camera that it lacks saw nothing. A person whom a single camera sees is as far away as the skeleton's size says
/// ([`Sight::Doubtful`]): [`super::BodyFit`] knows more of that case.
#[must_use]
pub fn fit(
    skeleton: &Skeleton,
    views: &[View],
    frames: &[Vec<Option<BodyLandmarks>>],
    step_seconds: f64,
) -> RoomMotion {
    let (labels, located) = located(views, frames);
    let step = step_seconds.clamp(1e-3, 1.0);
    let mut recording = Recording::new(skeleton, views, frames, &labels, &located, step);
    let skeleton = measured(skeleton, &mut recording, &located);
    let mut followed = recording.follow();
    for _ in 0..SWEEPS {
        recording.smooth(&mut followed);
    }
    RoomMotion {
        poses: recording.poses(&followed),
        skeleton,
        located,
    }
}

/// A skeleton as long as the person whom the cameras saw: that of [`fit`], without the motion.
#[must_use]
pub fn measure(
    skeleton: &Skeleton,
    views: &[View],
    frames: &[Vec<Option<BodyLandmarks>>],
) -> Skeleton {
    let (labels, located) = located(views, frames);
    // Lengths are measured frame by frame, without time.
    let mut recording = Recording::new(skeleton, views, frames, &labels, &located, 1.0);
    measured(skeleton, &mut recording, &located)
}

/// For each frame, whose sides each camera has exchanged, and where the landmarks are.
fn located(
    views: &[View],
    frames: &[Vec<Option<BodyLandmarks>>],
) -> (Vec<Vec<Exchange>>, Vec<LocatedBody>) {
    let mut labels = Vec::with_capacity(frames.len());
    let mut located: Vec<LocatedBody> = Vec::with_capacity(frames.len());
    for seen in frames {
        let before = located.last().filter(|before| {
            let known = before.iter().flatten().count();
            known > before.len() / 2
        });
        let exchanges = label(views, seen, before);
        located.push(locate(views, seen, &exchanges));
        labels.push(exchanges);
    }
    (labels, located)
}

/// The skeleton with the person's lengths, by frames in which cameras agree; the recording goes on with it.
fn measured(
    skeleton: &Skeleton,
    recording: &mut Recording<'_>,
    located: &[LocatedBody],
) -> Skeleton {
    let agreed = recording.agreed();
    let every = agreed.len().div_ceil(MEASURED).max(1);
    let chosen: Vec<usize> = agreed.into_iter().step_by(every).collect();
    let seen: Vec<LocatedBody> = chosen.iter().map(|frame| located[*frame]).collect();
    let mut lengths = Lengths::default();
    let mut shaped = skeleton.clone();
    for _ in 0..MEASURINGS {
        let own: Vec<Places> = chosen.iter().map(|k| recording.places(*k)).collect();
        lengths = lengths.measured(&seen, &own);
        shaped = lengths.shape(skeleton);
        recording.set_skeleton(&shaped);
    }
    shaped
}

/// The view of a camera that stands still.
#[must_use]
pub fn view(
    camera_from_world: glam::DMat3,
    translation: glam::DVec3,
    focal: f64,
    centre: glam::DVec2,
) -> View {
    let [x, y, z] = [0, 1, 2].map(|row| {
        let row = camera_from_world.row(row);
        nalgebra::RowVector3::new(row.x, row.y, row.z)
    });
    View {
        camera_from_world: Matrix3::from_rows(&[x, y, z]),
        translation: Vector3::new(translation.x, translation.y, translation.z),
        focal,
        centre: nalgebra::Vector2::new(centre.x, centre.y),
    }
}
