//! What crosses the network in a call: motion frames and the messages around them (`docs/protocol.md`), the WebRTC data channel
//! they take, and HTTP to the server for signaling and packages. Knows bytes and time; draws nothing.

mod frame;

pub use frame::{Micros, MotionFrame};
