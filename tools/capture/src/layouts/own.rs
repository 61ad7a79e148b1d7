//! Our own layout: `capture.json`, `frames/<camera>/<number>.png|jpg`, `masks/<camera>/<number>.png`, `motion.npz`; numbers are six digits from
//! 000000 on. `docs/captures.md` describes it.

use super::found::{Found, Pictures};
use crate::camera::{Camera, MOST_CAMERAS};
use crate::error::CaptureError;
use crate::files::Numbered;
use crate::held_out::HeldOut;
use crate::json::{self, Node};
use crate::pose;
use glam::{DAffine3, DMat3, DVec3};
use serde_json::{Value, json};
use std::path::Path;

pub(crate) const MANIFEST: &str = "capture.json";
pub(crate) const OWN_FRAMES: &str = "frames";
pub(crate) const OWN_MASKS: &str = "masks";
pub(crate) const OWN_MOTION: &str = "motion.npz";

const FORMAT: &str = "mon3tr-capture";
const VERSION: usize = 1;
/// Frames of the longest capture: 55 minutes at 60 Hz.
pub const MOST_FRAMES: usize = 200_000;

/// The JSON of `capture.json`.
pub(crate) fn manifest(
    cameras: &[Camera],
    frames: usize,
    frame_rate: f64,
    held_out: &HeldOut,
) -> Value {
    let names = (held_out.cameras.iter()).filter_map(|k| Some(&cameras.get(*k)?.name));
    let cameras: Vec<Value> = (cameras.iter())
        .map(|camera| {
            let pose = camera.camera_from_world;
            let rows = [0, 1, 2].map(|row| {
                let turn = pose.matrix3.row(row);
                [turn.x, turn.y, turn.z, pose.translation[row]]
            });
            json!({
                "name": camera.name,
                "size": camera.size,
                "focal": camera.focal,
                "centre": camera.centre,
                "distortion": camera.distortion,
                "camera_from_world": rows,
            })
        })
        .collect();
    json!({
        "format": FORMAT,
        "version": VERSION,
        "frame_rate": frame_rate,
        "frames": frames,
        "held_out": { "cameras": names.collect::<Vec<_>>(), "frames": held_out.ranges() },
        "cameras": cameras,
    })
}

/// Reads a folder of our own layout.
pub(crate) fn read(folder: &Path) -> Result<Found, CaptureError> {
    let file = folder.join(MANIFEST);
    let value = json::read(&file)?;
    let root = Node::root(&file, &value);
    let format = root.get("format")?;
    if format.text()? != FORMAT {
        return Err(format.wrong(format!("must be \"{FORMAT}\"")));
    }
    let version = root.get("version")?;
    if version.count(usize::MAX)? != VERSION {
        let reason = format!("must be {VERSION}: a newer program wrote this capture");
        return Err(version.wrong(reason));
    }
    let rate = root.get("frame_rate")?;
    let frame_rate = rate.number()?;
    if !(frame_rate > 0.0 && frame_rate <= 1000.0) {
        return Err(rate.wrong(format!("is {frame_rate}; up to 1000 Hz are possible")));
    }
    let count = root.get("frames")?;
    let frames = count.count(MOST_FRAMES)?;
    if frames == 0 {
        return Err(count.wrong("is 0: a capture has at least one frame"));
    }
    let cameras = cameras(&root.get("cameras")?)?;
    let held_out = held_out(&root, &cameras, frames)?;
    let numbers: Vec<u32> = (0..).take(frames).collect();
    let mut pictures = Vec::with_capacity(cameras.len());
    for camera in &cameras {
        let list = |kind: &str| {
            let listed = Numbered::list(&folder.join(kind).join(&camera.name), "")?;
            listed.check_all(&numbers)?;
            Ok(listed.into_names())
        };
        let masked = folder.join(OWN_MASKS).join(&camera.name).is_dir();
        pictures.push(Pictures {
            frames: list(OWN_FRAMES)?,
            masks: masked.then(|| list(OWN_MASKS)).transpose()?,
        });
    }
    let motion = folder.join(OWN_MOTION);
    let (poses, expression_basis) = if motion.exists() {
        let (poses, basis) = pose::read(&motion, frames)?;
        (Some(poses), basis)
    } else {
        (None, None)
    };
    Ok(Found {
        cameras,
        pictures,
        numbers,
        frame_rate,
        poses,
        expression_basis,
        held_out,
        notes: Vec::new(),
    })
}

fn cameras(list: &Node<'_>) -> Result<Vec<Camera>, CaptureError> {
    let items = list.items()?;
    if items.is_empty() || items.len() > MOST_CAMERAS {
        let reason = format!(
            "has {} cameras; 1 to {MOST_CAMERAS} are possible",
            items.len()
        );
        return Err(list.wrong(reason));
    }
    let mut cameras: Vec<Camera> = Vec::with_capacity(items.len());
    for item in items {
        let [width, height] = match item.get("size")?.items()?.as_slice() {
            [width, height] => [width.side()?, height.side()?],
            _ => return Err(item.get("size")?.wrong("must be width and height")),
        };
        let rows: [f64; 12] = item.get("camera_from_world")?.numbers()?;
        let column = |k: usize| DVec3::new(rows[k], rows[4 + k], rows[8 + k]);
        let camera = Camera {
            name: item.get("name")?.text()?.to_owned(),
            size: [width, height],
            focal: item.get("focal")?.numbers()?,
            centre: item.get("centre")?.numbers()?,
            distortion: item.get("distortion")?.numbers()?,
            camera_from_world: DAffine3 {
                matrix3: DMat3::from_cols(column(0), column(1), column(2)),
                translation: column(3),
            },
        };
        if let Some((field, reason)) = camera.fault() {
            return Err(item.get(field)?.wrong(reason));
        }
        if cameras.iter().any(|other| other.name == camera.name) {
            return Err(item.get("name")?.wrong("is another camera's as well"));
        }
        cameras.push(camera);
    }
    Ok(cameras)
}

fn held_out(root: &Node<'_>, cameras: &[Camera], frames: usize) -> Result<HeldOut, CaptureError> {
    let mut held_out = HeldOut::default();
    let Some(node) = root.find("held_out") else {
        return Ok(held_out);
    };
    for name in node.get("cameras")?.items()? {
        let wanted = name.text()?;
        let camera = (cameras.iter())
            .position(|camera| camera.name == wanted)
            .ok_or_else(|| name.wrong("is none of the cameras' names"))?;
        held_out.cameras.push(camera);
    }
    held_out.cameras.sort_unstable();
    for range in node.get("frames")?.items()? {
        let ends = range.items()?;
        let [first, end] = ends.as_slice() else {
            return Err(range.wrong("must be two frames [first, end)"));
        };
        let (first, end) = (first.count(frames)?, end.count(frames)?);
        if first >= end || held_out.frames.last().is_some_and(|last| *last >= first) {
            return Err(range.wrong("must be [first, end) with first < end, after the one before"));
        }
        held_out.frames.extend(first..end);
    }
    match held_out.fault(cameras.len(), frames) {
        Some(fault) => Err(node.wrong(fault)),
        None => Ok(held_out),
    }
}
