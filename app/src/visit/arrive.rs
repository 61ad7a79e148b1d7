//! Before a call: waiting until somebody is in the room.

use link::{Announcement, Client, HttpError, RoomLink};
use std::time::Duration;

/// Between two questions whether the sender has come.
const PAUSE: Duration = Duration::from_millis(500);

/// Why it takes time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Waiting {
    /// The room is there, and nobody is in it.
    ForSender,
    /// The server cannot be asked at the moment: why, in a line.
    Trouble(String),
}

/// Asks until the sender is in the room; nothing if `is_over` before. What it waits for is `told` when it changes: once, not
/// twice a second.
///
/// # Errors
/// What asking again cannot mend: a wrong link, say.
pub async fn wait_for_sender(
    client: &Client,
    room: &RoomLink,
    is_over: impl Fn() -> bool,
    mut told: impl FnMut(&Waiting),
) -> Result<Option<Announcement>, HttpError> {
    let mut last = None;
    while !is_over() {
        let waiting = match client.ask(room).await {
            Ok(Some(announced)) => return Ok(Some(announced)),
            Ok(None) => Waiting::ForSender,
            Err(error) if error.is_final() => return Err(error),
            Err(error) => Waiting::Trouble(crate::error::in_full(&error)),
        };
        if last.as_ref() != Some(&waiting) {
            told(&waiting);
            last = Some(waiting);
        }
        tokio::time::sleep(PAUSE).await;
    }
    Ok(None)
}
