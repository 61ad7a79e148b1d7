//! People in a headset: the loop that has everybody drawn for each of its frames, and comes back by itself when the runtime went.
//!
//! Which moment is drawn is the lanes' business, where people stand [`crate::presence`]'s, what the runtime is told
//! `renderer_openxr`'s. The loop has a thread of its own, which is the lanes' GPU lane.

mod figures;
mod hanging;
mod notice;
mod pace;
mod panel;
mod party;
mod show;
mod surroundings;

pub use figures::{FrameFigures, HeadsetFigures};
pub use notice::{NoticeBoard, show_notice};
pub use party::{Gathered, HeadsetHandle, Party, Wishes, show_party};
pub use show::{FrameObserver, HeadsetError, PresentConfig, Seen, show};
