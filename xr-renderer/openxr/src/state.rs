//! A session's life, as the runtime tells it: which states there are, which may follow one another, and what each asks for.
//!
//! Pure: it calls nothing. `OpenXR` 1.1, section 9.3 "Session Lifecycle".

use std::fmt;

use openxr::SessionState;

/// Where a session is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Life {
    /// It was made, and the runtime has said nothing yet.
    Made,
    /// It is not to run: the headset is off the head, or another program has it.
    Idle,
    /// It is to begin.
    Ready,
    /// Frames are paced, and nobody sees them.
    Synchronized,
    /// Frames are seen.
    Visible,
    /// Frames are seen, and hands and controllers are ours.
    Focused,
    /// It is to end.
    Stopping,
    /// The runtime is about to lose it; another can be made.
    Losing,
    /// It is over, and nobody wants another.
    Exiting,
}

impl fmt::Display for Life {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Made => "made",
            Self::Idle => "idle",
            Self::Ready => "ready",
            Self::Synchronized => "synchronized",
            Self::Visible => "visible",
            Self::Focused => "focused",
            Self::Stopping => "stopping",
            Self::Losing => "losing",
            Self::Exiting => "exiting",
        })
    }
}

/// What a change of state asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Duty {
    /// Nothing.
    None,
    /// `xrBeginSession`.
    Begin,
    /// `xrEndSession`.
    End,
    /// Let it go; a new one may be made.
    Renew,
    /// Let it go for good.
    Leave,
}

/// The states that one session passed.
#[derive(Debug, Clone)]
pub struct Lifecycle {
    now: Life,
    passed: Vec<Life>,
    running: bool,
}

impl Default for Lifecycle {
    fn default() -> Self {
        Self {
            now: Life::Made,
            passed: Vec::new(),
            running: false,
        }
    }
}

impl Lifecycle {
    /// Where the session is.
    #[must_use]
    pub fn now(&self) -> Life {
        self.now
    }

    /// The states passed so far, each as often as it was entered.
    #[must_use]
    pub fn passed(&self) -> &[Life] {
        &self.passed
    }

    /// Whether frames are to be waited for: between `xrBeginSession` and `xrEndSession`.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.running
    }

    /// Takes the state that the runtime says, and tells what that asks for. A runtime may leave states out; what would ask for
    /// something impossible (to begin what runs, to end what does not) asks for nothing, and is logged.
    pub fn enter(&mut self, state: SessionState) -> Duty {
        let next = match state {
            SessionState::IDLE => Life::Idle,
            SessionState::READY => Life::Ready,
            SessionState::SYNCHRONIZED => Life::Synchronized,
            SessionState::VISIBLE => Life::Visible,
            SessionState::FOCUSED => Life::Focused,
            SessionState::STOPPING => Life::Stopping,
            SessionState::LOSS_PENDING => Life::Losing,
            SessionState::EXITING => Life::Exiting,
            other => {
                log::warn!("the runtime names a session state that is unknown: {other:?}");
                return Duty::None;
            }
        };
        if !self.now.leads_to(next) {
            log::warn!("the runtime's session goes from {} to {next}", self.now);
        }
        log::debug!("session: {} to {next}", self.now);
        self.now = next;
        self.passed.push(next);
        match (next, self.running) {
            (Life::Ready, false) => Duty::Begin,
            (Life::Stopping, true) => Duty::End,
            (Life::Losing, _) => {
                self.running = false;
                Duty::Renew
            }
            (Life::Exiting, _) => {
                self.running = false;
                Duty::Leave
            }
            _ => Duty::None,
        }
    }

    /// `xrBeginSession` went well.
    pub fn begun(&mut self) {
        self.running = true;
    }

    /// `xrEndSession` was called.
    pub fn ended(&mut self) {
        self.running = false;
    }
}

impl Life {
    /// Whether the specification lets `next` follow.
    fn leads_to(self, next: Self) -> bool {
        match next {
            Self::Idle => matches!(self, Self::Made | Self::Stopping),
            Self::Ready | Self::Exiting => self == Self::Idle,
            Self::Synchronized => matches!(self, Self::Ready | Self::Visible),
            Self::Visible => matches!(self, Self::Synchronized | Self::Focused),
            Self::Focused => self == Self::Visible,
            // Monado stops sessions that are visible too.
            Self::Stopping => matches!(self, Self::Synchronized | Self::Visible | Self::Focused),
            Self::Losing => true,
            Self::Made => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use SessionState as S;

    fn through(states: &[S]) -> (Lifecycle, Vec<Duty>) {
        let mut life = Lifecycle::default();
        let duties = states
            .iter()
            .map(|state| {
                let duty = life.enter(*state);
                match duty {
                    Duty::Begin => life.begun(),
                    Duty::End => life.ended(),
                    _ => {}
                }
                duty
            })
            .collect();
        (life, duties)
    }

    #[test]
    fn a_session_begins_when_ready_and_ends_when_stopping_as_often_as_it_is_asked() {
        let once = [
            S::READY,
            S::SYNCHRONIZED,
            S::VISIBLE,
            S::FOCUSED,
            S::VISIBLE,
            S::SYNCHRONIZED,
            S::STOPPING,
            S::IDLE,
        ];
        let states = [&[S::IDLE][..], &once, &once, &[S::EXITING]].concat();
        let (life, duties) = through(&states);
        let count = |duty| duties.iter().filter(|one| **one == duty).count();
        assert_eq!(count(Duty::Begin), 2, "begins");
        assert_eq!(count(Duty::End), 2, "ends");
        assert_eq!(duties.last(), Some(&Duty::Leave), "the last");
        assert!(!life.is_running(), "it is over");
        assert_eq!(life.passed().len(), states.len(), "all are remembered");
    }

    #[test]
    fn frames_run_from_begin_to_end_only() {
        let (life, _) = through(&[S::IDLE]);
        assert!(!life.is_running(), "idle");
        let (life, _) = through(&[S::IDLE, S::READY]);
        assert!(life.is_running(), "begun");
        let (life, _) = through(&[S::IDLE, S::READY, S::SYNCHRONIZED, S::STOPPING]);
        assert!(!life.is_running(), "ended");
    }

    #[test]
    fn a_session_that_is_lost_is_renewed_from_wherever_it_was() {
        for before in [S::IDLE, S::READY, S::VISIBLE, S::STOPPING] {
            let (life, duties) = through(&[before, S::LOSS_PENDING]);
            assert_eq!(duties.last(), Some(&Duty::Renew), "after {before:?}");
            assert!(!life.is_running(), "no frames after {before:?}");
        }
    }

    #[test]
    fn a_runtime_that_says_ready_twice_or_stops_what_never_ran_asks_for_nothing() {
        let (_, duties) = through(&[S::IDLE, S::READY, S::READY]);
        assert_eq!(duties.last(), Some(&Duty::None), "ready twice");
        let (_, duties) = through(&[S::IDLE, S::STOPPING]);
        assert_eq!(duties.last(), Some(&Duty::None), "stopping at rest");
        let (life, duties) = through(&[S::from_raw(99)]);
        assert_eq!(duties.last(), Some(&Duty::None), "a state of the future");
        assert_eq!(life.now(), Life::Made, "which is not entered");
    }
}
