//! Which codecs there are, by the names they have in an announcement and on a command line.

use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// How motion is written. A viewer reads either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Codec {
    /// The paper's: FP16 and LZ4, each frame by itself. A rotation and each component of its shortest vector is
    /// within 0.1 degree, the root within 0.1 mm, a coefficient within 1/4096 of its range -8..=8.
    Paper,
    /// A third to a seventh of the paper's size. A rotation and each component of its shortest vector is within 0.5 degree (finger tips;
    /// the spine, hips and shoulders within 0.1), the root within 0.5 mm, a coefficient within 1/1024 of its range -8..=8.
    #[default]
    Compact,
}

impl fmt::Display for Codec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Paper => "paper",
            Self::Compact => "compact",
        })
    }
}

/// A codec's name was neither `paper` nor `compact`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no codec `{0}`: say `paper` or `compact`")]
pub struct UnknownCodec(String);

impl FromStr for Codec {
    type Err = UnknownCodec;

    fn from_str(name: &str) -> Result<Self, UnknownCodec> {
        match name {
            "paper" => Ok(Self::Paper),
            "compact" => Ok(Self::Compact),
            _ => Err(UnknownCodec(name.to_owned())),
        }
    }
}
