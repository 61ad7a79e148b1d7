//! The events that Android sends to an activity.

use std::fmt;

/// One event of an activity's life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Event {
    /// It may be seen from now on.
    Start,
    /// It is in front.
    Resume,
    /// It is no longer in front.
    Pause,
    /// It cannot be seen.
    Stop,
    /// Input goes to it.
    FocusGained,
    /// Input goes elsewhere: to the system's menu, say, while the activity stays in front.
    FocusLost,
    /// It has a window.
    WindowMade,
    /// Its window is about to go.
    WindowDestroyed,
    /// The system is short of memory.
    LowMemory,
    /// Language, orientation, keyboard or another part of the configuration has changed.
    ConfigChanged,
    /// What is to be there after a restart should be saved.
    SaveState,
    /// It is over.
    Destroy,
}

impl Event {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Start,
        Self::Resume,
        Self::Pause,
        Self::Stop,
        Self::FocusGained,
        Self::FocusLost,
        Self::WindowMade,
        Self::WindowDestroyed,
        Self::LowMemory,
        Self::ConfigChanged,
        Self::SaveState,
        Self::Destroy,
    ];
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Resume => "resume",
            Self::Pause => "pause",
            Self::Stop => "stop",
            Self::FocusGained => "focus gained",
            Self::FocusLost => "focus lost",
            Self::WindowMade => "window made",
            Self::WindowDestroyed => "window destroyed",
            Self::LowMemory => "low memory",
            Self::ConfigChanged => "configuration changed",
            Self::SaveState => "save state",
            Self::Destroy => "destroy",
        })
    }
}
