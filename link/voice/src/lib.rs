//! A person's voice on its way: samples become Opus packets ([`VoiceEncoder`]), and packets become samples again at the time at which
//! they are to be heard ([`VoicePlayout`]), with losses concealed and the lips' time kept; a [`VoiceQueue`] is between a connection and the
//! thread that plays. Time is an argument; nothing here talks to a
//! network or to a sound card.
//!
//! Everything is one channel of 48 kHz, in frames of 20 ms ([`FRAME`] samples from -1 to 1).
//!
//! ```
//! use link_codec::Micros;
//! use link_voice::{FRAME, Voice, VoiceEncoder, VoicePlayout};
//!
//! let (mut encoder, mut playout) = (VoiceEncoder::new()?, VoicePlayout::new()?);
//! let (mut spoken, mut heard) = ([0.0; FRAME], [0.0; FRAME]);
//! let mut loudest = 0.0f32;
//! for frame in 0..50u64 {
//!     for (k, sample) in (frame * FRAME as u64..).zip(&mut spoken) {
//!         *sample = (k as f32 * 0.02).sin() * 0.3;
//!     }
//!     // Captured every 20 ms by the sender's clock, and here 30 ms later.
//!     let captured = encoder.captured(Micros(frame * 20_000));
//!     if let Some(opus) = encoder.encode(&spoken)? {
//!         playout.push(Voice { captured, opus }, Micros(frame * 20_000 + 30_000));
//!     }
//!     playout.play(Micros(frame * 20_000 + 30_000), None, &mut heard);
//!     loudest = heard.iter().fold(loudest, |most, sample| most.max(sample.abs()));
//! }
//! assert!(loudest > 0.1, "it is heard");
//! assert_eq!(playout.statistics().concealed, 0, "nothing was lost");
//! # Ok::<(), link_voice::VoiceError>(())
//! ```

#![forbid(unsafe_code)]

mod encoder;
mod error;
mod pace;
mod playout;
mod queue;
mod stretch;
pub mod timestamp;

pub use encoder::VoiceEncoder;
pub use error::VoiceError;
pub use pace::Pace;
pub use playout::{VoicePlayout, VoiceStatistics};
pub use queue::{VoicePlayer, VoiceQueue};

use bytes::Bytes;
use link_codec::Micros;

/// Samples a second.
pub const RATE: u32 = 48_000;
/// Samples of a frame: 20 ms.
pub const FRAME: usize = 960;
/// The same in microseconds.
pub const FRAME_US: u64 = 20_000;
/// The longest packet that is taken: Opus' own bound for one frame (RFC 6716, section 3.4).
pub const MAX_PACKET_BYTES: usize = 1_275;

/// One packet of voice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Voice {
    /// When the first sample that comes of it was captured, by the sender's clock ([`VoiceEncoder::captured`]).
    pub captured: Micros,
    /// One Opus frame of 20 ms.
    pub opus: Bytes,
}
