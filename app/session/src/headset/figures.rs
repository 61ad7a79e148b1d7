//! What there was of a headset, for reports.

use app_pipeline::profile::Percentiles;
use serde::Serialize;
use std::time::Duration;

/// Until a headset says its rate, Hz.
pub(super) const REFRESH_HZ: f32 = 72.0;

/// A headset's sessions.
#[derive(Debug, Clone, Default, Serialize)]
pub struct HeadsetFigures {
    /// The runtime's name and version.
    pub runtime: String,
    /// The headset's name.
    pub headset: String,
    /// What draws.
    pub device: String,
    /// Width and height of an eye's picture, pixels.
    pub eye_size: [u32; 2],
    /// How the floor is known.
    pub floor: String,
    /// What is behind the people: the viewer's room, a studio, or a scene.
    pub surround: String,
    /// Whether bare hands are tracked.
    pub hands: bool,
    /// Whether foveation follows the tracked gaze.
    pub foveation_follows_gaze: bool,
    /// How pictures come into the headset's images, and whether they are foveated; nothing before the first.
    pub way: Option<String>,
    /// How much of the left and the right picture the lenses show, 0 to 1, where the runtime tells: the rest is not drawn.
    pub lenses_show: Option<[f64; 2]>,
    /// Whether the compositor gets depth.
    pub depth: bool,
    /// The display's rate where it can be chosen, Hz.
    pub display_hz: Option<f32>,
    /// Extensions of `OpenXR` that are used.
    pub granted: Vec<String>,
    /// Extensions that would be used if the runtime had them.
    pub missing: Vec<String>,
    /// States that sessions passed, in order, each session after the one before.
    pub states: Vec<String>,
    /// Times the headset was opened: more than once where its runtime went and came back.
    pub opened: u32,
    /// Frames.
    pub frames: FrameFigures,
}

impl HeadsetFigures {
    /// The display's period, as far as it is known.
    #[must_use]
    pub fn display_period(&self) -> Duration {
        Duration::from_secs_f32(1.0 / self.display_hz.unwrap_or(REFRESH_HZ).max(1.0))
    }
}

/// What became of a headset's frames.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct FrameFigures {
    /// Shown to the eyes.
    pub shown: u64,
    /// Of those, frames without a person, before the first came.
    pub empty: u64,
    /// Paced by the runtime, but not to be seen by anybody: they cost nothing.
    pub unseen: u64,
    /// Refreshes of the display that showed nothing new.
    pub late: u64,
    /// From one predicted display time to the next.
    pub interval: Option<Percentiles>,
    /// As the runtime predicts the display's period.
    pub period: Option<Percentiles>,
}
