//! The headset as a display: the loop that has all people drawn for each of its frames, and comes back by itself when the runtime went.
//!
//! Which moment is drawn is decided by the lanes, where people stand by [`crate::presence`], what the runtime is given by
//! `renderer_openxr`. The loop has a thread of its own, which is the lanes' GPU lane.

mod display;
mod figures;
mod frames;
mod gaze;
mod handle;
mod hanging;
mod notice;
mod observer;
mod options;
mod pace;
mod panel;
mod surroundings;
mod wearer;

pub use display::HeadsetDisplay;
pub use figures::{FrameFigures, HeadsetFigures};
pub use gaze::{GazeListener, WearerView};
pub use handle::HeadsetHandle;
pub use notice::{NoticeBoard, show_notice};
pub use observer::{FrameCapture, FrameObserver};
pub use options::PresentOptions;
pub use panel::PrivacySwitch;
pub use wearer::{WearerNews, WearerSlot};
