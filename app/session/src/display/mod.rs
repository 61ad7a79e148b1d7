//! Where a session is shown: what every display has in common, and the displays that need no headset.
//!
//! A [`Display`] says what pictures it takes, then shows the people of a [`LiveSession`] until the session is over. The headset's is
//! [`crate::headset::HeadsetDisplay`]; [`OffscreenDisplay`] draws for pictures on disk and for measurements, [`StillsDisplay`] pose by pose; a program with a window
//! of its own has its own, with [`FlatView`] for where people and camera are.

pub(crate) mod attendance;
mod flat;
mod hearing;
mod offscreen;
mod stills;

pub use flat::{FlatView, LoadBackground, Standpoint};
pub use offscreen::{DrawnPicture, OffscreenDisplay, PictureObserver};
pub use stills::{Still, StillsDisplay};

use crate::attendee::Attendee;
use crate::participant::PersonSource;
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::Lanes;
use attendance::Attendance;
use renderer_openxr::error::XrError;
use renderer_splat::camera::Camera;
use renderer_splat::options::RendererOptions;
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;
use std::time::Duration;

/// Gaussians that a picture has room for beside the people's: their shadows.
pub(crate) const SCENERY_GAUSSIANS: u32 = 256;

/// Where a session is shown.
pub trait Display {
    /// What pictures it takes. Asked once, before anything is prepared.
    ///
    /// # Errors
    /// If it cannot take any.
    fn needs(&mut self) -> Result<DisplayNeeds, SessionError>;

    /// Everything is ready to be shown; the people's motion begins after this.
    fn prepared(&mut self) {}

    /// Shows the people until the session is over. Works on the GPU in steps of the session's control, so that it rests in a pause.
    ///
    /// # Errors
    /// What keeps it from going on.
    fn show(&mut self, session: LiveSession<'_>) -> Result<(), SessionError>;
}

/// What a display needs to be prepared for it.
#[derive(Debug, Clone)]
pub struct DisplayNeeds {
    /// The device that draws.
    pub gpu: Arc<Gpu>,
    /// Size and kind of the pictures; room for the people's Gaussians is the session's to add.
    pub renderer: RendererOptions,
    /// One camera a view, about as the people will be seen, to find out what is fastest.
    pub cameras: Vec<Camera>,
    /// From one refresh to the next.
    pub period: Duration,
}

/// A session while it is shown.
#[derive(Debug)]
pub struct LiveSession<'a> {
    /// Makes the pictures, of all people.
    pub lanes: &'a mut Lanes<PersonSource>,
    /// The people, by their numbers in the lanes.
    pub people: &'a mut Vec<Attendee>,
    /// Pauses and ends the session.
    pub control: &'a Control,
    /// How many of the first people are the viewer themselves, as in a mirror.
    pub(crate) own: usize,
    /// Where newcomers are taken in.
    pub(crate) attendance: Option<&'a mut Attendance>,
    /// Looks on.
    pub(crate) observer: Option<&'a mut (dyn SessionObserver + 'static)>,
}

/// Looks on while a session is shown, on whichever display.
pub trait SessionObserver: std::fmt::Debug + Send {
    /// Called before each picture, by the thread that draws: what it does is to be quick.
    fn look(&mut self, lanes: &mut Lanes<PersonSource>, people: &[Attendee]);
}

impl LiveSession<'_> {
    /// Takes in who has come since it was asked last, between two pictures; the number of each, which may have been another one's who is gone.
    ///
    /// # Errors
    /// If nothing can be drawn any longer.
    pub fn admit(&mut self) -> Result<Vec<usize>, SessionError> {
        let mut numbers = Vec::new();
        let Some(Attendance { ready, departed }) = self.attendance.as_deref() else {
            return Ok(numbers);
        };
        for newcomer in ready.try_iter() {
            numbers.extend(newcomer.join(self.lanes, self.people, departed)?);
        }
        Ok(numbers)
    }

    /// Lets the observer look, if there is one.
    pub(crate) fn observe(&mut self) {
        if let Some(observer) = self.observer.as_deref_mut() {
            observer.look(self.lanes, self.people);
        }
    }

    /// Whether people come and go.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.attendance.is_some()
    }
}

/// What ended a session.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The headset cannot show anything.
    #[error(transparent)]
    Headset(#[from] XrError),
    /// Nothing can be drawn any longer.
    #[error(transparent)]
    Receiver(ReceiverError),
    /// There are no people.
    #[error("the session has no people to show")]
    NoParticipants,
    /// The display was shown a session before, and shows one only.
    #[error("this display was shown a session already")]
    ShownAlready,
    /// A device that was opened again is lost each time.
    #[error("the GPU is lost whenever this picture is drawn")]
    LostAgain,
    /// It was over before it began.
    #[error("left before anything was shown")]
    Left,
    /// There is no thread for the headset's frames.
    #[error("cannot start the thread of the headset's frames")]
    Thread(#[source] std::io::Error),
    /// The thread of the headset's frames panicked, which it says itself.
    #[error("the thread of the headset's frames panicked")]
    Panicked,
    /// A display that this crate does not have cannot go on.
    #[error(transparent)]
    Display(Box<dyn std::error::Error + Send + Sync>),
}

impl From<ReceiverError> for SessionError {
    fn from(error: ReceiverError) -> Self {
        match error {
            ReceiverError::Left => Self::Left,
            error => Self::Receiver(error),
        }
    }
}
