//! Where the wearer looks, for a second screen that shows what they see.

use glam::Affine3A;
use renderer_openxr::ext::eye_tracking::Gaze;
use renderer_openxr::frame::Frame;
use renderer_openxr::session::Session;
use renderer_openxr::state::SessionState;
use std::sync::Arc;

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

/// Is told where the wearer looks, once a frame in which there is a person, while they have the app before them: what they look at in the system's
/// menus is nobody's business. A listener has the wearer's eyes tracked, besides the head,
/// and nothing else of them; once begun, until the session ends.
pub trait GazeListener: std::fmt::Debug + Send + Sync {
    /// The wearer looks there. It is the loop's thread: this must not wait.
    fn looked(&self, view: &WearerView);
}

/// Watches the wearer's eyes for a listener.
#[derive(Debug)]
pub(super) struct GazeWatch {
    listener: Option<Arc<dyn GazeListener>>,
    /// Of the present frame; nothing while they are not watched.
    gazes: Option<[Option<Gaze>; 2]>,
}

impl GazeWatch {
    pub(super) fn new(listener: Option<Arc<dyn GazeListener>>) -> Self {
        Self {
            listener,
            gazes: None,
        }
    }

    /// Asks where the eyes look, if that is to be told: of a person who is there, in a session that is in front. After the frame's controls.
    pub(super) fn look(&mut self, session: &mut Session, frame: &Frame, person: Option<Affine3A>) {
        let is_in_front = session.lifecycle().now() == SessionState::Focused;
        let is_told = self.listener.is_some() && person.is_some() && is_in_front;
        self.gazes = is_told.then(|| session.gazes(frame));
    }

    /// Tells it, now that the head and the first person are where the frame has them.
    pub(super) fn tell(&mut self, floor_from_head: Affine3A, floor_from_person: Option<Affine3A>) {
        if let (Some(listener), Some(gazes), Some(floor_from_person)) =
            (&self.listener, self.gazes.take(), floor_from_person)
        {
            listener.looked(&WearerView {
                floor_from_head,
                gazes,
                floor_from_person,
            });
        }
    }
}
