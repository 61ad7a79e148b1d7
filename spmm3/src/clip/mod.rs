//! Motion clips: motion without a live sender. A BVH file, an SMPL-X / AMASS archive or a built-in
//! performance become a list of [`MotionParams`], retargeted onto this avatar's skeleton.
//!
//! Conventions: y up, metres, the captured heading kept. A clip begins with the hips above the origin of the floor
//! (x = z = 0), and its soles stand on y = 0.

mod built_in;
mod bvh;
mod error;
mod face;
mod ground;
mod hands;
mod names;
mod npy;
mod plan;
mod range;
mod retarget;
mod score;
mod smplx;
mod source;
mod stance;
mod timed;
mod write;

pub use built_in::{LOOP_SECONDS, at_ease};
pub use error::MotionError;
pub use face::fit_expression;
pub use npy::{Npz, NpzArray};
pub use stance::{LEGS, bend_leg};
pub use write::NpzWriter;

use crate::{EXPRESSION, ExpressionBasis, Expressions, Joint, MotionParams, Skeleton};
use std::{io::Read, path::Path};

/// Frames of the longest clip: 28 minutes at 120 Hz, 170 MB in memory. `range` has the longest time.
const MAX_FRAMES: usize = 200_000;
/// Bytes of the largest motion file.
const MAX_FILE: u64 = 256 << 20;

/// A named run of motion at a fixed frame rate.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionClip {
    /// Where it comes from: the file's name, or `built-in`.
    pub name: String,
    /// At least one frame; a single one is a pose.
    pub frames: Vec<MotionParams>,
    /// Seconds from one frame to the next.
    pub frame_seconds: f64,
    /// The basis that the expression's coefficients are of. `None`: the avatar's own, for which the clip was made, or the face is at
    /// rest. [`Self::fit_expression`] turns them into an avatar's.
    pub expression_basis: Option<ExpressionBasis>,
    /// What the reader decided or left out, one sentence each: units, axes, arrays left out.
    pub notes: Vec<String>,
    /// Names of the file's joints that move nothing here, in the file's order; [`Self::unmapped_summary`] is shorter.
    pub unmapped: Vec<String>,
}

/// What the caller may set where the file does not say it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LoadOptions {
    /// Metres per BVH unit. `None`: found from the length of the legs, and the travel is fitted to this avatar's legs.
    /// With a value the travel over the floor is taken exactly as the file has it. An `.npz` is in metres and takes none.
    pub bvh_scale: Option<f32>,
}

/// What [`MotionClip::sample`] returns past the ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Playback {
    /// Hold the first and the last frame.
    Clamp,
    /// Begin again; the last frame leads to the first within one frame's time.
    Loop,
}

impl MotionClip {
    /// Reads a motion file and retargets it onto `skeleton`. The format is detected by the content.
    ///
    /// # Errors
    /// If the path is a folder or cannot be read, or the file is of no known kind, is damaged, or shows no person, or
    /// the options do not go with its kind.
    pub fn load(
        path: &Path,
        skeleton: &Skeleton,
        options: &LoadOptions,
    ) -> Result<Self, MotionError> {
        let read = |source| MotionError::Read {
            path: path.to_owned(),
            source,
        };
        let about = std::fs::metadata(path).map_err(read)?;
        if about.is_dir() {
            return Err(MotionError::Folder {
                path: path.to_owned(),
            });
        }
        let mut bytes = Vec::new();
        // A pipe or a device tells no size beforehand.
        std::fs::File::open(path)
            .and_then(|file| file.take(MAX_FILE + 1).read_to_end(&mut bytes))
            .map_err(read)?;
        if bytes.len() as u64 > MAX_FILE {
            return Err(MotionError::TooLarge {
                what: "the motion file's size in bytes",
                size: about.len().max(bytes.len() as u64),
                limit: MAX_FILE,
            });
        }
        let extension = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase())
            .unwrap_or_default();
        let mut clip = if bytes.starts_with(b"PK\x03\x04") || extension == "npz" {
            if options.bvh_scale.is_some() {
                return Err(MotionError::Request(format!(
                    "a BVH scale was given, but {} is an .npz, whose unit is always the metre: leave the scale out",
                    path.display()
                )));
            }
            Self::from_npz(&bytes, skeleton)?
        } else if looks_like_bvh(&bytes) || extension == "bvh" {
            Self::from_bvh(&String::from_utf8_lossy(&bytes), skeleton, options)?
        } else {
            return Err(MotionError::Kind {
                path: path.to_owned(),
                hint: match extension.as_str() {
                    "npy" => "save the arrays by name with numpy.savez",
                    "pkl" | "pt" | "pth" => "save its arrays by name with numpy.savez",
                    "fbx" | "glb" | "gltf" | "c3d" | "asf" | "amc" | "dae" => {
                        "export the animation as BVH, for example with Blender"
                    }
                    _ => "give a .bvh or .npz file",
                },
            });
        };
        clip.name = path
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        Ok(clip)
    }

    /// Retargets the text of a BVH file onto `skeleton`.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn from_bvh(
        text: &str,
        skeleton: &Skeleton,
        options: &LoadOptions,
    ) -> Result<Self, MotionError> {
        retarget::retarget(&bvh::Bvh::parse(text)?, skeleton, options)
    }

    /// Reads the bytes of an SMPL-X or AMASS `.npz` archive.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn from_npz(bytes: &[u8], skeleton: &Skeleton) -> Result<Self, MotionError> {
        smplx::read(bytes, skeleton)
    }

    /// A person talking, gesturing with both arms and fingers, shifting their weight, looking about and turning: a
    /// performance of [`LOOP_SECONDS`] that is repeated and stretched to fill `seconds`, so that the clip always loops.
    ///
    /// `expressions` are the avatar's presets; a face without presets still moves its jaw and eyes.
    ///
    /// # Errors
    /// If `seconds` or `frames_per_second` is not positive, or their product exceeds the longest clip.
    pub fn built_in(
        skeleton: &Skeleton,
        expressions: &Expressions,
        seconds: f64,
        frames_per_second: f64,
    ) -> Result<Self, MotionError> {
        built_in::perform(skeleton, expressions, seconds, frames_per_second)
    }

    /// The unmapped joints in one line, where names that differ only in digits and side are counted together; `None`
    /// when every joint of the file has a counterpart.
    #[must_use]
    pub fn unmapped_summary(&self) -> Option<String> {
        (!self.unmapped.is_empty()).then(|| {
            format!(
                "{} joints without a counterpart: {}",
                self.unmapped.len(),
                names::summarise(&self.unmapped)
            )
        })
    }

    /// Length in seconds: the number of frames times a frame's time.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.frames.len() as f64 * self.frame_seconds
    }

    /// The motion at a time: rotations slerped along the shortest arc, root translation and expression lerped between
    /// the two nearest frames. A frame's own time gives that frame.
    #[must_use]
    pub fn sample(&self, seconds: f64, playback: Playback) -> MotionParams {
        let Some(last) = self.frames.len().checked_sub(1) else {
            return MotionParams::default();
        };
        let at = seconds / self.frame_seconds;
        let at = if at.is_finite() { at } else { 0.0 };
        let at = match playback {
            Playback::Clamp => at.clamp(0.0, last as f64),
            Playback::Loop => at.rem_euclid(self.frames.len() as f64),
        };
        // A tick's rounding must not turn a frame's own time into a blend.
        let nearest = at.round();
        let at = if (at - nearest).abs() < 1e-6 {
            nearest
        } else {
            at
        };
        let from = floor_index(at) % self.frames.len();
        let to = match playback {
            Playback::Clamp => (from + 1).min(last),
            Playback::Loop => (from + 1) % self.frames.len(),
        };
        let share = at - at.floor();
        if share == 0.0 {
            return self.frames[from].clone();
        }
        blend(&self.frames[from], &self.frames[to], narrow(share))
    }
}

/// Slerp of every joint, lerp of the rest.
fn blend(from: &MotionParams, to: &MotionParams, share: f32) -> MotionParams {
    let mut out = MotionParams::default();
    for joint in Joint::ALL {
        let (a, b) = (from.rotation(joint), to.rotation(joint));
        // glam's slerp takes the shorter arc.
        out.set_rotation(joint, a.slerp(b, share));
    }
    for k in 0..EXPRESSION {
        let (a, b) = (from.expression()[k], to.expression()[k]);
        out.expression_mut()[k] = a + (b - a) * share;
    }
    out.root_translation = from.root_translation.lerp(to.root_translation, share);
    out
}

/// A name from a file, shortened and cleaned for one line of a message or a log.
fn printable(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect()
}

fn looks_like_bvh(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    bytes.trim_ascii_start().starts_with(b"HIERARCHY")
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "seconds and motion values need no more than single precision"
)]
fn narrow(value: f64) -> f32 {
    value as f32
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the caller passes a finite non-negative number below the longest clip's frame count"
)]
fn floor_index(value: f64) -> usize {
    value as usize
}
