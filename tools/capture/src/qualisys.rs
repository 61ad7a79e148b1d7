//! Calibrations as Qualisys writes them (`.qca.txt`), such as Pose2Sim's demonstration has: for importing videos.

use crate::camera::{Camera, MOST_CAMERAS};
use crate::error::CaptureError;
use crate::json;
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// All cameras of a Qualisys calibration, in its order, in this crate's conventions but for the world's axes, which are the file's: Qualisys has z up
/// ([`upright`] turns them). The file has millimetres, 64ths of pixels, and cameras that look along -z with y up.
///
/// # Errors
/// [`CaptureError::Field`] with the camera's number and the element that is missing or impossible.
pub fn read_qualisys(file: &Path) -> Result<Vec<Camera>, CaptureError> {
    let text = json::read_text(file)?;
    let document = roxmltree::Document::parse(&text)
        .map_err(|e| CaptureError::field(file, "the file", format!("is no XML: {e}")))?;
    let cameras: Vec<Camera> = (document.descendants())
        .filter(|node| node.has_tag_name("camera"))
        .take(MOST_CAMERAS)
        .enumerate()
        .map(|(number, node)| camera(file, number, node))
        .collect::<Result<_, _>>()?;
    if cameras.is_empty() {
        return Err(CaptureError::field(file, "camera", "is missing"));
    }
    Ok(cameras)
}

/// The same cameras in a world whose y is up, where theirs had z up.
#[must_use]
pub fn upright(cameras: &[Camera]) -> Vec<Camera> {
    // z becomes y, y becomes -z.
    let z_up_from_y_up = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
    (cameras.iter())
        .map(|camera| Camera {
            camera_from_world: camera.camera_from_world * DAffine3::from_mat3(z_up_from_y_up),
            ..camera.clone()
        })
        .collect()
}

fn camera(
    file: &Path,
    number: usize,
    node: roxmltree::Node<'_, '_>,
) -> Result<Camera, CaptureError> {
    let wrong = |field: &str, reason: &str| {
        CaptureError::field(file, format!("camera {} {field}", number + 1), reason)
    };
    let child = |name: &str| {
        (node.children().find(|node| node.has_tag_name(name)))
            .ok_or_else(|| wrong(name, "is missing"))
    };
    let (transform, intrinsic, view) = (
        child("transform")?,
        child("intrinsic")?,
        child("fov_video")?,
    );
    let value = |node: &roxmltree::Node<'_, '_>, name: &str| -> Result<f64, CaptureError> {
        (node
            .attribute(name)
            .and_then(|text| text.parse::<f64>().ok()))
        .filter(|value| value.is_finite())
        .ok_or_else(|| wrong(name, "is missing or no number"))
    };
    let pixels = |name: &str| Ok::<_, CaptureError>(value(&intrinsic, name)? / 64.0);
    let side = |first: &str, last: &str| {
        let side = value(&view, last)? - value(&view, first)? + 1.0;
        if side.fract() != 0.0 || !(1.0..=f64::from(crate::LARGEST_SIDE)).contains(&side) {
            return Err(wrong(last, "gives no possible size of a picture"));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number in range, checked above"
        )]
        Ok(side as u32)
    };
    // The file's rows, read as columns: its rotation leads from the camera to the world once transposed.
    let mut columns = [DVec3::ZERO; 3];
    for (column, k) in columns.iter_mut().zip(1..) {
        for axis in 0..3 {
            column[axis] = value(&transform, &format!("r{k}{}", axis + 1))?;
        }
    }
    let world_from_camera = DMat3::from_cols(columns[0], columns[1], columns[2]);
    let at = |name: &str| Ok::<_, CaptureError>(value(&transform, name)? / 1e3);
    let at = DVec3::new(at("x")?, at("y")?, at("z")?);
    let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * world_from_camera.transpose();
    let camera = Camera {
        name: (node.attribute("serial").map(str::to_owned))
            .unwrap_or_else(|| format!("camera{}", number + 1)),
        size: [side("left", "right")?, side("top", "bottom")?],
        focal: [pixels("focalLengthU")?, pixels("focalLengthV")?],
        centre: [pixels("centerPointU")?, pixels("centerPointV")?],
        distortion: [
            pixels("radialDistortion1")?,
            pixels("radialDistortion2")?,
            pixels("tangentalDistortion1")?,
            pixels("tangentalDistortion2")?,
            0.0,
        ],
        camera_from_world: DAffine3 {
            matrix3: turn,
            translation: -(turn * at),
        },
    };
    match camera.fault() {
        Some((field, reason)) => {
            let theirs = match field {
                "name" => "serial",
                "size" => "fov_video",
                "focal" => "focalLengthU, focalLengthV",
                "centre" => "centerPointU, centerPointV",
                "distortion" => "radialDistortion1 to tangentalDistortion2",
                _ if camera.far_away() => "x, y, z",
                _ => "r11 to r33",
            };
            Err(wrong(theirs, &reason))
        }
        None => Ok(camera),
    }
}
