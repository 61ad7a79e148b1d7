//! Looking on while a session is shown in a headset.

use renderer_openxr::eyes::EyePicture;
use renderer_openxr::frame::Eyes;

/// Looks on, beside the viewer who wears the headset.
pub trait FrameObserver: Send {
    /// Whether to end the session. `shown` frames were shown so far.
    fn is_over(&self, shown: u64) -> bool;

    /// Whether both eyes' pictures of the frame after `shown` others are wanted; `has_people` says whether there are people in it.
    fn wants_pictures(&mut self, shown: u64, has_people: bool) -> bool;

    /// A frame whose pictures were wanted.
    fn captured(&mut self, frame: FrameCapture<'_>);
}

/// What the eyes got.
#[derive(Debug)]
pub struct FrameCapture<'a> {
    /// So many frames were shown before.
    pub number: u64,
    /// Where the eyes were.
    pub eyes: &'a Eyes,
    /// Left and right.
    pub pictures: [EyePicture; 2],
}
