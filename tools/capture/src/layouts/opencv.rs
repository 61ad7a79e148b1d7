//! AvatarReX (`calibration_full.json`, `<camera>/%08d.jpg`, `<camera>/mask/pha/%08d.jpg`) and THuman4.0 (`calibration.json`, `images/<camera>/%08d.jpg`,
//! `masks/<camera>/%08d.jpg`): a JSON object of cameras with OpenCV's `K` (9 numbers), `R` (9, world to camera), `T` (3, metres), `imgSize` (width, height) and
//! perhaps `distCoeff` (k1, k2, p1, p2, k3; further ones must be zero). As published in Animatable Gaussians' loader; 30 Hz.

use super::data_set::{Shots, gather};
use super::found::Found;
use crate::camera::{Camera, MOST_CAMERAS};
use crate::error::CaptureError;
use crate::json::{self, Node};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// AvatarReX's calibration.
pub(super) const AVATAR_REX: &str = "calibration_full.json";
/// THuman4.0's.
pub(super) const THUMAN: &str = "calibration.json";

const RATE: f64 = 30.0;

/// Reads an AvatarReX folder.
pub(super) fn read_avatar_rex(folder: &Path) -> Result<Found, CaptureError> {
    let shots = (cameras(&folder.join(AVATAR_REX))?.into_iter())
        .map(|camera| {
            let own = folder.join(&camera.name);
            Shots {
                frames: (own.clone(), String::new()),
                masks: (own.join("mask").join("pha"), String::new()),
                camera,
            }
        })
        .collect();
    gather(folder, shots, RATE)
}

/// Reads a THuman4.0 folder.
pub(super) fn read_thuman(folder: &Path) -> Result<Found, CaptureError> {
    let shots = (cameras(&folder.join(THUMAN))?.into_iter())
        .map(|camera| Shots {
            frames: (folder.join("images").join(&camera.name), String::new()),
            masks: (folder.join("masks").join(&camera.name), String::new()),
            camera,
        })
        .collect();
    gather(folder, shots, RATE)
}

fn cameras(file: &Path) -> Result<Vec<Camera>, CaptureError> {
    let value = json::read(file)?;
    let root = Node::root(file, &value);
    let members = root.members()?;
    if members.is_empty() || members.len() > MOST_CAMERAS {
        let reason = format!(
            "has {} cameras; 1 to {MOST_CAMERAS} are possible",
            members.len()
        );
        return Err(root.wrong(reason));
    }
    members
        .into_iter()
        .map(|(name, node)| camera(name, &node))
        .collect()
}

fn camera(name: &str, node: &Node<'_>) -> Result<Camera, CaptureError> {
    let [width, height] = match node.get("imgSize")?.items()?.as_slice() {
        [width, height] => [width.side()?, height.side()?],
        _ => return Err(node.get("imgSize")?.wrong("must be width and height")),
    };
    let k: [f64; 9] = node.get("K")?.numbers()?;
    if k[1].abs() > 1e-3 * k[0].abs() || [k[3], k[6], k[7]] != [0.0; 3] || k[8] != 1.0 {
        return Err(node
            .get("K")?
            .wrong("must be [fx, 0, cx, 0, fy, cy, 0, 0, 1]: pixels without skew"));
    }
    let mut distortion = [0.0; 5];
    if let Some(node) = node.find("distCoeff") {
        let given = node.flat(14)?;
        if given.iter().skip(5).any(|k| *k != 0.0) {
            let reason = "has more than k1, k2, p1, p2, k3: undistort the pictures with OpenCV";
            return Err(node.wrong(reason));
        }
        for (to, from) in distortion.iter_mut().zip(given) {
            *to = from;
        }
    }
    let (r, t): ([f64; 9], [f64; 3]) = (node.get("R")?.numbers()?, node.get("T")?.numbers()?);
    let camera = Camera {
        name: name.to_owned(),
        size: [width, height],
        focal: [k[0], k[4]],
        // OpenCV counts from the first pixel's centre.
        centre: [k[2] + 0.5, k[5] + 0.5],
        distortion,
        camera_from_world: DAffine3 {
            matrix3: orthonormal(&DMat3::from_cols_array(&r).transpose()),
            translation: DVec3::from_array(t),
        },
    };
    match camera.fault() {
        None => Ok(camera),
        Some((field, reason)) => {
            let theirs = match field {
                "size" => "imgSize",
                "focal" | "centre" => "K",
                "distortion" => "distCoeff",
                "camera_from_world" if camera.far_away() => "T",
                _ => "R",
            };
            // The name is the field itself.
            let found = node.find(theirs).filter(|_| field != "name");
            Err(found.as_ref().unwrap_or(node).wrong(reason))
        }
    }
}

/// The rotation next to a matrix that is nearly one (files have single precision); one that is none stays as it is.
pub(super) fn orthonormal(matrix: &DMat3) -> DMat3 {
    let off = (*matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
    if off.iter().all(|v| v.abs() < 1e-3) && matrix.determinant() > 0.0 {
        // Newton's iteration towards the polar factor.
        (0..4).fold(*matrix, |m, _| (m + m.inverse().transpose()) * 0.5)
    } else {
        *matrix
    }
}
