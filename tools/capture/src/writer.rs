//! Writing our own layout. `capture.json` is written last, under another name first: a capture without it is not finished. Until then a marker stands in the
//! folder: what lies beside it is this program's, and may be written over.

use crate::camera::{Camera, MOST_CAMERAS};
use crate::error::CaptureError;
use crate::held_out::HeldOut;
use crate::layouts::{MANIFEST, MOST_FRAMES, OWN_FRAMES, OWN_MASKS, OWN_MOTION, manifest};
use crate::photograph::Photograph;
use crate::pose::{self, FramePose};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use spmm3::ExpressionBasis;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Stands in a folder while a capture is written there.
const MARKER: &str = "capture.unfinished";
/// What it says to whoever opens it.
const MARKER_TEXT: &str =
    "A capture was being written here. Making it again writes over frames, masks and motion.npz.\n";

/// What was written of a camera's frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Written {
    Nothing,
    Picture,
    PictureAndMask,
}

/// Writes a capture in our own layout; pictures may be written by several threads in any order.
#[derive(Debug)]
pub struct CaptureWriter {
    folder: PathBuf,
    cameras: Vec<Camera>,
    frames: usize,
    frame_rate: f64,
    expression_basis: Option<ExpressionBasis>,
    /// [camera][frame].
    written: Mutex<Vec<Vec<Written>>>,
}

impl CaptureWriter {
    /// Makes the folders. A capture that was not finished there is written over; what others put there is not.
    ///
    /// # Errors
    /// Cameras that [`Camera::check`] refuses, that share a name or have a distortion (a [`Photograph`] has none: hand over
    /// [`Camera::undistorted`]); no frames, or an impossible rate; a folder that already holds a capture, or others' files by the names of a
    /// capture's, or cannot be written.
    pub fn create(
        folder: &Path,
        cameras: &[Camera],
        frames: usize,
        frame_rate: f64,
    ) -> Result<Self, CaptureError> {
        let refuse = |reason: String| Err(CaptureError::Request(reason));
        if cameras.is_empty() || cameras.len() > MOST_CAMERAS {
            return refuse(format!(
                "a capture has 1 to {MOST_CAMERAS} cameras, not {}",
                cameras.len()
            ));
        }
        for (k, camera) in cameras.iter().enumerate() {
            camera.check()?;
            let wrong = |reason: &str| {
                Err(CaptureError::Camera {
                    name: camera.name.clone(),
                    reason: reason.to_owned(),
                })
            };
            if camera.distortion != [0.0; 5] {
                return wrong(
                    "photographs are undistorted, but `distortion` is not zero: hand over `undistorted()`",
                );
            }
            if cameras[..k].iter().any(|other| other.name == camera.name) {
                return wrong("`name` is another camera's as well");
            }
        }
        let rate_fits = frame_rate > 0.0 && frame_rate <= 1000.0;
        if !(1..=MOST_FRAMES).contains(&frames) || !rate_fits {
            return refuse(format!(
                "a capture has 1 to {MOST_FRAMES} frames at up to 1000 Hz, not {frames} at {frame_rate}"
            ));
        }
        if folder.join(MANIFEST).exists() {
            return refuse(format!(
                "{} already holds a capture: remove it, or name another folder",
                folder.display()
            ));
        }
        clear(folder)?;
        for camera in cameras {
            let made = folder.join(OWN_FRAMES).join(&camera.name);
            fs::create_dir_all(&made).map_err(|e| CaptureError::write(&made, e))?;
        }
        Ok(Self {
            folder: folder.to_owned(),
            cameras: cameras.to_owned(),
            frames,
            frame_rate,
            expression_basis: None,
            written: Mutex::new(vec![vec![Written::Nothing; frames]; cameras.len()]),
        })
    }

    /// Names the basis of the poses' expressions.
    #[must_use]
    pub fn with_expression_basis(mut self, basis: Option<ExpressionBasis>) -> Self {
        self.expression_basis = basis;
        self
    }

    /// Places a camera: for one whose pose is found only once its pictures were looked at.
    ///
    /// # Errors
    /// No such camera, or a pose that [`Camera::check`] refuses.
    pub fn place(
        &mut self,
        camera: usize,
        camera_from_world: glam::DAffine3,
    ) -> Result<(), CaptureError> {
        let count = self.cameras.len();
        let Some(placed) = self.cameras.get_mut(camera) else {
            return Err(CaptureError::Request(format!(
                "camera {camera} is none of the capture's {count}"
            )));
        };
        placed.camera_from_world = camera_from_world;
        placed.check()
    }

    /// Writes a camera's picture of a frame, and its mask if it has one.
    ///
    /// # Errors
    /// No such camera or frame; a photograph of another size than the camera's; a file that cannot be written.
    pub fn write(
        &self,
        camera: usize,
        frame: usize,
        photograph: &Photograph,
    ) -> Result<(), CaptureError> {
        let Some(of) = self.cameras.get(camera).filter(|_| frame < self.frames) else {
            return Err(CaptureError::Request(format!(
                "camera {camera}, frame {frame} is outside the {} cameras and {} frames of the capture",
                self.cameras.len(),
                self.frames
            )));
        };
        photograph.check()?;
        if photograph.size != of.size {
            return Err(CaptureError::Request(format!(
                "camera `{}` has pictures of {:?} pixels, the photograph has {:?}",
                of.name, of.size, photograph.size
            )));
        }
        let path = |kind: &str| {
            let folder = self.folder.join(kind).join(&of.name);
            folder.join(format!("{frame:06}.png"))
        };
        write_png(
            &path(OWN_FRAMES),
            &photograph.rgb,
            of.size,
            ExtendedColorType::Rgb8,
        )?;
        if let Some(mask) = &photograph.mask {
            let path = path(OWN_MASKS);
            if let Some(folder) = path.parent() {
                fs::create_dir_all(folder).map_err(|e| CaptureError::write(folder, e))?;
            }
            write_png(&path, mask, of.size, ExtendedColorType::L8)?;
        }
        let now = match photograph.mask {
            Some(_) => Written::PictureAndMask,
            None => Written::Picture,
        };
        // A thread that died while it held the lock left no half-written entry.
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(entry) = written.get_mut(camera).and_then(|c| c.get_mut(frame)) {
            *entry = now;
        }
        Ok(())
    }

    /// Writes the motion, if there is one, and then `capture.json`: the capture is finished.
    ///
    /// # Errors
    /// A picture that was not written; masks for some frames of a camera only; poses that are not one a frame or not finite; held out
    /// indices that are not there, not ascending, or all of them; a file that cannot be written.
    pub fn finish(
        self,
        poses: Option<&[FramePose]>,
        held_out: &HeldOut,
    ) -> Result<(), CaptureError> {
        let refuse = |reason: String| Err(CaptureError::Request(reason));
        let written = (self.written.into_inner()).unwrap_or_else(PoisonError::into_inner);
        for (camera, frames) in self.cameras.iter().zip(&written) {
            let masked = frames.first() == Some(&Written::PictureAndMask);
            for (frame, of) in frames.iter().enumerate() {
                if *of == Written::Nothing {
                    return refuse(format!(
                        "frame {frame} of camera `{}` was not written",
                        camera.name
                    ));
                }
                if (*of == Written::PictureAndMask) != masked {
                    return refuse(format!(
                        "camera `{}` has masks for some frames and none for frame {}",
                        camera.name,
                        if masked { frame } else { 0 }
                    ));
                }
            }
        }
        if let Some(fault) = held_out.fault(self.cameras.len(), self.frames) {
            return refuse(format!("what is held out {fault}"));
        }
        if let Some(poses) = poses {
            write_motion(
                &self.folder,
                poses,
                self.frames,
                self.expression_basis.as_ref(),
            )?;
        }
        let value = manifest(&self.cameras, self.frames, self.frame_rate, held_out);
        write_manifest(&self.folder, &value)?;
        let marker = self.folder.join(MARKER);
        fs::remove_file(&marker).map_err(|e| CaptureError::write(&marker, e))
    }
}

/// Checks and writes `motion.npz`.
pub(crate) fn write_motion(
    folder: &Path,
    poses: &[FramePose],
    frames: usize,
    basis: Option<&ExpressionBasis>,
) -> Result<(), CaptureError> {
    if poses.len() != frames {
        return Err(CaptureError::Request(format!(
            "{} poses were given for {frames} frames",
            poses.len(),
        )));
    }
    let mut numbered = poses.iter().enumerate();
    let fault = numbered.find_map(|(frame, pose)| Some((frame, pose.fault()?)));
    if let Some((frame, fault)) = fault {
        return Err(CaptureError::Request(format!(
            "the pose of frame {frame} {fault}"
        )));
    }
    let path = folder.join(OWN_MOTION);
    let bytes = pose::encode(poses, basis).map_err(|e| CaptureError::motion(&path, e))?;
    replace(&path, &bytes)
}

/// Writes `capture.json`.
pub(crate) fn write_manifest(folder: &Path, value: &serde_json::Value) -> Result<(), CaptureError> {
    replace(&folder.join(MANIFEST), format!("{value:#}\n").as_bytes())
}

/// Writes a file under another name first: whenever it is broken off, the file is the old one or the new one.
fn replace(path: &Path, bytes: &[u8]) -> Result<(), CaptureError> {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    let half = PathBuf::from(name);
    fs::write(&half, bytes).map_err(|e| CaptureError::write(&half, e))?;
    fs::rename(&half, path).map_err(|e| CaptureError::write(path, e))
}

/// Takes away what is left of a capture that was not finished, which must not be taken for the next one's, and marks the folder.
fn clear(folder: &Path) -> Result<(), CaptureError> {
    let marker = folder.join(MARKER);
    let own = [OWN_FRAMES, OWN_MASKS, OWN_MOTION].map(|name| folder.join(name));
    let mut old = own.iter().filter(|old| old.symlink_metadata().is_ok());
    if !marker.exists() {
        if let Some(old) = old.next() {
            return Err(CaptureError::Request(format!(
                "{} is there already, and no capture that was broken off left it (there is no {MARKER}): name another folder, or move it away",
                old.display()
            )));
        }
        fs::create_dir_all(folder).map_err(|e| CaptureError::write(folder, e))?;
        return fs::write(&marker, MARKER_TEXT).map_err(|e| CaptureError::write(&marker, e));
    }
    for old in old {
        // A link is taken away, not what it leads to.
        let kind = old.symlink_metadata().map(|of| of.is_dir());
        let removed = kind.and_then(|folder| match folder {
            true => fs::remove_dir_all(old),
            false => fs::remove_file(old),
        });
        removed.map_err(|e| CaptureError::write(old, e))?;
    }
    Ok(())
}

fn write_png(
    path: &Path,
    pixels: &[u8],
    size: [u32; 2],
    kind: ExtendedColorType,
) -> Result<(), CaptureError> {
    let failed = |e: std::io::Error| CaptureError::write(path, e);
    let mut file = BufWriter::new(fs::File::create(path).map_err(failed)?);
    // A capture has thousands of pictures: time counts more than a tenth of their bytes.
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(pixels, size[0], size[1], kind)
        .map_err(|e| failed(std::io::Error::other(e)))?;
    file.flush().map_err(failed)
}
