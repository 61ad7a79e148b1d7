//! A member of a call of several, who is its sender and a viewer of everyone else: what the `mon3tr` command and the app on a headset share.

#![forbid(unsafe_code)]

mod acquaintances;
mod gaze_feed;
mod members;
mod perform;
mod privacy;
mod roster;
mod seats;
mod voices;
mod wearer;

pub use acquaintances::{Acquaintances, Meeting};
pub use gaze_feed::{GazeFeed, GazeFeedError, Sent};
pub use members::{Member, Members};
pub use perform::Performance;
pub use privacy::PrivacyButtons;
pub use roster::{Newcomer, Roster, RosterFigures};
pub use voices::{MIXED, MIXED_TIME, UnheardError, VoiceMixer, play_voices};
pub use wearer::{WEARER_RATE, WearerCapture};
