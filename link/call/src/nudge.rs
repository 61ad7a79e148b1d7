//! Keeps a library's relayed packets moving.
//!
//! The driver of `webrtc` 0.21 hands a packet for a TURN server to its TURN client after it has sent what that client has ready, so that the
//! packet leaves only when something wakes the driver again: what else arrives, or its timer of 200 ms. Each of the twenty steps until a
//! relayed connection is open waited for that timer, and each frame for the next one. So the driver is woken often as long as a relay is
//! in use.

use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinHandle;
use tokio::time::{MissedTickBehavior, interval};
use webrtc::data_channel::DataChannel;

/// How long a packet may wait. A wake that finds nothing to do takes some ten microseconds.
const EVERY: Duration = Duration::from_millis(5);

/// Wakes a connection's driver until it is dropped.
#[derive(Debug)]
pub(crate) struct Nudge(JoinHandle<()>);

impl Nudge {
    /// Begins, by one of the connection's channels.
    pub(crate) fn begin(channel: Arc<dyn DataChannel>) -> Self {
        Self(tokio::spawn(async move {
            let mut ticks = interval(EVERY);
            ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
            loop {
                ticks.tick().await;
                // It is zero already: what counts is that the library wakes its driver, which nothing else public does without a packet.
                if channel.set_buffered_amount_low_threshold(0).await.is_err() {
                    return;
                }
            }
        }))
    }
}

impl Drop for Nudge {
    fn drop(&mut self) {
        self.0.abort();
    }
}
