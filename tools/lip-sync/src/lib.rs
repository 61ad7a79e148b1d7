//! Which shape a mouth has, from the voice alone, and when eyes blink: for a person whose face no camera sees.
//!
//! A [`Listener`] takes 48 kHz sound and gives a [`Mouth`] for each 10 ms, 53 ms behind the sound at most: half a window of 25 ms, three
//! windows ahead, and a window's step. Its network is trained by the example `train` on speech that `speech.py` makes.

#![forbid(unsafe_code)]

mod blinks;
pub mod front_end;
mod listener;
mod mouth;
pub mod network;

pub use blinks::Blinks;
pub use listener::Listener;
pub use mouth::Mouth;

/// What the network tells apart, in the order of its outputs.
pub const CLASSES: [&str; 9] = ["silence", "a", "e", "i", "o", "u", "fv", "mbp", "other"];
/// The mouth shapes among [`CLASSES`], by the names that avatars' expressions have.
pub const SHAPES: [&str; 7] = ["a", "e", "i", "o", "u", "fv", "mbp"];
