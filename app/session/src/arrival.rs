//! Before a call: waiting until the sender is in the room.

use link_http::{Client, HttpError};
use link_protocol::{Announcement, RoomLink};
use std::time::Duration;

/// Between two questions whether the sender has come.
const PAUSE: Duration = Duration::from_millis(500);

/// Between two looks whether it is over.
const LOOK: Duration = Duration::from_millis(50);

/// Why it takes time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Waiting {
    /// The room is there, and no sender is in it.
    ForSender,
    /// The server cannot be asked at the moment: why, in a line.
    Trouble(String),
}

/// What `outcome` comes to; nothing if `is_over` before, which is looked at twenty times a second. What has come of it by then is
/// dropped.
pub async fn unless_over<T>(
    is_over: impl Fn() -> bool,
    outcome: impl Future<Output = T>,
) -> Option<T> {
    let over = async {
        while !is_over() {
            tokio::time::sleep(LOOK).await;
        }
    };
    tokio::select! {
        biased;
        () = over => None,
        outcome = outcome => Some(outcome),
    }
}

/// Asks until the sender is in the room; nothing if `is_over` before, also in the middle of a question. What it waits for is `told`
/// when it changes: once, not twice a second.
///
/// # Errors
/// What asking again cannot mend: a wrong link, say.
pub async fn wait_for_sender(
    client: &Client,
    room: &RoomLink,
    is_over: impl Fn() -> bool,
    mut told: impl FnMut(&Waiting),
) -> Result<Option<Announcement>, HttpError> {
    let asking = async {
        let mut last = None;
        loop {
            let waiting = match client.announcement(room).await {
                Ok(Some(announced)) => return Ok(announced),
                Ok(None) => Waiting::ForSender,
                Err(error) if error.is_final() => return Err(error),
                Err(error) => Waiting::Trouble(app_pipeline::error::in_full(&error)),
            };
            if last.as_ref() != Some(&waiting) {
                told(&waiting);
                last = Some(waiting);
            }
            tokio::time::sleep(PAUSE).await;
        }
    };
    unless_over(is_over, asking).await.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[tokio::test]
    async fn what_never_comes_to_an_end_is_left_when_it_is_over() {
        let looks = Cell::new(0);
        let is_over = || {
            looks.set(looks.get() + 1);
            looks.get() > 2
        };
        let never = std::future::pending::<()>();
        assert_eq!(unless_over(is_over, never).await, None, "left");
        assert_eq!(looks.get(), 3, "as soon as it was over");
        let done = unless_over(|| false, std::future::ready(7)).await;
        assert_eq!(done, Some(7), "what came");
    }
}
