//! How the person stands in each frame, and the file of it: `motion.npz`.

use crate::error::CaptureError;
use glam::Vec3;
use spmm3::{
    EXPRESSION, ExpressionBasis, Joint, MotionError, MotionParams, Npz, NpzArray, NpzWriter,
    Skeleton,
};
use std::io::Read;
use std::path::Path;

/// Bytes of the largest file.
const MAX_FILE: u64 = 256 << 20;
/// Numbers of a row of `poses`: SMPL-X's 55 joints.
const POSES: usize = 165;
/// The face's basis in `motion.npz`.
const BASIS: &str = "expression_basis";
/// Furthest pelvis from the origin, metres.
const FURTHEST: f32 = 1e4;

/// How the person stands in a frame, independent of any skeleton's size.
#[derive(Debug, Clone, PartialEq)]
pub struct FramePose {
    /// Joints and face; its `root_translation` is not used and zero.
    pub parameters: MotionParams,
    /// The pelvis joint in the world, metres.
    pub pelvis: Vec3,
}

impl FramePose {
    /// The motion of a skeleton that stands so: the parameters with the root translation that brings its pelvis joint to [`Self::pelvis`].
    #[must_use]
    pub fn on(&self, skeleton: &Skeleton) -> MotionParams {
        let mut motion = self.parameters.clone();
        motion.root_translation = self.pelvis - skeleton.rest_positions()[Joint::Pelvis.index()];
        motion
    }

    /// The pose of a skeleton's motion.
    #[must_use]
    pub fn of(motion: &MotionParams, skeleton: &Skeleton) -> Self {
        let mut parameters = motion.clone();
        parameters.root_translation = Vec3::ZERO;
        Self {
            parameters,
            pelvis: skeleton.rest_positions()[Joint::Pelvis.index()] + motion.root_translation,
        }
    }

    pub(crate) fn fault(&self) -> Option<&'static str> {
        let near = self.pelvis.abs().max_element() < FURTHEST;
        // The largest of numbers ignores one that is none.
        if !(self.parameters.is_finite() && self.pelvis.is_finite()) {
            Some("has a number that is not finite")
        } else if !near {
            Some("has its pelvis further than 10 km away")
        } else {
            None
        }
    }
}

/// The bytes of an archive of arrays.
pub(crate) fn read_archive(path: &Path) -> Result<Vec<u8>, CaptureError> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MAX_FILE + 1).read_to_end(&mut bytes))
        .map_err(|source| CaptureError::read(path, source))?;
    if bytes.len() as u64 > MAX_FILE {
        let reason = format!("has more than {} MiB", MAX_FILE >> 20);
        return Err(CaptureError::field(path, "the file", reason));
    }
    Ok(bytes)
}

/// An array that must be there, with rows of a width.
pub(crate) fn needed(
    path: &Path,
    archive: &mut Npz<'_>,
    name: &str,
    width: usize,
) -> Result<NpzArray, CaptureError> {
    let array = (archive
        .array(name)
        .map_err(|e| CaptureError::motion(path, e))?)
    .ok_or_else(|| CaptureError::field(path, name, "is missing"))?;
    array
        .rows(name, width)
        .map_err(|e| CaptureError::motion(path, e))?;
    Ok(array)
}

/// Reads `motion.npz`: `poses` [F, 165] (axis-angle, radians), `expression` [F, 50], `pelvis` [F, 3] (world, metres, y up) and the text
/// `expression_basis`, which may be missing.
pub(crate) fn read(
    path: &Path,
    frames: usize,
) -> Result<(Vec<FramePose>, Option<ExpressionBasis>), CaptureError> {
    let bytes = read_archive(path)?;
    let fail = |e: MotionError| CaptureError::motion(path, e);
    let mut archive = Npz::open(&bytes).map_err(fail)?;
    let poses = needed(path, &mut archive, "poses", POSES)?;
    let expression = needed(path, &mut archive, "expression", EXPRESSION)?;
    let pelvis = needed(path, &mut archive, "pelvis", 3)?;
    for (name, array, width) in [
        ("poses", &poses, POSES),
        ("expression", &expression, EXPRESSION),
        ("pelvis", &pelvis, 3),
    ] {
        let rows = array.values.len() / width;
        if rows != frames {
            let reason = format!("has {rows} frames where the capture has {frames}");
            return Err(CaptureError::field(path, name, reason));
        }
    }
    let basis = archive.text(BASIS).map_err(fail)?;
    let basis = basis
        .map(ExpressionBasis::new)
        .transpose()
        .map_err(|e| CaptureError::field(path, BASIS, format!("is refused: {e}")))?;
    let rows = (poses.values.chunks_exact(POSES))
        .zip(expression.values.chunks_exact(EXPRESSION))
        .zip(pelvis.values.chunks_exact(3));
    let mut found = Vec::with_capacity(frames);
    for (frame, ((pose, expression), pelvis)) in rows.enumerate() {
        let mut parameters = MotionParams::default();
        for (joint, turn) in Joint::ALL.into_iter().zip(pose.chunks_exact(3)) {
            parameters.set_axis_angle(joint, Vec3::from_slice(turn));
        }
        parameters.expression_mut().copy_from_slice(expression);
        let pose = FramePose {
            parameters,
            pelvis: Vec3::from_slice(pelvis),
        };
        if let Some(fault) = pose.fault() {
            let reason = format!("{fault} in frame {frame}");
            return Err(CaptureError::field(path, "poses, pelvis", reason));
        }
        found.push(pose);
    }
    Ok((found, basis))
}

/// The bytes of `motion.npz`.
pub(crate) fn encode(
    poses: &[FramePose],
    basis: Option<&ExpressionBasis>,
) -> Result<Vec<u8>, MotionError> {
    let frames = poses.len();
    let (mut turns, mut expression, mut pelvis) = (Vec::new(), Vec::new(), Vec::new());
    for pose in poses {
        for joint in Joint::ALL {
            turns.extend(pose.parameters.axis_angle(joint).to_array());
        }
        expression.extend_from_slice(pose.parameters.expression());
        pelvis.extend(pose.pelvis.to_array());
    }
    let mut archive = NpzWriter::default();
    archive.numbers("poses", &[frames, POSES], &turns)?;
    archive.numbers("expression", &[frames, EXPRESSION], &expression)?;
    archive.numbers("pelvis", &[frames, 3], &pelvis)?;
    if let Some(basis) = basis {
        archive.text(BASIS, basis.name())?;
    }
    archive.finish()
}
