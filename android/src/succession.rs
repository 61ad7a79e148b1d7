//! Which of a process's activities is the one to stay. A `NativeActivity` gets no later intents, so a link that is opened while the app runs comes as an
//! activity of its own, on top of the one before. Where the wearer has agreed to go before, it follows that one, which closes; somewhere new it follows one
//! that only shows a panel. Any other, such as the launcher's, goes back to where the app is.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// For how long an activity that follows none waits for one that is being closed: the app was closed and is launched again.
const BEING_CLOSED: Duration = Duration::from_secs(5);

/// All activities of the process that live.
static OF_PROCESS: Line = Line::new();

/// Where an activity's intent leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// To nothing of its own, as the launcher's: to what the settings' file says, if anything.
    Nowhere,
    /// To where the wearer is to be asked first.
    New,
    /// To where they have agreed to go.
    Known,
}

/// Activities in the order in which they were made.
#[derive(Debug)]
struct Line(Mutex<State>);

#[derive(Debug)]
struct State {
    made: u64,
    /// Of those that live: their numbers, and where they lead.
    live: Vec<(u64, Aim)>,
}

/// An activity's place, until it is destroyed.
#[derive(Debug)]
pub struct Place {
    line: &'static Line,
    number: u64,
    aim: Aim,
    /// Whether it has anything to do but to show a panel.
    has_task: bool,
    made: Instant,
}

/// Why an activity is to close.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// A newer one leads somewhere.
    Followed,
    /// An older one is there, which this one does not follow.
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

    fn enter(&'static self, aim: Aim, has_task: bool, now: Instant) -> Place {
        let mut state = self.state();
        state.made += 1;
        let number = state.made;
        state.live.push((number, aim));
        Place {
            line: self,
            number,
            aim,
            has_task,
            made: now,
        }
    }
}

impl Place {
    /// Of an activity that was just made, by where its intent leads, and whether its settings give it something to do.
    #[must_use]
    pub fn enter(aim: Aim, has_task: bool) -> Self {
        OF_PROCESS.enter(aim, has_task, Instant::now())
    }

    /// Why it is to close now; nothing while it may stay.
    #[must_use]
    pub fn is_over(&self, now: Instant) -> Option<Reason> {
        let state = self.line.state();
        let follows = |aim: Aim| match aim {
            Aim::Nowhere => false,
            Aim::New => !self.has_task,
            Aim::Known => true,
        };
        if (state.live.iter()).any(|(other, aim)| *other > self.number && follows(*aim)) {
            return Some(Reason::Followed);
        }
        let waited = now.saturating_duration_since(self.made) >= BEING_CLOSED;
        let older = || state.live.iter().any(|(other, _)| *other < self.number);
        (self.aim != Aim::Known && waited && older()).then_some(Reason::NotNeeded)
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
    fn a_known_link_follows_the_call_before_and_a_launch_goes_back_to_it() {
        static LINE: Line = Line::new();
        let begun = Instant::now();
        let later = begun + BEING_CLOSED;
        let first = LINE.enter(Aim::Nowhere, true, begun);
        assert_eq!(first.is_over(later), None, "alone");
        let second = LINE.enter(Aim::Known, true, begun);
        assert_eq!(first.is_over(begun), Some(Reason::Followed), "by a link");
        assert_eq!(
            second.is_over(later),
            None,
            "the newest that leads somewhere"
        );
        drop(first);
        let launched = LINE.enter(Aim::Nowhere, true, begun);
        assert_eq!(second.is_over(later), None, "a launch leads nowhere");
        assert_eq!(launched.is_over(begun), None, "the other may be closing");
        let expected = Some(Reason::NotNeeded);
        assert_eq!(launched.is_over(later), expected, "the other stays");
        drop(second);
        assert_eq!(launched.is_over(later), None, "it has become the only one");
    }

    #[test]
    fn a_link_to_somewhere_new_follows_a_panel_and_no_call() {
        static LINE: Line = Line::new();
        let begun = Instant::now();
        let later = begun + BEING_CLOSED;
        let panel = LINE.enter(Aim::Nowhere, false, begun);
        let asked = LINE.enter(Aim::New, true, begun);
        assert_eq!(panel.is_over(begun), Some(Reason::Followed), "a panel");
        drop(panel);
        assert_eq!(asked.is_over(later), None, "the wearer is asked");
        let another = LINE.enter(Aim::New, true, begun);
        assert_eq!(asked.is_over(later), None, "a call stays");
        let expected = Some(Reason::NotNeeded);
        assert_eq!(another.is_over(later), expected, "not asked meanwhile");
    }
}
