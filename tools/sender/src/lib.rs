//! The sending side of a call as a library: motion from a [`Capture`] and voice from a [`VoiceSource`] to every viewer that has joined the room.

#![forbid(unsafe_code)]

mod capture;
mod clip;
mod error;
mod invitation;
mod lips;
mod mute;
mod room;
mod send;
mod unseen_face;
mod voice;

pub use capture::{Capture, Captured};
pub use clip::ClipCapture;
pub use error::SendError;
pub use invitation::{Invitation, invite};
pub use lips::{Lips, Overheard};
pub use room::{Desk, Entered, Place, enter, new_secret};
pub use send::send;
pub use unseen_face::UnseenFace;
pub use voice::{ProcessedMicrophone, VoiceFile, VoiceSource, say};
