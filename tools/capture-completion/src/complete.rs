//! Everything at once: photographs in, a capture in our own layout out, with masks and motion.

use crate::error::CompletionError;
use crate::look::{Networks, look};
use crate::motion::{Motion, fit_motion};
use crate::pictures::Pictures;
use capture::{CaptureWriter, HeldOut};
use motion_fit::Subject;
use motion_fit::landmarks::Observation;
use std::path::Path;

/// What was found on the way.
#[derive(Debug)]
pub struct Completed {
    /// The motion that was written.
    pub motion: Motion,
    /// By camera, then by frame: what the networks saw, pixels on the cameras' pinholes.
    pub observations: Vec<Vec<Observation>>,
}

/// Writes `pictures` as a capture into `folder`: with the masks they have, or the network's, and with the motion of `subject`'s skeleton and face. Frames in
/// which a camera saw nobody get an empty mask. What is `held_out` is written down as kept away from training. `progress` hears of each frame of each camera that is done.
///
/// # Errors
/// What reading, the networks and writing fail with, and [`CompletionError::Nobody`].
pub fn complete(
    pictures: &mut dyn Pictures,
    subject: &Subject<'_>,
    networks: &Networks,
    folder: &Path,
    held_out: &HeldOut,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Completed, CompletionError> {
    let cameras = pictures.cameras().to_vec();
    let (frames, rate, posed) = (pictures.frames(), pictures.frame_rate(), pictures.posed());
    let mut writer = CaptureWriter::create(folder, &cameras, frames, rate)?
        .with_expression_basis(Some(subject.expression_basis.clone()));
    let mut observations: Vec<Vec<Observation>> = Vec::with_capacity(cameras.len());
    for camera in 0..cameras.len() {
        let mut seen = Vec::with_capacity(frames);
        look(pictures, camera, networks, &mut |mut look| {
            let pixels = look.photograph.rgb.len() / 3;
            look.photograph.mask.get_or_insert_with(|| vec![0; pixels]);
            writer.write(camera, look.frame, &look.photograph)?;
            seen.push(look.observation);
            progress(camera, look.frame);
            Ok(())
        })?;
        observations.push(seen);
    }
    let somebody = (observations.iter().flatten()).any(|seen| seen.body_landmarks().is_some());
    if !somebody {
        return Err(CompletionError::Nobody { frames });
    }
    let motion = fit_motion(subject, &cameras, &observations, rate, posed);
    if let Some(pose) = motion.camera_from_world {
        writer.place(0, pose)?;
    }
    writer.finish(Some(&motion.poses), held_out)?;
    Ok(Completed {
        motion,
        observations,
    })
}
