//! The microphone and the loudspeaker of a machine: [`Microphone`] and [`Loudspeaker`]. Both come back by themselves after their device or its
//! server was away. On Android they are AAudio's, elsewhere those of PulseAudio's native protocol.
//!
//! A microphone is one channel, a loudspeaker two, of 48 kHz, samples from -1 to 1; the server converts what a device has otherwise.

#[cfg(target_os = "android")]
mod aaudio;
mod clock;
#[cfg(any(target_os = "android", test))]
mod heard;
#[cfg(not(target_os = "android"))]
mod pulse;

#[cfg(target_os = "android")]
pub use aaudio::{Loudspeaker, Microphone, SoundError, SoundServer};
#[cfg(not(target_os = "android"))]
pub use pulse::{Loudspeaker, Microphone, SoundError, SoundServer};

use std::time::{Duration, Instant};

/// Samples a second.
pub const RATE: u32 = 48_000;

/// Makes the next samples, left and right: of a moment by an even clock, which are heard so much later. It is called by the loudspeaker's own thread.
pub type Fill = Box<dyn FnMut(Instant, Duration, &mut [[f32; 2]]) + Send>;
