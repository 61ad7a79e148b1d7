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
