//! Everything at once: photographs in, a capture in our own layout out, with masks and motion.

use crate::cut_out::cut_out;
use crate::error::CompletionError;
use crate::look::{Look, Networks, look};
use crate::motion::{Motion, fit_motion};
use crate::pictures::Pictures;
use crate::plate::PlateBuilder;
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

/// Writes `pictures` as a capture into `folder`: with the masks they have, or the network's, which are brought to the person's outlines where the camera sees
/// what is behind the person in other frames; and with the motion of `subject`'s skeleton and face. Frames in
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
    for (camera, of) in cameras.iter().enumerate() {
        let mut seen = Vec::with_capacity(frames);
        let mut masks = Vec::with_capacity(frames);
        let mut builder = PlateBuilder::new(of.size, frames);
        look(pictures, camera, networks, &mut |look| {
            if let Some(grain) = look.grain {
                builder.add(look.frame, &look.photograph, grain);
            }
            masks.push(Made::of(&look));
            seen.push(look.observation);
            progress(camera, look.frame);
            Ok(())
        })?;
        observations.push(seen);
        // Once more: what is behind the person is known only now.
        let plate = builder.finish();
        pictures.each(camera, &mut |frame, mut photograph| {
            if photograph.mask.is_none() {
                let pixels = photograph.rgb.len() / 3;
                photograph.mask = Some(vec![0; pixels]);
                if let Some(Made { grain, mask }) = masks.get(frame).and_then(Option::as_ref) {
                    photograph.mask = Some(unpacked(mask, pixels));
                    if let Some(better) = cut_out(&photograph, *grain, &plate) {
                        photograph.mask = Some(better);
                    }
                }
            }
            Ok(writer.write(camera, frame, &photograph)?)
        })?;
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

/// A network's mask, kept until what is behind the person is known.
#[derive(Debug)]
struct Made {
    grain: f32,
    /// Runs of equal values: how long, and which.
    mask: Vec<(u32, u8)>,
}

impl Made {
    fn of(look: &Look) -> Option<Self> {
        let (grain, mask) = (look.grain?, look.photograph.mask.as_ref()?);
        let mut runs: Vec<(u32, u8)> = Vec::new();
        for value in mask {
            match runs.last_mut() {
                Some((length, of)) if of == value => *length += 1,
                _ => runs.push((1, *value)),
            }
        }
        Some(Self { grain, mask: runs })
    }
}

/// The mask of so many pixels that runs stand for.
fn unpacked(runs: &[(u32, u8)], pixels: usize) -> Vec<u8> {
    let mut mask: Vec<u8> = (runs.iter())
        .flat_map(|(length, value)| std::iter::repeat_n(*value, *length as usize))
        .collect();
    mask.resize(pixels, 0);
    mask
}
