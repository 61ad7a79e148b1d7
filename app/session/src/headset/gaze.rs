//! Where the wearer looks, for a second screen that shows what they see.

use glam::Affine3A;
use renderer_openxr::ext::eye_tracking::Gaze;

/// The wearer of one frame, in floor space (metres, y up), and the person they are with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WearerView {
    /// Between the eyes, -z ahead, as the frame is drawn.
    pub floor_from_head: Affine3A,
    /// Left, right: where the eyes look, where the headset tracks them.
    pub gazes: [Option<Gaze>; 2],
    /// From the motion space of the first person who is there, apart from the wearer; rigid.
    pub floor_from_person: Affine3A,
}

/// Is told where the wearer looks, once a frame in which there is a person. A listener has the wearer's eyes tracked, and nothing else of them.
pub trait GazeListener: std::fmt::Debug + Send + Sync {
    /// The wearer looks there. It is the loop's thread: this must not wait.
    fn looked(&self, view: &WearerView);
}
