//! When a sender tells a viewer whether it is heard and seen.

use crate::privacy::Privacy;
use link_protocol::data_channel::PersonState;
use std::future::pending;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

/// At first, and after a change, it is told so many times: each message may be lost.
const AT_ONCE: u32 = 3;
const BETWEEN: Duration = Duration::from_millis(100);

/// Without motion this is the sign of life that a viewer waits for, and what tells it the sender's time.
const WHILE_HIDDEN: Duration = Duration::from_millis(200);

/// For a viewer that has lost all of the first ones.
const WHILE_MUTED: Duration = Duration::from_secs(1);

/// The times at which one viewer is told.
#[derive(Debug)]
pub(crate) struct Telling {
    state: watch::Receiver<PersonState>,
    /// What remains of [`AT_ONCE`].
    at_once: u32,
    next: Option<Instant>,
}

impl Telling {
    /// From now on.
    pub(crate) fn begin(privacy: &Privacy) -> Self {
        Self {
            state: privacy.subscribe(),
            at_once: AT_ONCE,
            next: Some(Instant::now()),
        }
    }

    /// Waits until it is time to tell; what. May be cancelled.
    pub(crate) async fn due(&mut self) -> PersonState {
        let next = self.next;
        let time = async {
            match next {
                Some(next) => sleep_until(next).await,
                None => pending().await,
            }
        };
        tokio::select! {
            changed = self.state.changed() => {
                if changed.is_err() {
                    // The sender is being dropped, which ends the viewer's task.
                    return pending().await;
                }
                self.at_once = AT_ONCE;
            }
            () = time => {}
        }
        let state = *self.state.borrow_and_update();
        self.at_once = self.at_once.saturating_sub(1);
        let pause = match state {
            _ if self.at_once > 0 => Some(BETWEEN),
            PersonState { hidden: true, .. } => Some(WHILE_HIDDEN),
            PersonState { muted: true, .. } => Some(WHILE_MUTED),
            PersonState { .. } => None,
        };
        self.next = pause.map(|pause| Instant::now() + pause);
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::time::timeout;

    #[tokio::test(start_paused = true)]
    async fn a_state_is_told_three_times_then_as_often_as_it_is_needed() {
        let privacy = Privacy::default();
        let mut telling = Telling::begin(&privacy);
        let begun = Instant::now();
        let mut told = async |within: u64| {
            let due = timeout(Duration::from_millis(within), telling.due()).await;
            due.ok().map(|state| (begun.elapsed().as_millis(), state))
        };
        let plain = PersonState::default();
        for at in [0, 100, 200] {
            assert_eq!(told(150).await, Some((at, plain)));
        }
        assert_eq!(told(60_000).await, None, "nothing to tell");
        let hidden = PersonState {
            hidden: true,
            ..plain
        };
        privacy.set(hidden);
        for at in [60_200, 60_300, 60_400, 60_600, 60_800] {
            assert_eq!(told(300).await, Some((at, hidden)));
        }
        let muted = PersonState {
            muted: true,
            ..plain
        };
        privacy.set(muted);
        for at in [60_800, 60_900, 61_000, 62_000, 63_000] {
            assert_eq!(told(1100).await, Some((at, muted)));
        }
    }
}
