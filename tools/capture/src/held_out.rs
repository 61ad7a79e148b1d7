//! What is kept away from training.

/// Cameras and frames that no training sees: `eval avatar` measures on them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct HeldOut {
    /// Indices of cameras, ascending.
    pub cameras: Vec<usize>,
    /// Indices of frames, ascending.
    pub frames: Vec<usize>,
}

impl HeldOut {
    /// Whether a camera is held out.
    #[must_use]
    pub fn has_camera(&self, camera: usize) -> bool {
        self.cameras.binary_search(&camera).is_ok()
    }

    /// Whether a frame is held out.
    #[must_use]
    pub fn has_frame(&self, frame: usize) -> bool {
        self.frames.binary_search(&frame).is_ok()
    }

    /// The cameras that are not held out of `count`, ascending.
    #[must_use]
    pub fn kept_cameras(&self, count: usize) -> Vec<usize> {
        (0..count).filter(|at| !self.has_camera(*at)).collect()
    }

    /// The frames that are not held out of `count`, ascending.
    #[must_use]
    pub fn kept_frames(&self, count: usize) -> Vec<usize> {
        (0..count).filter(|at| !self.has_frame(*at)).collect()
    }

    /// The frames as ranges [first, end).
    pub(crate) fn ranges(&self) -> Vec<[usize; 2]> {
        let mut ranges: Vec<[usize; 2]> = Vec::new();
        for frame in &self.frames {
            match ranges.last_mut() {
                Some([_, end]) if end == frame => *end += 1,
                _ => ranges.push([*frame, frame + 1]),
            }
        }
        ranges
    }

    /// What is wrong with it in a capture of so many cameras and frames.
    pub(crate) fn fault(&self, cameras: usize, frames: usize) -> Option<String> {
        let rises = |list: &[usize]| list.windows(2).all(|pair| pair[0] < pair[1]);
        if !rises(&self.cameras) || !rises(&self.frames) {
            Some("must be in ascending order, each once".to_owned())
        } else if self.cameras.last().is_some_and(|last| *last >= cameras) {
            Some(format!("names a camera that is none of the {cameras}"))
        } else if self.frames.last().is_some_and(|last| *last >= frames) {
            Some(format!("names a frame beyond the {frames}"))
        } else if self.cameras.len() == cameras || self.frames.len() == frames {
            Some("leaves nothing for training".to_owned())
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_what_is_not_held_out() {
        let held_out = HeldOut {
            cameras: vec![0, 3],
            frames: vec![1, 2, 5],
        };
        assert_eq!(held_out.kept_cameras(5), [1, 2, 4], "cameras");
        assert_eq!(held_out.kept_frames(6), [0, 3, 4], "frames");
        assert!(
            held_out.has_frame(5) && !held_out.has_frame(4),
            "one by one"
        );
    }
}
