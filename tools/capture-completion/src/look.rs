//! What the networks see in a camera's photographs: landmarks, and the person's mask where there is none yet.

use crate::error::CompletionError;
use crate::matte::refine;
use crate::pictures::Pictures;
use capture::Photograph;
use motion_fit::landmarks::Observation;
use npu_runtime::{Provider, Runtime};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tracker::Tracker;
use tracker::mediapipe::{Options, PersonMask};
use tracker::networks::NetworkSet;
use tracker::source::Picture;

/// Hands and faces that are followed are searched anew in one picture of so many.
const SEARCH_EVERY: u32 = 5;

/// Where the networks are and what runs them.
#[derive(Debug)]
pub struct Networks {
    folder: PathBuf,
    runtime: Runtime,
}

impl Networks {
    /// The networks in a folder, run by `runtime`; without a folder, in the one that the environment names.
    ///
    /// # Errors
    /// [`CompletionError::Tracker`] if it names none.
    pub fn new(folder: Option<&Path>, runtime: Runtime) -> Result<Self, CompletionError> {
        Ok(Self {
            folder: match folder {
                Some(folder) => folder.to_owned(),
                None => NetworkSet::folder_of_environment()?,
            },
            runtime,
        })
    }
}

/// One photograph, looked at.
#[derive(Debug)]
pub struct Look {
    /// The frame.
    pub frame: usize,
    /// With a mask: its own, or the network's; none where no person was seen and it had none.
    pub photograph: Photograph,
    /// If the mask is the network's: the side of one of its values, pixels.
    pub grain: Option<f32>,
    /// What was seen.
    pub observation: Observation,
}

/// Looks at all photographs of a camera in order.
///
/// # Errors
/// Networks that are missing or fail, and those of `take`.
pub fn look(
    pictures: &mut dyn Pictures,
    camera: usize,
    networks: &Networks,
    take: &mut dyn FnMut(Look) -> Result<(), CompletionError>,
) -> Result<(), CompletionError> {
    let options = Options {
        search_every: SEARCH_EVERY,
        ..Options::default()
    };
    let (folder, runtime) = (&networks.folder, &networks.runtime);
    let mut tracker = Tracker::new(options.load(folder, runtime)?)?;
    let set = NetworkSet::open(folder, &PersonMask::NAMES, runtime)?;
    let mut masks = PersonMask::open(&set, Provider::Cpu { threads: 1 })?;
    let rate = pictures.frame_rate();
    pictures.each(camera, &mut |frame, mut photograph| {
        #[expect(clippy::cast_precision_loss, reason = "frames are far fewer than 2^53")]
        let picture = Arc::new(Picture {
            width: photograph.size[0],
            height: photograph.size[1],
            rgb: std::mem::take(&mut photograph.rgb),
            at: Instant::now(),
            seconds: frame as f64 / rate,
            number: frame as u64,
        });
        let observation = tracker.observe(&picture)?.into_observation();
        let coarse = match (&photograph.mask, observation.body_landmarks()) {
            (None, Some(body)) => masks.run(picture.view()?, body)?,
            _ => None,
        };
        photograph.rgb = Arc::unwrap_or_clone(picture).rgb;
        if photograph.mask.is_none() {
            photograph.mask = (coarse.as_ref()).map(|coarse| refine(&photograph, coarse));
        }
        take(Look {
            frame,
            photograph,
            grain: coarse.map(|coarse| coarse.grain),
            observation,
        })
    })
}
