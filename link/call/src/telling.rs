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

/// The times at which something is told that stays as it is: so many times at first, 100 ms apart, then every 0.4 s, for each message may be lost. It is a sign of
/// life, too: a viewer that hears nothing for 0.8 s connects again.
#[derive(Debug)]
pub(crate) struct Repeated {
    at_once: u32,
    next: Instant,
}

const AGAIN: Duration = Duration::from_millis(400);

impl Default for Repeated {
    fn default() -> Self {
        Self {
            at_once: AT_ONCE,
            next: Instant::now(),
        }
    }
}

impl Repeated {
    /// Waits until it is time to tell. May be cancelled.
    pub(crate) async fn due(&mut self) {
        sleep_until(self.next).await;
        self.at_once = self.at_once.saturating_sub(1);
        let pause = if self.at_once > 0 { BETWEEN } else { AGAIN };
        self.next = Instant::now() + pause;
    }
}

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
        self.next = pause(state, self.at_once).map(|pause| Instant::now() + pause);
        state
    }
}

/// How long after this it is told again, with so many of [`AT_ONCE`] left; nothing where it need not be.
fn pause(state: PersonState, at_once: u32) -> Option<Duration> {
    match state {
        _ if at_once > 0 => Some(BETWEEN),
        PersonState { hidden: true, .. } => Some(WHILE_HIDDEN),
        PersonState { muted: true, .. } => Some(WHILE_MUTED),
        PersonState { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_state_is_told_at_once_three_times_and_after_each_change() {
        let privacy = Privacy::default();
        let mut telling = Telling::begin(&privacy);
        for _ in 0..AT_ONCE {
            assert_eq!(telling.due().await, PersonState::default());
        }
        assert!(telling.next.is_none(), "nothing more to tell");
        let hidden = privacy.toggle_hide();
        assert_eq!(telling.due().await, hidden, "a change");
        assert_eq!(telling.at_once, AT_ONCE - 1, "told again");
        // Two changes before it could be told: the newest.
        privacy.toggle_mute();
        let seen = privacy.toggle_hide();
        assert_eq!(telling.due().await, seen);
        assert!(seen.muted && !seen.hidden, "{seen:?}");
    }

    #[test]
    fn who_is_not_seen_gives_signs_of_life_and_who_is_not_heard_is_told_of_now_and_then() {
        let state = |muted, hidden| PersonState { muted, hidden };
        assert_eq!(pause(state(false, false), 1), Some(BETWEEN));
        assert_eq!(pause(state(false, false), 0), None);
        assert_eq!(pause(state(true, false), 0), Some(WHILE_MUTED));
        for muted in [false, true] {
            assert_eq!(pause(state(muted, true), 0), Some(WHILE_HIDDEN));
        }
        // Before the viewer doubts the connection, also where one is lost.
        assert!(2 * WHILE_HIDDEN < Duration::from_millis(800));
    }
}
