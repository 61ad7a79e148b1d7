//! The settings, and their sources.

use std::fmt;

/// One setting. It has the same name everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Key {
    /// The server's address, where `room` is a name.
    Server,
    /// A room's name, or whole room links.
    Room,
    /// The right to be in the room, where `room` is a name.
    Token,
    /// The whole link of a call of several.
    Call,
    /// One's own avatar in a call of several: a file in the app's folder.
    Avatar,
    /// What others in a call of several read.
    Name,
    /// Whether people sit.
    Seat,
    /// The display's rate.
    Rate,
    /// The placement.
    Placement,
    /// Pictures between two motion frames.
    Latency,
    /// The log level.
    Log,
    /// For how long the demo person is measured instead of joining a room.
    Profile,
    /// How much room packages may take.
    CacheMb,
    /// Certificates of servers that are trusted besides the public ones: a file in the app's folder.
    Ca,
    /// The second screen that is sent where the wearer looks.
    GazeTo,
}

impl Key {
    /// All of them.
    pub const ALL: [Self; 15] = [
        Self::Server,
        Self::Room,
        Self::Token,
        Self::Call,
        Self::Avatar,
        Self::Name,
        Self::Seat,
        Self::Rate,
        Self::Placement,
        Self::Latency,
        Self::Log,
        Self::Profile,
        Self::CacheMb,
        Self::Ca,
        Self::GazeTo,
    ];

    /// Its name as an extra and in the file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Server => "server",
            Self::Room => "room",
            Self::Token => "token",
            Self::Call => "call",
            Self::Avatar => "avatar",
            Self::Name => "name",
            Self::Seat => "seat",
            Self::Rate => "rate",
            Self::Placement => "placement",
            Self::Latency => "latency",
            Self::Log => "log",
            Self::Profile => "profile",
            Self::CacheMb => "cache_mb",
            Self::Ca => "ca",
            Self::GazeTo => "gaze_to",
        }
    }

    /// The setting of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|key| key.name() == name)
    }

    /// All names, for a line that says what there is.
    pub(super) fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    /// The most characters of its value.
    pub(super) fn longest(self) -> usize {
        match self {
            Self::Room => 65_536,
            Self::Server | Self::Token | Self::Call => 8_192,
            _ => 64,
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The source of a value, the weakest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Origin {
    /// No source: the app's default.
    Default,
    /// `mon3tr.toml`.
    File,
    /// The link that the app was opened with.
    Link,
    /// An extra of the intent that started the app.
    Intent,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Default => "the app itself",
            Self::File => "mon3tr.toml",
            Self::Link => "the mon3tr:// link",
            Self::Intent => "the intent",
        })
    }
}
