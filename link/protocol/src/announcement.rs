//! The announcement: what viewers get before the first frame, its avatar package and how motion will be sent.

use std::{fmt, fs::File, path::Path, str::FromStr};

use serde::{Deserialize, Serialize};

use crate::limits::{FRAME_RATE_HZ, MAX_PACKAGE_BYTES};
use crate::package_id::PackageHasher;
use crate::{PackageId, ProtocolError};
use link_codec::Codec;

/// A package by hash and size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct AvatarRef {
    /// The hash of its bytes.
    pub sha256: PackageId,
    /// Its size in bytes.
    pub bytes: u64,
}

impl AvatarRef {
    /// Hash and size of a package file. Reads all of it: not for an async task.
    ///
    /// # Errors
    /// [`ProtocolError::File`] if it cannot be read.
    pub fn of_file(path: &Path) -> Result<Self, ProtocolError> {
        let hash = || {
            let mut hasher = PackageHasher::default();
            let bytes = hasher.read_from(&mut File::open(path)?)?;
            Ok(Self {
                sha256: hasher.finish(),
                bytes,
            })
        };
        hash().map_err(|source| ProtocolError::File {
            path: path.to_owned(),
            source,
        })
    }

    /// Checks the size.
    ///
    /// # Errors
    /// [`ProtocolError::Announcement`] if it is empty or over [`MAX_PACKAGE_BYTES`].
    pub fn checked(&self) -> Result<(), ProtocolError> {
        if (1..=MAX_PACKAGE_BYTES).contains(&self.bytes) {
            return Ok(());
        }
        Err(ProtocolError::Announcement(format!(
            "a package of {} bytes, and packages have 1 to {MAX_PACKAGE_BYTES}",
            self.bytes
        )))
    }
}

/// How the data channels deliver messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChannelMode {
    /// Unordered, without retransmission.
    #[default]
    Unreliable,
    /// Ordered and complete, as in the paper.
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
            _ => Err(ProtocolError::ChannelMode(word.to_owned())),
        }
    }
}

/// What a sender announces. One that was deserialised or returned by [`Announcement::checked`] is within bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Announcement {
    /// The package that viewers must have.
    pub avatar: AvatarRef,
    /// How the data channels must be opened.
    pub channel: ChannelMode,
    /// The codec of the frames.
    pub codec: Codec,
    /// Frames a second.
    pub rate_hz: f64,
}

impl Announcement {
    /// This announcement, if its values are within bounds.
    ///
    /// # Errors
    /// [`ProtocolError::Announcement`] if the rate is not within 1 to 240 Hz or the package empty or over [`MAX_PACKAGE_BYTES`].
    pub fn checked(self) -> Result<Self, ProtocolError> {
        // NaN is in no range.
        if !FRAME_RATE_HZ.contains(&self.rate_hz) {
            return Err(ProtocolError::Announcement(format!(
                "rate_hz is {}, and it is {} to {}",
                self.rate_hz,
                FRAME_RATE_HZ.start(),
                FRAME_RATE_HZ.end()
            )));
        }
        self.avatar.checked()?;
        Ok(self)
    }
}

/// An announcement as it was received.
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
