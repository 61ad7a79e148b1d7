//! Which of a process's activities is the one to stay. A `NativeActivity` gets no later intents, so a link that is opened while the app runs comes as an
//! activity of its own, on top of the one before: where the wearer has agreed to go there before, it follows that one, which closes. Any other, such as the
//! launcher's, goes where the app is already: a link to a server that is new here is asked about when no call runs.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// For how long an activity that brings no task waits for one that is being closed: the app was closed and is launched again.
const BEING_CLOSED: Duration = Duration::from_secs(5);

/// All activities of the process that live.
static OF_PROCESS: Line = Line::new();

/// Activities in the order in which they were made.
#[derive(Debug)]
struct Line(Mutex<State>);

#[derive(Debug)]
struct State {
    made: u64,
    /// Of those that live: their numbers, and whether they bring a task.
    live: Vec<(u64, bool)>,
}

/// An activity's place, until it is destroyed.
#[derive(Debug)]
pub struct Place {
    line: &'static Line,
    number: u64,
    has_task: bool,
    made: Instant,
}

/// Why an activity is to close.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// A newer one was opened with a task.
    Followed,
    /// An older one is there, and this one brings no task, or none to leave a call for.
    NotNeeded,
}

impl Reason {
    /// In words.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Followed => "another link was opened: this call is left for it",
            Self::NotNeeded => {
                "the app runs already, and what it was opened with leads nowhere that is known here: going back to it"
            }
        }
    }
}

impl Line {
    const fn new() -> Self {
        Self(Mutex::new(State {
            made: 0,
            live: Vec::new(),
        }))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn enter(&'static self, has_task: bool, now: Instant) -> Place {
        let mut state = self.state();
        state.made += 1;
        let number = state.made;
        state.live.push((number, has_task));
        Place {
            line: self,
            number,
            has_task,
            made: now,
        }
    }
}

impl Place {
    /// Of an activity that was just made, and whether it brings a task that a call is to be left for.
    pub fn enter(has_task: bool) -> Self {
        OF_PROCESS.enter(has_task, Instant::now())
    }

    /// Why it is to close now; nothing while it may stay.
    #[must_use]
    pub fn is_over(&self, now: Instant) -> Option<Reason> {
        let state = self.line.state();
        if (state.live.iter()).any(|(other, has_task)| *other > self.number && *has_task) {
            return Some(Reason::Followed);
        }
        let waited = now.saturating_duration_since(self.made) >= BEING_CLOSED;
        let older = || state.live.iter().any(|(other, _)| *other < self.number);
        (!self.has_task && waited && older()).then_some(Reason::NotNeeded)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.line
            .state()
            .live
            .retain(|(other, _)| *other != self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_follows_the_call_before_and_a_launch_goes_back_to_it() {
        static LINE: Line = Line::new();
        let begun = Instant::now();
        let later = begun + BEING_CLOSED;
        let first = LINE.enter(false, begun);
        assert_eq!(first.is_over(later), None, "alone");
        let second = LINE.enter(true, begun);
        assert_eq!(first.is_over(begun), Some(Reason::Followed), "by a link");
        assert_eq!(second.is_over(later), None, "it has the newest task");
        drop(first);
        let launched = LINE.enter(false, begun);
        assert_eq!(second.is_over(later), None, "no task follows it");
        assert_eq!(launched.is_over(begun), None, "the other may be closing");
        let expected = Some(Reason::NotNeeded);
        assert_eq!(launched.is_over(later), expected, "the other stays");
        drop(second);
        assert_eq!(launched.is_over(later), None, "it has become the only one");
    }
}
