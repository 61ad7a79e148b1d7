//! Folders in the layouts of published data sets.

use super::{npz, png};
use std::fs;
use std::path::Path;

pub(crate) const SIZE: [u32; 2] = [8, 6];

/// A camera at (0, 0, -3) in a world whose y is down, as OpenCV has it: axes are the world's own.
pub(crate) fn opencv(name: &str, x: f64) -> String {
    format!(
        r#""{name}": {{"K": [10, 0, 4, 0, 11, 3, 0, 0, 1], "R": [1, 0, 0, 0, 1, 0, 0, 0, 1], "T": [{x}, 0, 3], "distCoeff": [0, 0, 0, 0, 0], "imgSize": [8, 6]}}"#
    )
}

/// SMPL-X's parameters of a person whose head is down in their own axes' y: y of the world is down.
pub(crate) fn smpl(path: &Path, frames: usize) {
    let row = |values: &[f32]| -> Vec<f32> {
        values
            .iter()
            .copied()
            .cycle()
            .take(values.len() * frames)
            .collect()
    };
    npz(
        path,
        &[
            (
                "global_orient",
                &[frames, 3],
                row(&[std::f32::consts::PI, 0.0, 0.0]),
            ),
            ("transl", &[frames, 3], row(&[0.1, 0.2, 0.3])),
            ("body_pose", &[frames, 63], row(&[0.05; 63])),
            ("jaw_pose", &[frames, 3], row(&[0.2, 0.0, 0.0])),
            ("expression", &[frames, 10], row(&[0.7; 10])),
            ("left_hand_pose", &[frames, 45], row(&[0.3; 45])),
            ("right_hand_pose", &[frames, 45], row(&[-0.3; 45])),
            ("betas", &[1, 10], vec![0.5; 10]),
        ],
    );
}

pub(crate) fn avatar_rex(folder: &Path) {
    for (k, name) in ["22010708", "22010710"].iter().enumerate() {
        // The second camera lacks frame 2.
        for frame in (0..4).filter(|frame| k == 0 || *frame != 2) {
            png(&folder.join(format!("{name}/{frame:08}.jpg")), SIZE, frame);
            png(
                &folder.join(format!("{name}/mask/pha/{frame:08}.jpg")),
                SIZE,
                2 * frame,
            );
        }
    }
    let text = format!(
        "{{{}, {}}}",
        opencv("22010708", 0.0),
        opencv("22010710", 0.5)
    );
    fs::write(folder.join("calibration_full.json"), text).expect("written");
    smpl(&folder.join("smpl_params.npz"), 4);
}

pub(crate) fn thuman(folder: &Path) {
    for name in ["cam00", "cam01"] {
        for frame in 0..3 {
            png(
                &folder.join(format!("images/{name}/{frame:08}.jpg")),
                SIZE,
                frame,
            );
            png(
                &folder.join(format!("masks/{name}/{frame:08}.jpg")),
                SIZE,
                frame,
            );
        }
    }
    let text = format!("{{{}, {}}}", opencv("cam00", 0.0), opencv("cam01", 0.5));
    fs::write(folder.join("calibration.json"), text).expect("written");
}

pub(crate) fn actors_hq(folder: &Path) {
    for name in ["Cam001", "Cam002"] {
        for frame in 5..8 {
            png(
                &folder.join(format!("4x/rgbs/{name}/{name}_rgb{frame:06}.jpg")),
                SIZE,
                frame,
            );
            png(
                &folder.join(format!("4x/masks/{name}/{name}_mask{frame:06}.png")),
                SIZE,
                frame,
            );
        }
    }
    // Upright in a world of y up, looking along -z: half a turn about x.
    let text = "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n\
        Cam001,8,6,3.141592653589793,0,0,0.5,1.25,3,1.25,1.5,0.5,0.55\n\
        Cam002,8,6,3.0,0,0,0.5,1.25,3,1.25,1.5,0.5,0.55\n";
    fs::write(folder.join("4x/calibration.csv"), text).expect("written");
}
