//! The whole capture: motions chosen, the cloth simulated, cameras placed, pictures drawn and written, the truth beside them.

use crate::draw::Scene;
use crate::error::SynthesisError;
use crate::lens::Lens;
use crate::model::Model;
use crate::noise::Noise;
use crate::performance::Performance;
use crate::ring::Ring;
use crate::sitter::Sitter;
use crate::truth;
use capture::{Camera, CaptureWriter, FramePose, HeldOut, MOST_CAMERAS, Photograph};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use reconstruct::Person;
use reconstruct::bake::puppet;
use spmm3::{ExpressionBasis, Joint, MotionClip, MotionParams};
use std::path::Path;
use std::sync::Mutex;

/// The most frames of a capture: their surfaces are in memory at once, a third of a megabyte each.
pub const MOST_FRAMES: usize = 10_000;

/// Without a motion of its own to hold out, the last of so many frames are.
const HELD_OUT_SHARE: usize = 4;

/// What is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SynthesisOptions {
    /// Cameras, and their pictures.
    pub ring: Ring,
    /// Frames of each motion that is trained on.
    pub frames: usize,
    /// Frames of the last motion, which is held out if there are several.
    pub held_out_frames: usize,
    /// Cameras that are held out.
    pub held_out_cameras: usize,
    /// Whether the person turns once about the vertical in each motion that is trained on.
    pub turn: bool,
    /// Behind the person, display values.
    pub background: [u8; 3],
    /// Errors of what is written besides the pictures.
    pub noise: Noise,
}

/// What is being done, for a progress line.
pub trait Progress: Sync {
    /// A step of `total` parts begins.
    fn begin(&self, step: &'static str, total: usize);
    /// A part of the step is done.
    fn advance(&self);
}

/// What was made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Synthesis {
    /// Cameras.
    pub cameras: usize,
    /// Frames of every camera.
    pub frames: usize,
    /// What is held out.
    pub held_out: HeldOut,
}

impl SynthesisOptions {
    fn check(&self, motions: usize) -> Result<(), SynthesisError> {
        let refuse = |what: String| Err(SynthesisError::Options(what));
        let frames = self.frames.max(self.held_out_frames);
        if motions == 0 || self.frames == 0 || (motions > 1 && self.held_out_frames == 0) {
            return refuse("a capture needs at least one motion and one frame of each".to_owned());
        }
        if frames.saturating_mul(motions) > MOST_FRAMES {
            return refuse(format!(
                "{motions} motions of {frames} frames are too many: {MOST_FRAMES} frames are possible"
            ));
        }
        if !(1..=MOST_CAMERAS).contains(&self.ring.cameras) {
            return refuse(format!(
                "{} cameras are not possible: 1 to {MOST_CAMERAS} are",
                self.ring.cameras
            ));
        }
        if self.held_out_cameras >= self.ring.cameras {
            return refuse(format!(
                "{} of {} cameras cannot be held out: one must be left to train with",
                self.held_out_cameras, self.ring.cameras
            ));
        }
        if !(0.5..=100.0).contains(&self.ring.radius) {
            return refuse(format!(
                "cameras cannot stand {} m from the person: 0.5 to 100 m are possible",
                self.ring.radius
            ));
        }
        Ok(())
    }

    /// The moments of every motion; of the last one as many as are held out.
    fn performances(&self, clips: &[MotionClip]) -> Vec<Performance> {
        let last = clips.len() - 1;
        (clips.iter().enumerate())
            .map(|(k, clip)| {
                let held_out = k == last && k > 0;
                let count = if held_out {
                    self.held_out_frames
                } else {
                    self.frames
                };
                let performance = Performance::of(clip, count);
                if self.turn && !held_out {
                    performance.turning()
                } else {
                    performance
                }
            })
            .collect()
    }

    /// The last motion's frames, or the last quarter of the only one's.
    fn held_out(&self, performances: &[Performance], frames: usize) -> HeldOut {
        let count = match performances {
            [.., last] if performances.len() > 1 => last.motions.len(),
            _ => frames / HELD_OUT_SHARE,
        };
        HeldOut {
            cameras: self.ring.held_out(self.held_out_cameras),
            frames: (frames - count..frames).collect(),
        }
    }
}

/// Makes a capture of `person` in the folder, which must not hold one yet: the clips' motions, whose expressions must be of the person's own
/// basis. The last clip is held out, if there are several.
///
/// # Errors
/// Options out of range; a person who reaches past a camera; a folder that cannot be written.
pub fn synthesise(
    folder: &Path,
    person: &Person,
    clips: &[MotionClip],
    options: &SynthesisOptions,
    progress: &dyn Progress,
) -> Result<Synthesis, SynthesisError> {
    options.check(clips.len())?;
    let model = Model::new(person)?;
    let puppet = puppet(person);
    let sitter = Sitter::new(person, &puppet, &model);
    let performances = options.performances(clips);
    let motions: Vec<MotionParams> = (performances.iter())
        .flat_map(|performance| performance.motions.iter().cloned())
        .collect();
    progress.begin("simulating cloth", motions.len());
    let surfaces = sitter.all(&motions, || progress.advance());
    let joints: Vec<Vec<Vec3>> = motions.iter().map(|m| sitter.joints(m)).collect();
    let lenses = options.ring.lenses(&surfaces)?;
    let cameras: Vec<Camera> = (lenses.iter().enumerate())
        .map(|(number, lens)| camera(number, &options.noisy(number, lens, &surfaces)))
        .collect();
    let held_out = options.held_out(&performances, motions.len());
    let frame_rate = (clips.first())
        .map(|clip| options.frames as f64 / clip.duration().max(1e-3))
        .unwrap_or_default();
    let writer = CaptureWriter::create(
        folder,
        &cameras,
        motions.len(),
        frame_rate.clamp(0.01, 1000.0),
    )?
    .with_expression_basis(Some(ExpressionBasis::MAKEHUMAN_1));
    progress.begin("drawing", motions.len() * lenses.len());
    // Frames one after the other, whose light is shared by their cameras; within a frame every core has work.
    for (frame, positions) in surfaces.into_iter().enumerate() {
        let posed = sitter.lit(positions);
        let scene = Scene::new(&model, &posed);
        let failed = Mutex::new(None);
        lenses.par_iter().enumerate().for_each(|(number, lens)| {
            let drawn = scene.draw(lens, options.background);
            let photograph = Photograph {
                size: drawn.size,
                rgb: drawn.rgb,
                mask: Some(drawn.mask),
            };
            if let Err(error) = writer.write(number, frame, &photograph) {
                let mut first = failed
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                first.get_or_insert(error);
            }
            progress.advance();
        });
        if let Some(error) = failed
            .into_inner()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
        {
            return Err(error.into());
        }
    }
    let poses: Vec<FramePose> = (motions.iter().zip(&joints).zip(0u64..))
        .map(|((motion, joints), number)| {
            let pelvis = joints[Joint::Pelvis.index()];
            let (mut parameters, pelvis) = options.noise.pose(motion, pelvis, number);
            parameters.root_translation = Vec3::ZERO;
            FramePose { parameters, pelvis }
        })
        .collect();
    truth::write(folder, person, &lenses, &performances, &joints)?;
    // The capture is finished by this, so it comes last.
    writer.finish(Some(&poses), &held_out)?;
    Ok(Synthesis {
        cameras: lenses.len(),
        frames: poses.len(),
        held_out,
    })
}

impl SynthesisOptions {
    /// The camera as the capture says it is.
    fn noisy(&self, number: usize, lens: &Lens, surfaces: &[Vec<Vec3>]) -> Lens {
        let seen: Vec<Vec3> = surfaces.iter().filter_map(|s| s.first().copied()).collect();
        let sum: DVec3 = seen.iter().map(|point| point.as_dvec3()).sum();
        let middle = sum / seen.len().max(1) as f64;
        let distance = lens.eye().distance(middle);
        self.noise.camera(lens, distance, number as u64)
    }
}

fn camera(number: usize, lens: &Lens) -> Camera {
    Camera {
        name: Ring::name(number),
        size: lens.size,
        focal: lens.focal,
        centre: lens.centre,
        distortion: [0.0; 5],
        camera_from_world: lens.camera_from_world,
    }
}
