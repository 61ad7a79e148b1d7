//! What the published data sets share: a folder of numbered frames and one of masks for each camera, possibly with gaps, and SMPL-X's parameters.

use super::found::{Found, Pictures};
use super::own::MOST_FRAMES;
use super::{smpl_params, upright};
use crate::camera::Camera;
use crate::error::CaptureError;
use crate::files::Numbered;
use crate::held_out::HeldOut;
use spmm3::ExpressionBasis;
use std::path::{Path, PathBuf};

/// A camera and where its pictures are.
pub(super) struct Shots {
    pub(super) camera: Camera,
    /// Folder and beginning of the names.
    pub(super) frames: (PathBuf, String),
    pub(super) masks: (PathBuf, String),
}

/// Puts a data set together. Frames that some camera lacks are left out, and said; a camera without a folder is an error, as a calibration that
/// does not belong to the pictures would be one.
pub(super) fn gather(
    folder: &Path,
    shots: Vec<Shots>,
    frame_rate: f64,
) -> Result<Found, CaptureError> {
    let mut notes = vec![format!(
        "frame rate, which the data does not state: {frame_rate} Hz"
    )];
    let mut cameras = Vec::with_capacity(shots.len());
    let mut listed = Vec::with_capacity(shots.len());
    for shot in shots {
        let frames = Numbered::list(&shot.frames.0, &shot.frames.1)?;
        let masks = (shot.masks.0.is_dir())
            .then(|| Numbered::list(&shot.masks.0, &shot.masks.1))
            .transpose()?;
        cameras.push(shot.camera);
        listed.push((frames, masks));
    }
    let all = listed.iter().flat_map(|(frames, _)| frames.numbers());
    let mut all: Vec<u32> = all.copied().collect();
    all.sort_unstable();
    all.dedup();
    let complete = |number: &u32| {
        (listed.iter()).all(|(frames, masks)| {
            frames.has(*number) && masks.as_ref().is_none_or(|masks| masks.has(*number))
        })
    };
    let numbers: Vec<u32> = all.iter().copied().filter(complete).collect();
    let Some(first) = numbers.first() else {
        return Err(CaptureError::Layout {
            folder: folder.to_owned(),
            reason: "no frame has a picture and a mask of every camera".to_owned(),
        });
    };
    if numbers.len() > MOST_FRAMES {
        return Err(CaptureError::Layout {
            folder: folder.to_owned(),
            reason: format!("it has more than {} frames", MOST_FRAMES),
        });
    }
    if numbers.len() < all.len() {
        notes.push(format!(
            "{} of {} frames left out: not every camera has their picture and mask; the first that is there is {first}",
            all.len() - numbers.len(),
            all.len()
        ));
    }
    let poses = smpl_params::read(folder, &numbers)?;
    if poses.is_some() {
        notes.push(smpl_params::NOTE.to_owned());
    }
    let pictures = (listed.into_iter())
        .map(|(frames, masks)| Pictures {
            frames: frames.into_names(),
            masks: masks.map(Numbered::into_names),
        })
        .collect();
    let mut found = Found {
        cameras,
        pictures,
        numbers,
        frame_rate,
        expression_basis: poses.as_ref().map(|_| ExpressionBasis::FLAME_2020),
        poses,
        held_out: HeldOut::default(),
        notes,
    };
    upright::turn_up(&mut found);
    Ok(found)
}
