//! Videos of cameras that stand still: several with a calibration, or a single one.

use crate::error::CompletionError;
use crate::pictures::{Pictures, Take};
use capture::{Camera, read_qualisys, upright};
use glam::{DAffine3, DMat3, DVec3};
use std::path::{Path, PathBuf};
use tracker::source::{self, Picture, Source, SourceChoice};

/// A calibration file's ending.
const CALIBRATION: &str = ".qca.txt";
/// Encoders pad pictures to blocks of so many pixels on the right and below; calibrations may count the padding.
const PADDING: u32 = 16;
/// Endings of videos.
const ENDINGS: [&str; 6] = ["mp4", "mov", "mkv", "webm", "avi", "y4m"];

/// Videos of cameras that stand still.
#[derive(Debug)]
pub struct Videos {
    files: Vec<PathBuf>,
    /// As they took the pictures.
    lenses: Vec<Camera>,
    cameras: Vec<Camera>,
    frames: usize,
    frame_rate: f64,
    /// Pictures of the videos from one frame to the next.
    every: usize,
    posed: bool,
    /// What was decided or left out, one sentence each.
    pub notes: Vec<String>,
}

impl Videos {
    /// A folder with a Qualisys calibration (`*.qca.txt`) and for each of its cameras a video named as its serial, synchronous from the first frame
    /// on; as Pose2Sim's demonstration is. The calibration's z is up.
    ///
    /// # Errors
    /// No such folder, calibration or video; a video of another size than its camera, or of another rate than the others.
    pub fn calibrated(folder: &Path) -> Result<Self, CompletionError> {
        let wrong = |reason: String| CompletionError::Video {
            path: folder.to_owned(),
            reason,
        };
        let list = |e: std::io::Error| wrong(format!("cannot be read: {e}"));
        let mut names: Vec<String> = (std::fs::read_dir(folder).map_err(list)?)
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort();
        let calibration = (names.iter().find(|name| name.ends_with(CALIBRATION)))
            .ok_or_else(|| wrong(format!("has no calibration *{CALIBRATION}")))?;
        let lenses = upright(&read_qualisys(&folder.join(calibration))?);
        let mut files = Vec::with_capacity(lenses.len());
        for lens in &lenses {
            let file = (names.iter())
                .find(|name| {
                    let parts = name.rsplit_once('.');
                    parts.is_some_and(|(stem, ending)| {
                        stem == lens.name && ENDINGS.contains(&ending)
                    })
                })
                .ok_or_else(|| wrong(format!("has no video of camera `{}`", lens.name)))?;
            files.push(folder.join(file));
        }
        Self::opened(files, lenses, true)
    }

    /// A single video of a camera that stands still, whose field of view along the longer side is so many degrees. Where the camera is follows from
    /// the person: the world is the room that the fit finds.
    ///
    /// # Errors
    /// A video that cannot be read; a field of view out of 5 to 150 degrees.
    pub fn single(file: &Path, view_degrees: f64) -> Result<Self, CompletionError> {
        if !(5.0..=150.0).contains(&view_degrees) {
            return Err(CompletionError::Video {
                path: file.to_owned(),
                reason: format!(
                    "was given a field of view of {view_degrees} degrees: 5 to 150 are possible"
                ),
            });
        }
        let info = open(file)?.info().clone();
        let size = [info.width, info.height];
        let longer = f64::from(size[0].max(size[1]));
        let focal = longer / 2.0 / (view_degrees.to_radians() / 2.0).tan();
        let lens = Camera {
            name: "camera".to_owned(),
            size,
            focal: [focal; 2],
            centre: size.map(|side| f64::from(side) / 2.0),
            distortion: [0.0; 5],
            // Level, at the origin, until the fit knows better.
            camera_from_world: DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(
                1.0, -1.0, -1.0,
            ))),
        };
        lens.check()?;
        Self::opened(vec![file.to_owned()], vec![lens], false)
    }

    /// Only one picture of so many becomes a frame: an avatar learns more from different poses than from many of one.
    #[must_use]
    pub fn every(mut self, pictures: usize) -> Self {
        let pictures = pictures.max(1);
        self.frames = self.frames.div_ceil(pictures);
        #[expect(clippy::cast_precision_loss, reason = "a small number of pictures")]
        {
            self.frame_rate /= pictures as f64;
        }
        self.every *= pictures;
        self
    }

    fn opened(
        files: Vec<PathBuf>,
        mut lenses: Vec<Camera>,
        posed: bool,
    ) -> Result<Self, CompletionError> {
        let mut notes = Vec::new();
        let mut counts = Vec::with_capacity(files.len());
        let mut rate: Option<f64> = None;
        for (file, lens) in files.iter().zip(&mut lenses) {
            let wrong = |reason: String| CompletionError::Video {
                path: file.clone(),
                reason,
            };
            let mut video = open(file)?;
            let info = video.info().clone();
            let [width, height] = lens.size;
            let padding = |calibrated: u32, found: u32| {
                calibrated
                    .checked_sub(found)
                    .is_some_and(|pixels| pixels < PADDING)
            };
            if padding(width, info.width) && padding(height, info.height) {
                if (info.width, info.height) != (width, height) {
                    notes.push(format!(
                        "camera `{}` was calibrated at {width} x {height} pixels, of which the video has the first {} x {}",
                        lens.name, info.width, info.height
                    ));
                }
                lens.size = [info.width, info.height];
            } else {
                return Err(wrong(format!(
                    "has {} x {} pixels where camera `{}` has {width} x {height}",
                    info.width, info.height, lens.name
                )));
            }
            let own = info.rate_hz.unwrap_or(30.0);
            match rate {
                Some(rate) if (rate - own).abs() > 0.01 * rate => {
                    return Err(wrong(format!(
                        "has {own} frames a second where the others have {rate}: synchronous cameras have one rate"
                    )));
                }
                _ => rate = Some(own),
            }
            // What a container says of its length is not always so.
            let mut count = 0;
            let mut picture = Picture::empty();
            while count < capture::MOST_FRAMES && video.next(&mut picture)? {
                count += 1;
            }
            counts.push(count);
        }
        let frames = counts.iter().copied().min().unwrap_or(0);
        if counts.iter().any(|count| *count != frames) {
            notes.push(format!(
                "the videos have {counts:?} frames: the first {frames} of each are taken"
            ));
        }
        if frames == 0 {
            return Err(CompletionError::Nobody { frames });
        }
        Ok(Self {
            files,
            cameras: lenses.iter().map(Camera::undistorted).collect(),
            lenses,
            frames,
            frame_rate: rate.unwrap_or(30.0),
            every: 1,
            posed,
            notes,
        })
    }
}

fn open(file: &Path) -> Result<Box<dyn Source>, CompletionError> {
    let y4m = file.extension().is_some_and(|ending| ending == "y4m");
    Ok(source::open(&if y4m {
        SourceChoice::Y4m(file.to_owned())
    } else {
        SourceChoice::File(file.to_owned())
    })?)
}

impl Pictures for Videos {
    fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn frame_rate(&self) -> f64 {
        self.frame_rate
    }

    fn posed(&self) -> bool {
        self.posed
    }

    fn each(&mut self, camera: usize, take: &mut Take<'_>) -> Result<(), CompletionError> {
        let (Some(file), Some(lens)) = (self.files.get(camera), self.lenses.get(camera)) else {
            return Ok(());
        };
        let mut video = open(file)?;
        let mut picture = Picture::empty();
        for frame in 0..self.frames {
            let left_out = if frame == 0 { 0 } else { self.every - 1 };
            for _ in 0..=left_out {
                if !video.next(&mut picture)? {
                    return Err(CompletionError::Video {
                        path: file.clone(),
                        reason: format!("ends at frame {frame}, but had {} before", self.frames),
                    });
                }
            }
            take(
                frame,
                lens.photograph(std::mem::take(&mut picture.rgb), None)?,
            )?;
        }
        Ok(())
    }
}
