//! `smpl_params.npz`, the SMPL-X fits of AvatarReX, THuman4.0 and (by the authors of Animatable Gaussians) ActorsHQ: `global_orient`, `transl`,
//! `body_pose` [F, 63], `jaw_pose`, `expression` [F, n], `left_hand_pose` and `right_hand_pose` [F, 45], `betas`. Row f is the picture of number f; hands are
//! axis-angle without a mean (`flat_hand_mean`); `transl` is in the cameras' world, metres.

use crate::error::CaptureError;
use crate::pose::{self, FramePose};
use glam::Vec3;
use spmm3::{EXPRESSION, Joint, MotionParams, Npz};
use std::path::Path;

/// The file.
pub(super) const SMPL_PARAMS: &str = "smpl_params.npz";

/// The pelvis joint of SMPL-X's neutral mean body at rest, metres: `transl` counts from there. A person's own (`betas`) differs by a few
/// centimetres, which only the licensed model's file could tell.
const MEAN_PELVIS: Vec3 = Vec3::new(0.003_1, -0.351_4, 0.012_0);

/// What is said of it.
pub(super) const NOTE: &str = "smpl_params.npz: the pelvis is where SMPL-X's mean body has it, as `betas` cannot be applied without the model's file; it may be centimetres off";

/// The arrays that turn joints: name, first joint, joints.
const TURNS: [(&str, Joint, usize); 5] = [
    ("global_orient", Joint::Pelvis, 1),
    ("body_pose", Joint::LeftHip, 21),
    ("jaw_pose", Joint::Jaw, 1),
    ("left_hand_pose", Joint::LeftIndex1, 15),
    ("right_hand_pose", Joint::RightIndex1, 15),
];

/// The poses of the pictures of these numbers; `None` where there is no file.
pub(super) fn read(folder: &Path, numbers: &[u32]) -> Result<Option<Vec<FramePose>>, CaptureError> {
    let path = folder.join(SMPL_PARAMS);
    if !path.exists() {
        return Ok(None);
    }
    let bytes = pose::read_archive(&path)?;
    let mut archive = Npz::open(&bytes).map_err(|e| CaptureError::motion(&path, e))?;
    let mut arrays = Vec::with_capacity(TURNS.len());
    for (name, first, joints) in TURNS {
        let array = pose::needed(&path, &mut archive, name, 3 * joints)?;
        arrays.push((name, first, 3 * joints, array));
    }
    let shift = pose::needed(&path, &mut archive, "transl", 3)?;
    let expression = (archive.array("expression")).map_err(|e| CaptureError::motion(&path, e))?;
    let row = |name: &str, values: &[f32], width: usize, number: u32| {
        let at = number as usize;
        let rows = values.len().checked_div(width).unwrap_or(0);
        // One row serves all.
        let at = if rows == 1 { 0 } else { at };
        (values
            .get(at * width..(at + 1) * width)
            .map(<[f32]>::to_vec))
        .ok_or_else(|| {
            let reason = format!("has {rows} frames, but there is a picture of number {number}");
            CaptureError::field(&path, name, reason)
        })
    };
    let mut poses = Vec::with_capacity(numbers.len());
    for number in numbers {
        let mut parameters = MotionParams::default();
        for (name, first, width, array) in &arrays {
            let turns = row(name, &array.values, *width, *number)?;
            let joints = Joint::ALL.into_iter().skip(first.index());
            for (joint, turn) in joints.zip(turns.chunks_exact(3)) {
                parameters.set_axis_angle(joint, Vec3::from_slice(turn));
            }
        }
        if let Some(expression) = &expression {
            let width = expression.width();
            let values = row("expression", &expression.values, width, *number)?;
            for (to, from) in (parameters.expression_mut().iter_mut().take(EXPRESSION)).zip(values)
            {
                *to = from;
            }
        }
        let shift = row("transl", &shift.values, 3, *number)?;
        let pose = FramePose {
            parameters,
            pelvis: MEAN_PELVIS + Vec3::from_slice(&shift),
        };
        if let Some(fault) = pose.fault() {
            let reason = format!("{fault} in frame {number}");
            return Err(CaptureError::field(&path, "transl", reason));
        }
        poses.push(pose);
    }
    Ok(Some(poses))
}
