//! Sends captured motion, one frame at a time.

use crate::{Capture, SendError};
use link_call::Sender;
use link_playout::Clock;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Sends what `capture` gives until it ends or `stop` is set. Blocks: a capture has a thread of its own.
///
/// # Errors
/// If the capture fails.
pub fn send(
    host: &Sender,
    capture: &mut dyn Capture,
    clock: Clock,
    stop: &AtomicBool,
) -> Result<(), SendError> {
    while !stop.load(Relaxed) {
        let Some(captured) = capture.next()? else {
            break;
        };
        host.publish(clock.at(captured.at), &captured.motion);
    }
    Ok(())
}
