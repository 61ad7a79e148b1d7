//! Why a decoder refused a message, and how often.

use serde::{Serialize, Serializer};
use std::fmt;

use thiserror::Error;

macro_rules! decode_errors {
    ($($(#[doc = $doc:literal])+ $variant:ident = $name:literal: $text:literal;)*) => {
        /// Why a decoder refused a message. The decoder's state is as before the message.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Error)]
        pub enum DecodeError {
            $($(#[doc = $doc])+ #[error($text)] $variant,)*
        }

        impl DecodeError {
            /// All reasons.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$variant,)*];

            /// The reason's name in JSON and metrics.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }
        }
    };
}

decode_errors! {
    /// The first byte names no motion codec.
    Kind = "kind": "the message is of no known motion codec";
    /// The codec's version is another one.
    Version = "version": "the message is of another version of the codec";
    /// Too short, or more than the frame needs.
    Length = "length": "the message is too short or too long for a frame";
    /// The LZ4 block does not unpack to a frame.
    Lz4 = "lz4": "the LZ4 block does not unpack to a frame";
    /// A number is NaN or infinite.
    NotFinite = "not_finite": "a motion value is not a finite number";
    /// A rotation is longer than a half turn, or a quaternion is not of unit length.
    AngleRange = "angle_range": "a rotation is out of range";
    /// The root is further than a kilometre away.
    TranslationRange = "translation_range": "the root translation is out of range";
    /// A coefficient is beyond -8..=8.
    ExpressionRange = "expression_range": "an expression coefficient is out of range";
    /// The message belongs to another session.
    ForeignSession = "foreign_session": "the message belongs to another session";
    /// A frame of this sequence has arrived before.
    Replayed = "replayed": "a frame with this sequence number has arrived before";
    /// The frame is older than the window of 64 frames.
    Late = "late": "the frame is more than 64 frames older than the newest";
    /// The capture time contradicts the sequence's order.
    TimeBackwards = "time_backwards": "the capture time contradicts the order of the sequence numbers";
    /// The frame is predicted from one that never arrived.
    Reference = "reference": "the frame is predicted from one that never arrived";
    /// The frame's checksum, or the coding of its numbers, is wrong.
    Corrupt = "corrupt": "the frame does not match its checksum";
}

/// How many messages were refused, by reason.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct DecodeErrorCounts([u64; DecodeError::ALL.len()]);

impl DecodeErrorCounts {
    /// Counts one.
    pub fn add(&mut self, error: DecodeError) {
        self.0[error as usize] += 1;
    }

    /// How many were refused for this reason.
    #[must_use]
    pub fn of(&self, error: DecodeError) -> u64 {
        self.0[error as usize]
    }

    /// How many were refused for any reason.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.iter().sum()
    }

    /// Every reason's name and count.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, u64)> + '_ {
        DecodeError::ALL
            .into_iter()
            .map(|error| (error.name(), self.of(error)))
    }
}

impl Serialize for DecodeErrorCounts {
    /// As a map of the reasons that occurred.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().filter(|(_, count)| *count > 0))
    }
}

impl fmt::Display for DecodeErrorCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut comma = "";
        for (name, count) in self.iter().filter(|(_, count)| *count > 0) {
            write!(f, "{comma}{count} {name}")?;
            comma = ", ";
        }
        Ok(())
    }
}
