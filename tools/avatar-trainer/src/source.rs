//! What a training was begun with of a capture: to tell whether it goes on with the same.

use capture::Capture;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// What of a capture may not change while an avatar is trained of it. Pictures and masks are not looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Source {
    cameras: usize,
    frames: usize,
    /// SHA-256 of the cameras' names, sizes, lenses and poses.
    calibration: String,
    /// SHA-256 of the person's poses and their expression basis.
    poses: String,
    /// SHA-256 of what is held out.
    held_out: String,
}

impl Source {
    pub(crate) fn of(capture: &Capture) -> Self {
        let (cameras, held_out) = (capture.cameras(), capture.held_out());
        let mut calibration = Numbers::default();
        for camera in cameras {
            calibration.text(&camera.name);
            calibration
                .0
                .update(camera.size.map(u32::to_le_bytes).concat());
            let pose = camera.camera_from_world.to_cols_array();
            let lens = camera.focal.iter().chain(&camera.centre);
            calibration.numbers(lens.chain(&camera.distortion).chain(&pose).copied());
        }
        let mut poses = Numbers::default();
        poses.text(&format!("{:?}", capture.expression_basis()));
        for pose in capture.poses().unwrap_or_default() {
            let numbers = pose.parameters.values().iter().copied();
            let root = pose.parameters.root_translation.to_array();
            let all = numbers.chain(root).chain(pose.pelvis.to_array());
            poses.numbers(all.map(f64::from));
        }
        let mut held = Numbers::default();
        held.text(&format!("{:?} {:?}", held_out.cameras, held_out.frames));
        Self {
            cameras: cameras.len(),
            frames: capture.frames(),
            calibration: calibration.hex(),
            poses: poses.hex(),
            held_out: held.hex(),
        }
    }

    /// What is another in `now`, and what to do.
    pub(crate) fn change(&self, now: &Self) -> Option<String> {
        let what = if (self.cameras, self.frames) != (now.cameras, now.frames) {
            return Some(format!(
                "it is of a capture of {} cameras and {} frames, this one has {} and {}: name the capture that it was begun with, or train anew",
                self.cameras, self.frames, now.cameras, now.frames
            ));
        } else if self.calibration != now.calibration {
            "the cameras' names, lenses or poses are others"
        } else if self.poses != now.poses {
            "the person's poses are others"
        } else if self.held_out != now.held_out {
            "other cameras or frames are held out"
        } else {
            return None;
        };
        Some(format!(
            "{what} than when the training was begun: name the capture as it was then, or train anew"
        ))
    }
}

/// Hashes numbers by their bits.
#[derive(Default)]
struct Numbers(Sha256);

impl Numbers {
    /// A text, and its length, so that two of them are not one.
    fn text(&mut self, text: &str) {
        self.0.update((text.len() as u64).to_le_bytes());
        self.0.update(text);
    }

    fn numbers(&mut self, numbers: impl Iterator<Item = f64>) {
        for number in numbers {
            self.0.update(number.to_le_bytes());
        }
    }

    fn hex(self) -> String {
        let bytes = self.0.finalize();
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}
