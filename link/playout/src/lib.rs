//! When a motion frame is to be shown: the sender's clock by this machine's ([`clock`]), and frames that leave in order, each when it
//! is due ([`jitter_buffer`]). Time is handed in and nothing here talks to a network.

pub mod clock;
pub mod jitter_buffer;

pub use clock::Clock;
pub use jitter_buffer::JitterBuffer;
