//! A clip as an SMPL-X/AMASS archive, which this crate's reader and the tools around SMPL-X take.

use super::{MotionClip, MotionError};
use crate::{Joint, Skeleton};
use glam::{Mat3, Quat, Vec3};
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// NumPy's format 1.0 wants the data at a multiple of this.
const ALIGNMENT: usize = 64;

impl MotionClip {
    /// The clip as AMASS writes SMPL-X motion: z up, `poses` [F, 165] (axis-angle, radians), `trans` [F, 3] (metres, of the root
    /// relative to the pelvis at rest in `skeleton`), `expression` [F, 50], `betas` (zero: the body is the avatar's own),
    /// `mocap_frame_rate`, `gender`, `surface_model_type`, and `expression_basis` where it is known.
    ///
    /// # Errors
    /// [`MotionError`] if the archive cannot be written.
    pub fn to_npz(&self, skeleton: &Skeleton) -> Result<Vec<u8>, MotionError> {
        // From y up to z up; the pelvis turns with the whole, and SMPL-X's translation is counted from its place at rest.
        let turn = Quat::from_mat3(&Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::NEG_Y));
        let rest = skeleton.rest_positions()[Joint::Pelvis.index()];
        let (mut poses, mut trans, mut expression) = (Vec::new(), Vec::new(), Vec::new());
        for frame in &self.frames {
            let mut turned = frame.clone();
            turned.set_rotation(Joint::Pelvis, turn * frame.rotation(Joint::Pelvis));
            poses.extend_from_slice(turned.body());
            poses.extend_from_slice(turned.hands());
            trans.extend((turn * (rest + frame.root_translation) - rest).to_array());
            expression.extend_from_slice(frame.expression());
        }
        let frames = self.frames.len();
        let mut archive = NpzWriter::default();
        archive.numbers("poses", &[frames, 165], &poses)?;
        archive.numbers("trans", &[frames, 3], &trans)?;
        archive.numbers("expression", &[frames, 50], &expression)?;
        archive.numbers("betas", &[10], &[0.0; 10])?;
        let rate = self.frame_seconds.recip().to_le_bytes();
        archive.array("mocap_frame_rate", "<f8", &[], &rate)?;
        archive.text("gender", "neutral")?;
        archive.text("surface_model_type", "smplx")?;
        if let Some(basis) = &self.expression_basis {
            archive.text("expression_basis", basis.name())?;
        }
        archive.finish()
    }
}

/// Writes NumPy arrays into an `.npz` archive in memory, deflated.
#[derive(Debug)]
pub struct NpzWriter {
    archive: ZipWriter<Cursor<Vec<u8>>>,
}

impl Default for NpzWriter {
    /// Without arrays.
    fn default() -> Self {
        Self {
            archive: ZipWriter::new(Cursor::new(Vec::new())),
        }
    }
}

impl NpzWriter {
    /// Adds an array of single precision, row-major.
    ///
    /// # Errors
    /// [`MotionError::Archive`] if it cannot be written: a name that is there already, for instance.
    pub fn numbers(
        &mut self,
        name: &str,
        shape: &[usize],
        values: &[f32],
    ) -> Result<(), MotionError> {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.array(name, "<f4", shape, &bytes)
    }

    /// Adds a single text, as NumPy stores it: UTF-32.
    ///
    /// # Errors
    /// As [`Self::numbers`].
    pub fn text(&mut self, name: &str, text: &str) -> Result<(), MotionError> {
        let bytes: Vec<u8> = text
            .chars()
            .flat_map(|c| u32::from(c).to_le_bytes())
            .collect();
        let kind = format!("<U{}", text.chars().count());
        self.array(name, &kind, &[], &bytes)
    }

    /// The archive's bytes.
    ///
    /// # Errors
    /// As [`Self::numbers`].
    pub fn finish(self) -> Result<Vec<u8>, MotionError> {
        Ok(self.archive.finish()?.into_inner())
    }

    fn array(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        data: &[u8],
    ) -> Result<(), MotionError> {
        let archive = &mut self.archive;
        // A Python tuple: one size is followed by a comma.
        let shape: String = shape.iter().map(|size| format!("{size},")).collect();
        let mut header =
            format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
        // Magic, version and the header's length are 10 bytes, its end is a line's.
        let used = 10 + header.len() + 1;
        header.extend(std::iter::repeat_n(
            ' ',
            used.next_multiple_of(ALIGNMENT) - used,
        ));
        header.push('\n');
        let length = u16::try_from(header.len()).unwrap_or(u16::MAX);
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        archive.start_file(format!("{name}.npy"), options)?;
        let mut write = |bytes: &[u8]| {
            archive
                .write_all(bytes)
                .map_err(zip::result::ZipError::from)
        };
        write(b"\x93NUMPY\x01\x00")?;
        write(&length.to_le_bytes())?;
        write(header.as_bytes())?;
        write(data)?;
        Ok(())
    }
}
