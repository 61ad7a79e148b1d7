//! ActorsHQ at a quarter of its size: `4x/calibration.csv` (name, w, h, rx, ry, rz, tx, ty, tz, fx, fy, px, py: camera to world as axis-angle and metres, focal
//! lengths and principal point as shares of width and height from the picture's corner), `4x/rgbs/<camera>/<camera>_rgb%06d.jpg`,
//! `4x/masks/<camera>/<camera>_mask%06d.png`. Its pictures are undistorted. As published in HumanRF's loader; 25 Hz.

use super::data_set::{Shots, gather};
use super::found::Found;
use crate::camera::{Camera, MOST_CAMERAS};
use crate::error::CaptureError;
use crate::json;
use glam::{DAffine3, DQuat, DVec3};
use std::path::Path;

/// The calibration, in the folder of pictures.
pub(super) const CALIBRATION: &str = "calibration.csv";
/// The folder of pictures.
pub(super) const QUARTER: &str = "4x";

const RATE: f64 = 25.0;
const COLUMNS: [&str; 13] = [
    "name", "w", "h", "rx", "ry", "rz", "tx", "ty", "tz", "fx", "fy", "px", "py",
];

/// Reads an ActorsHQ sequence.
pub(super) fn read(folder: &Path) -> Result<Found, CaptureError> {
    let quarter = folder.join(QUARTER);
    let shots = (cameras(&quarter.join(CALIBRATION))?.into_iter())
        .map(|camera| {
            let of = |kind: &str, name: &str| {
                let place = quarter.join(kind).join(&camera.name);
                (place, format!("{}_{name}", camera.name))
            };
            Shots {
                frames: of("rgbs", "rgb"),
                masks: of("masks", "mask"),
                camera,
            }
        })
        .collect();
    gather(folder, shots, RATE)
}

fn cameras(file: &Path) -> Result<Vec<Camera>, CaptureError> {
    let text = json::read_text(file)?;
    let mut lines = text.lines().enumerate();
    let header: Vec<&str> = match lines.next() {
        Some((_, header)) => header
            .trim_start_matches('\u{feff}')
            .split(',')
            .map(str::trim)
            .collect(),
        None => {
            return Err(CaptureError::field(
                file,
                "line 1",
                "is missing: the file is empty",
            ));
        }
    };
    let mut places = [0; COLUMNS.len()];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        *place = (header.iter().position(|name| *name == column))
            .ok_or_else(|| CaptureError::field(file, column, "is missing in the header"))?;
    }
    let mut cameras: Vec<Camera> = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let place = |column: usize| format!("line {} {}", number + 1, COLUMNS[column]);
        let text = |column: usize| {
            (cells.get(places[column]).copied())
                .ok_or_else(|| CaptureError::field(file, place(column), "is missing"))
        };
        let value = |column: usize| {
            let text = text(column)?;
            (text.parse::<f64>().ok().filter(|v| v.is_finite())).ok_or_else(|| {
                let reason = format!("is {text:.30}, no number");
                CaptureError::field(file, place(column), reason)
            })
        };
        let side = |column: usize| {
            let text = text(column)?;
            text.parse::<u32>().map_err(|_| {
                let reason = format!("is {text:.30}, no whole number of pixels");
                CaptureError::field(file, place(column), reason)
            })
        };
        let three = |first: usize| {
            Ok::<_, CaptureError>(DVec3::new(
                value(first)?,
                value(first + 1)?,
                value(first + 2)?,
            ))
        };
        let size = [side(1)?, side(2)?];
        let [width, height] = size.map(f64::from);
        let world_from_camera =
            DAffine3::from_rotation_translation(DQuat::from_scaled_axis(three(3)?), three(6)?);
        let camera = Camera {
            name: text(0)?.to_owned(),
            size,
            focal: [value(9)? * width, value(10)? * height],
            centre: [value(11)? * width, value(12)? * height],
            distortion: [0.0; 5],
            camera_from_world: world_from_camera.inverse(),
        };
        if let Some((field, reason)) = camera.fault() {
            let theirs = match field {
                "size" => "w, h",
                "focal" => "fx, fy",
                "centre" => "px, py",
                "name" => "name",
                "camera_from_world" if camera.far_away() => "tx, ty, tz",
                _ => "rx, ry, rz",
            };
            let theirs = format!("line {} {theirs}", number + 1);
            return Err(CaptureError::field(file, theirs, reason));
        }
        if cameras.iter().any(|other| other.name == camera.name) {
            let reason = "is another camera's as well";
            return Err(CaptureError::field(file, place(0), reason));
        }
        cameras.push(camera);
        if cameras.len() > MOST_CAMERAS {
            let reason = format!("has more than {MOST_CAMERAS} cameras");
            return Err(CaptureError::field(file, "the file", reason));
        }
    }
    if cameras.is_empty() {
        return Err(CaptureError::field(
            file,
            "line 2",
            "is missing: there is no camera",
        ));
    }
    Ok(cameras)
}
