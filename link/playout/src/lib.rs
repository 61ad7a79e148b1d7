//! When a motion frame is shown: the sender's clock compared with the viewer's ([`clock`]), and a buffer that frames leave in order, each
//! when it is due ([`jitter_buffer`]). Time is an argument; only [`Clock`] reads the system's, and nothing here talks to a network.
//!
//! ```
//! use link_codec::{Micros, MotionFrame};
//! use link_playout::JitterBuffer;
//!
//! let mut buffer = JitterBuffer::new();
//! // Captured 10 ms apart by the sender's clock; the second frame overtakes the first.
//! let frame = |sequence, captured| MotionFrame { sequence, captured: Micros(captured), ..MotionFrame::default() };
//! buffer.push(frame(2, 5_010_000), Micros(1_030_000), None);
//! buffer.push(frame(1, 5_000_000), Micros(1_031_000), None);
//! let shown: Vec<u32> = buffer.take(Micros(1_040_000)).map(|played| played.frame.sequence).collect();
//! assert_eq!(shown, [1, 2], "in order");
//! ```

#![forbid(unsafe_code)]

pub mod clock;
pub mod delay;
pub mod jitter_buffer;

pub use clock::Clock;
pub use delay::PlayoutDelay;
pub use jitter_buffer::JitterBuffer;
