//! SMPL-X and AMASS archives: body and hands are the 165 pose values of [`MotionParams`] already.
//!
//! Read: `poses` with 165 (SMPL-X), 156 (SMPL+H: no face), 75 (body with face), 72 (SMPL), 66 (root and body) or 63
//! (body) numbers a frame, or the split keys of an SMPL-X fit. Shape (`betas`) is another body's and left out; so are
//! translations' scale. AMASS stands on z = 0 with z up, fits from video often have y down: the way up is taken from
//! AMASS's own `mocap_framerate` key, and otherwise from where the head is over the hips on average. `expression` is of
//! the basis that a string `expression_basis` names, else of FLAME 2020, SMPL-X's own.

use super::{
    MAX_FRAMES, MotionClip, MotionError,
    ground::{self, Height},
    npy::{Npz, NpzArray},
    range,
};
use crate::{EXPRESSION, ExpressionBasis, Joint, MotionParams, Skeleton};
use glam::{Mat3, Quat, Vec3};

/// Keys of the frame rate, frames per second.
const RATES: [&str; 5] = [
    "mocap_framerate",
    "mocap_frame_rate",
    "fps",
    "frame_rate",
    "framerate",
];
/// Key of the name of the expression's basis.
const BASIS: &str = "expression_basis";
/// Rate when the file says none.
const DEFAULT_RATE: f64 = 30.0;

/// Reads an archive.
pub(super) fn read(bytes: &[u8], skeleton: &Skeleton) -> Result<MotionClip, MotionError> {
    let mut npz = Npz::open(bytes)?;
    let mut notes = Vec::new();
    let (rate, rate_key) = rate(&mut npz, &mut notes)?;
    // AMASS's own spelling; others write `fps`.
    let amass = rate_key.is_some_and(|key| key.starts_with("mocap_"));
    let mut frames = match npz.array("poses")? {
        Some(poses) => from_poses(&poses, &mut notes)?,
        None => from_split(&mut npz, &mut notes)?,
    };
    if let Some(fault) = range::time_fault(1.0 / rate, frames.len()) {
        return Err(match rate_key {
            Some(key) => MotionError::array(key, format!("gives {rate} frames a second: {fault}")),
            None => MotionError::array(
                RATES[0],
                format!("is missing, and {DEFAULT_RATE} frames a second are assumed: {fault}"),
            ),
        });
    }
    if let Some(expression) = npz.array("expression")? {
        let width = expression.width();
        let rows = rows_for(&expression, "expression", width, frames.len())?;
        for (frame, row) in frames.iter_mut().zip(rows) {
            for (to, from) in frame.expression_mut().iter_mut().zip(row) {
                *to = *from;
            }
        }
        if width > EXPRESSION {
            notes.push(format!(
                "expression: the first {EXPRESSION} of {width} coefficients"
            ));
        }
    }
    let expression_basis = expression_basis(&mut npz, &frames)?;
    let mut travels = false;
    for name in ["trans", "transl"] {
        if let Some(trans) = npz.array(name)? {
            travels = true;
            let count = frames.len();
            for (frame, row) in frames.iter_mut().zip(rows_for(&trans, name, 3, count)?) {
                frame.root_translation = Vec3::from_slice(row);
            }
            break;
        }
    }
    if let Some(name) = npz.names().iter().find(|name| *name == "betas") {
        notes.push(format!(
            "`{name}` left out: this avatar has its own shape, and travel keeps the file's metres"
        ));
    }
    // As the file has it, so that the message names the file's own value.
    range::check(&frames)?;
    turn_up(&mut frames, skeleton, amass, &mut notes);
    let height = if travels {
        Height::Travels
    } else {
        Height::Unknown
    };
    ground::stand(&mut frames, 1.0 / rate, skeleton, height);
    range::check(&frames)?;
    Ok(MotionClip {
        name: String::new(),
        frames,
        frame_seconds: 1.0 / rate,
        expression_basis,
        notes,
        unmapped: Vec::new(),
    })
}

/// Frames per second, and the key that says so.
fn rate(
    npz: &mut Npz<'_>,
    notes: &mut Vec<String>,
) -> Result<(f64, Option<&'static str>), MotionError> {
    for key in RATES {
        if let Some(array) = npz.array(key)? {
            let rate = array.values.first().copied().map_or(0.0, f64::from);
            return Ok((rate, Some(key)));
        }
    }
    notes.push(format!(
        "no frame rate in the file: {DEFAULT_RATE} frames per second"
    ));
    Ok((DEFAULT_RATE, None))
}

/// The basis of the expression that the frames have by now; `None` where all of them are at rest, in any basis.
fn expression_basis(
    npz: &mut Npz<'_>,
    frames: &[MotionParams],
) -> Result<Option<ExpressionBasis>, MotionError> {
    let basis = match npz.text(BASIS)? {
        Some(name) => ExpressionBasis::new(name)
            .map_err(|e| MotionError::array(BASIS, format!("is refused: {e}")))?,
        None => ExpressionBasis::FLAME_2020,
    };
    let moves = |frame: &MotionParams| frame.expression().iter().any(|v| *v != 0.0);
    Ok(frames.iter().any(moves).then_some(basis))
}

/// The rows of `array`, after checking their width and number; one row serves all `frames`.
fn rows_for<'a>(
    array: &'a NpzArray,
    name: &str,
    width: usize,
    frames: usize,
) -> Result<Box<dyn Iterator<Item = &'a [f32]> + 'a>, MotionError> {
    let flat = array.rows(name, width)?;
    let count = flat.len().checked_div(width).unwrap_or(0);
    if count == 1 {
        return Ok(Box::new(std::iter::repeat_n(flat, frames)));
    }
    if count != frames {
        return Err(MotionError::array(
            name,
            format!("has {count} frames where the poses have {frames}"),
        ));
    }
    Ok(Box::new(flat.chunks_exact(width.max(1))))
}

fn check_frames(name: &str, count: usize) -> Result<(), MotionError> {
    match count {
        0 => Err(MotionError::array(name, "has no frames")),
        count if count > MAX_FRAMES => Err(MotionError::TooLarge {
            what: "the .npz's number of frames",
            size: count as u64,
            limit: MAX_FRAMES as u64,
        }),
        _ => Ok(()),
    }
}

/// First joints of the runs that a row of `poses` is made of, by its width.
fn layout(width: usize) -> Option<&'static [(Joint, usize)]> {
    Some(match width {
        165 => &[(Joint::Pelvis, 55)],
        156 => &[(Joint::Pelvis, 22), (Joint::LeftIndex1, 30)],
        75 => &[(Joint::Pelvis, 25)],
        72 | 66 => &[(Joint::Pelvis, 22)],
        63 => &[(Joint::LeftHip, 21)],
        _ => return None,
    })
}

fn from_poses(poses: &NpzArray, notes: &mut Vec<String>) -> Result<Vec<MotionParams>, MotionError> {
    let width = poses.width();
    let layout = layout(width).ok_or_else(|| {
        MotionError::array(
            "poses",
            format!(
                "has shape {:?}; [frames, 165], 156, 75, 72, 66 or 63 are known",
                poses.shape
            ),
        )
    })?;
    let rows = poses.rows("poses", width)?;
    check_frames("poses", rows.len() / width)?;
    notes.push(format!("poses of {width} numbers a frame"));
    rows.chunks_exact(width)
        .enumerate()
        .map(|(frame, row)| {
            let mut motion = MotionParams::default();
            let mut at = 0;
            for (first, count) in layout {
                copy_joints(&mut motion, frame, *first, &row[at..at + 3 * count])?;
                at += 3 * count;
            }
            Ok(motion)
        })
        .collect()
}

fn from_split(
    npz: &mut Npz<'_>,
    notes: &mut Vec<String>,
) -> Result<Vec<MotionParams>, MotionError> {
    let Some(body) = npz.array("body_pose")? else {
        let names = npz.names();
        let found: Vec<_> = names.iter().take(12).map(String::as_str).collect();
        return Err(MotionError::array(
            "poses",
            format!(
                "is missing, and so is `body_pose`: this is no SMPL-X motion (it holds {:.400})",
                found.join(", ")
            ),
        ));
    };
    // SMPL's body_pose ends with two hand joints that SMPL-X replaces.
    let width = if body.width() == 69 { 69 } else { 63 };
    let count = body.rows("body_pose", width)?.len() / width;
    check_frames("body_pose", count)?;
    let mut frames = vec![MotionParams::default(); count];
    let rows = rows_for(&body, "body_pose", width, count)?;
    for ((at, frame), row) in frames.iter_mut().enumerate().zip(rows) {
        copy_joints(frame, at, Joint::LeftHip, &row[..63])?;
    }
    let keys: [(&[&str], Joint, usize); 6] = [
        (&["global_orient", "root_orient"], Joint::Pelvis, 3),
        (&["jaw_pose"], Joint::Jaw, 3),
        (&["leye_pose"], Joint::LeftEye, 3),
        (&["reye_pose"], Joint::RightEye, 3),
        (&["left_hand_pose"], Joint::LeftIndex1, 45),
        (&["right_hand_pose"], Joint::RightIndex1, 45),
    ];
    for (names, first, width) in keys {
        for name in names {
            let Some(array) = npz.array(name)? else {
                continue;
            };
            if width == 45 && array.width() < 45 {
                notes.push(format!(
                    "`{name}` left out: it holds {} PCA coefficients, whose basis is the SMPL-X model's",
                    array.width()
                ));
                continue;
            }
            let rows = rows_for(&array, name, width, count)?;
            for ((at, frame), row) in frames.iter_mut().enumerate().zip(rows) {
                copy_joints(frame, at, first, row)?;
            }
        }
    }
    Ok(frames)
}

fn copy_joints(
    motion: &mut MotionParams,
    frame: usize,
    first: Joint,
    values: &[f32],
) -> Result<(), MotionError> {
    for (joint, value) in Joint::ALL
        .into_iter()
        .skip(first.index())
        .zip(values.chunks_exact(3))
    {
        range::check_turn(frame, joint, value)?;
        // Through a quaternion: files hold vectors longer than a turn, which interpolate badly.
        motion.set_rotation(joint, Quat::from_scaled_axis(Vec3::from_slice(value)));
    }
    Ok(())
}

/// Turns the clip so that up is y. The pelvis pivots about its own rest position, which the turn leaves in place.
fn turn_up(frames: &mut [MotionParams], skeleton: &Skeleton, amass: bool, notes: &mut Vec<String>) {
    let up = if amass {
        notes.push("AMASS's axes: z up, turned to y up".to_owned());
        Vec3::Z
    } else {
        let step = (frames.len() / 200).max(1);
        let mean: Vec3 = frames
            .iter()
            .step_by(step)
            .map(|frame| {
                let joints = skeleton.pose(frame);
                (joints.position(Joint::Head) - joints.position(Joint::Pelvis)).normalize_or_zero()
            })
            .sum();
        let candidates = [
            (Vec3::Y, "y up"),
            (Vec3::Z, "z up, turned to y up"),
            (Vec3::NEG_Y, "y down (a camera's), turned to y up"),
        ];
        let (up, name) = candidates
            .into_iter()
            .max_by(|a, b| a.0.dot(mean).total_cmp(&b.0.dot(mean)))
            .unwrap_or(candidates[0]);
        notes.push(format!("axes, from where the heads are: {name}"));
        up
    };
    let turn = if up == Vec3::Y {
        return;
    } else if up == Vec3::Z {
        Quat::from_mat3(&Mat3::from_cols(Vec3::X, Vec3::NEG_Z, Vec3::Y))
    } else {
        Quat::from_mat3(&Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0)))
    };
    for frame in frames {
        let root = frame.rotation(Joint::Pelvis);
        frame.set_rotation(Joint::Pelvis, turn * root);
        frame.root_translation = turn * frame.root_translation;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::JOINTS;
    use std::io::{Cursor, Write};
    use zip::{ZipWriter, write::SimpleFileOptions};

    fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header =
            format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}\n");
        let length = u16::try_from(header.len()).expect("short").to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
    }

    fn floats(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    /// Two frames of a person at rest with ten coefficients of `value`, and a basis as NumPy would write it.
    fn clip(value: f32, basis: Option<Vec<u8>>) -> Result<MotionClip, MotionError> {
        let mut members = vec![
            ("poses", npy("<f4", "2, 165", &floats(&[0.0; 330]))),
            ("expression", npy("<f4", "2, 10", &floats(&[value; 20]))),
        ];
        members.extend(basis.map(|basis| ("expression_basis", basis)));
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in members {
            zip.start_file(format!("{name}.npy"), SimpleFileOptions::default())
                .expect("a member");
            zip.write_all(&bytes).expect("bytes");
        }
        let bytes = zip.finish().expect("an archive").into_inner();
        let mut rest = [Vec3::ZERO; JOINTS];
        rest[Joint::Head.index()] = Vec3::Y;
        read(&bytes, &Skeleton::new(rest).expect("in range"))
    }

    #[test]
    fn an_expression_is_flames_unless_the_file_names_its_basis() {
        let basis = |value, text| clip(value, text).expect("a good file").expression_basis;
        assert_eq!(basis(0.0, None), None, "a face at rest is so in any basis");
        assert_eq!(
            basis(0.5, None),
            Some(ExpressionBasis::FLAME_2020),
            "SMPL-X's"
        );
        let bytes = npy("|S10", "", b"arkit-52\0\0");
        assert_eq!(
            basis(0.5, Some(bytes)),
            Some(ExpressionBasis::ARKIT_52),
            "bytes"
        );
        let wide = |big: bool| -> Vec<u8> {
            "arkit-52"
                .chars()
                .map(u32::from)
                .flat_map(|c| {
                    if big {
                        c.to_be_bytes()
                    } else {
                        c.to_le_bytes()
                    }
                })
                .collect()
        };
        let text = npy("<U8", "", &wide(false));
        assert_eq!(
            basis(0.5, Some(text)),
            Some(ExpressionBasis::ARKIT_52),
            "text"
        );
        let text = npy(">U8", "1,", &wide(true));
        assert_eq!(
            basis(0.5, Some(text)),
            Some(ExpressionBasis::ARKIT_52),
            "the other order"
        );
    }

    #[test]
    fn a_basis_that_is_no_short_text_is_refused_with_the_arrays_name() {
        let broken = [
            npy("<f4", "", &[0; 4]),
            npy("<U8", "3,", &[0; 96]),
            npy("<U99999999999", "", &[0; 4]),
            npy("<U8", "", &[0; 7]),
            npy("<U0", "", &[]),
            npy("<U2", "", &[0xff; 8]),
            npy("|S3", "", b"a b"),
            npy("|S1", "", b"\0"),
        ];
        for bytes in broken {
            let error = clip(0.5, Some(bytes)).expect_err("refused").to_string();
            assert!(error.contains("expression_basis"), "{error}");
        }
    }
}
