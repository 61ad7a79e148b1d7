//! What a sender says of itself before the first frame: its avatar package and how it will speak.

use std::{fmt, path::Path, str::FromStr};

use serde::{Deserialize, Serialize};

use crate::{PackageId, ProtocolError};
use link_codec::Codec;

/// No package is larger, in bytes: a bound on what a stranger's announcement can make this machine store.
pub const MAX_PACKAGE_BYTES: u64 = 1 << 30;

/// A package by hash and size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct AvatarRef {
    /// The hash of its bytes.
    pub sha256: PackageId,
    /// Its size in bytes.
    pub bytes: u64,
}

impl AvatarRef {
    /// What a package file is. Reads all of it: not for an async task.
    ///
    /// # Errors
    /// [`ProtocolError::File`] if it cannot be read.
    pub fn of_file(path: &Path) -> Result<Self, ProtocolError> {
        let metadata = path.metadata().map_err(|source| ProtocolError::File {
            path: path.to_owned(),
            source,
        })?;
        Ok(Self {
            sha256: PackageId::of_file(path)?,
            bytes: metadata.len(),
        })
    }

    /// Nothing if a package can have this size.
    ///
    /// # Errors
    /// [`ProtocolError::Announcement`] if it is empty or over [`MAX_PACKAGE_BYTES`].
    pub fn checked(&self) -> Result<(), ProtocolError> {
        if (1..=MAX_PACKAGE_BYTES).contains(&self.bytes) {
            return Ok(());
        }
        Err(ProtocolError::Announcement(format!(
            "a package of {} bytes, where 1 to {MAX_PACKAGE_BYTES} can be",
            self.bytes
        )))
    }
}

/// How the data channel delivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChannelMode {
    /// Unordered, nothing is sent twice.
    #[default]
    Unreliable,
    /// Ordered and complete: the paper's.
    Reliable,
}

impl fmt::Display for ChannelMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unreliable => "unreliable",
            Self::Reliable => "reliable",
        })
    }
}

impl FromStr for ChannelMode {
    type Err = ProtocolError;

    fn from_str(word: &str) -> Result<Self, ProtocolError> {
        match word {
            "unreliable" => Ok(Self::Unreliable),
            "reliable" => Ok(Self::Reliable),
            _ => Err(ProtocolError::NoSuchChoice {
                what: "channel",
                word: word.to_owned(),
                choices: "unreliable or reliable",
            }),
        }
    }
}

/// What a sender announces. One that was read or made by [`Announcement::checked`] is within bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Announcement {
    /// The package that viewers must have.
    pub avatar: AvatarRef,
    /// How the data channel must be opened.
    pub channel: ChannelMode,
    /// The codec of the frames.
    pub codec: Codec,
    /// Frames a second.
    pub rate_hz: f64,
}

impl Announcement {
    /// This announcement, if a call can be so.
    ///
    /// # Errors
    /// [`ProtocolError::Announcement`] if the rate is not within 1 to 240 Hz or the package empty or over [`MAX_PACKAGE_BYTES`].
    pub fn checked(self) -> Result<Self, ProtocolError> {
        // NaN is in no range.
        if !(1.0..=240.0).contains(&self.rate_hz) {
            return Err(ProtocolError::Announcement(format!(
                "{} frames a second, where 1 to 240 can be",
                self.rate_hz
            )));
        }
        self.avatar.checked()?;
        Ok(self)
    }
}

/// An announcement as it came.
#[derive(Deserialize)]
struct Unchecked {
    avatar: AvatarRef,
    channel: ChannelMode,
    codec: Codec,
    rate_hz: f64,
}

impl TryFrom<Unchecked> for Announcement {
    type Error = ProtocolError;

    fn try_from(from: Unchecked) -> Result<Self, ProtocolError> {
        Self {
            avatar: from.avatar,
            channel: from.channel,
            codec: from.codec,
            rate_hz: from.rate_hz,
        }
        .checked()
    }
}
