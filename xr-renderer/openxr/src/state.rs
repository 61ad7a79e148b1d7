//! A session's life cycle as a state machine: the states that the runtime reports, the allowed order, and the call that each asks for.
//!
//! Pure: it makes no OpenXR calls. `OpenXR` 1.1, section 9.3 "Session Lifecycle".

use std::fmt;

use openxr::SessionState as XrSessionState;

/// Where a session is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SessionState {
    /// It was made, and the runtime has reported no state yet.
    Made,
    /// It is not to run: the headset is off the head, or another program has it.
    Idle,
    /// It is to begin.
    Ready,
    /// Frames are paced, but not displayed.
    Synchronized,
    /// Frames are seen.
    Visible,
    /// Frames are seen, and hands and controllers are ours.
    Focused,
    /// It is to end.
    Stopping,
    /// The runtime is about to lose it; another can be made.
    Losing,
    /// It is over; no other is to be made.
    Exiting,
}

impl fmt::Display for SessionState {
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
pub enum SessionAction {
    /// Nothing.
    None,
    /// `xrBeginSession`.
    Begin,
    /// `xrEndSession`.
    End,
    /// Destroy it; a new one may be made.
    Recreate,
    /// Destroy it, and make no other.
    Exit,
}

/// The states that one session passed.
#[derive(Debug, Clone)]
pub struct Lifecycle {
    now: SessionState,
    passed: Vec<SessionState>,
    running: bool,
}

impl Default for Lifecycle {
    fn default() -> Self {
        Self {
            now: SessionState::Made,
            passed: Vec::new(),
            running: false,
        }
    }
}

impl Lifecycle {
    /// Where the session is.
    #[must_use]
    pub fn now(&self) -> SessionState {
        self.now
    }

    /// The states passed so far, each as often as it was entered.
    #[must_use]
    pub fn passed(&self) -> &[SessionState] {
        &self.passed
    }

    /// Whether frames are to be waited for: between `xrBeginSession` and `xrEndSession`.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.running
    }

    /// Takes the state that the runtime reports, and returns the action. A runtime may leave states out; what would ask for
    /// something impossible (to begin what runs, to end what does not) asks for nothing, and is logged.
    pub fn enter(&mut self, state: XrSessionState) -> SessionAction {
        let next = match state {
            XrSessionState::IDLE => SessionState::Idle,
            XrSessionState::READY => SessionState::Ready,
            XrSessionState::SYNCHRONIZED => SessionState::Synchronized,
            XrSessionState::VISIBLE => SessionState::Visible,
            XrSessionState::FOCUSED => SessionState::Focused,
            XrSessionState::STOPPING => SessionState::Stopping,
            XrSessionState::LOSS_PENDING => SessionState::Losing,
            XrSessionState::EXITING => SessionState::Exiting,
            other => {
                log::warn!("the runtime names a session state that is unknown: {other:?}");
                return SessionAction::None;
            }
        };
        if !self.now.leads_to(next) {
            log::warn!("the runtime's session goes from {} to {next}", self.now);
        }
        log::debug!("session: {} to {next}", self.now);
        self.now = next;
        self.passed.push(next);
        match (next, self.running) {
            (SessionState::Ready, false) => SessionAction::Begin,
            (SessionState::Stopping, true) => SessionAction::End,
            (SessionState::Losing, _) => {
                self.running = false;
                SessionAction::Recreate
            }
            (SessionState::Exiting, _) => {
                self.running = false;
                SessionAction::Exit
            }
            _ => SessionAction::None,
        }
    }

    /// `xrBeginSession` succeeded.
    pub fn begun(&mut self) {
        self.running = true;
    }

    /// `xrEndSession` was called.
    pub fn ended(&mut self) {
        self.running = false;
    }
}

impl SessionState {
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
    use XrSessionState as S;

    fn through(states: &[S]) -> (Lifecycle, Vec<SessionAction>) {
        let mut life = Lifecycle::default();
        let actions = states
            .iter()
            .map(|state| {
                let action = life.enter(*state);
                match action {
                    SessionAction::Begin => life.begun(),
                    SessionAction::End => life.ended(),
                    _ => {}
                }
                action
            })
            .collect();
        (life, actions)
    }

    #[test]
    fn a_session_begins_at_every_ready_and_ends_at_every_stopping() {
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
        let (life, actions) = through(&states);
        let count = |action| actions.iter().filter(|one| **one == action).count();
        assert_eq!(count(SessionAction::Begin), 2, "begins");
        assert_eq!(count(SessionAction::End), 2, "ends");
        assert_eq!(actions.last(), Some(&SessionAction::Exit), "the last");
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
    fn a_lost_session_is_made_again_from_any_state() {
        for before in [S::IDLE, S::READY, S::VISIBLE, S::STOPPING] {
            let (life, actions) = through(&[before, S::LOSS_PENDING]);
            assert_eq!(
                actions.last(),
                Some(&SessionAction::Recreate),
                "after {before:?}"
            );
            assert!(!life.is_running(), "no frames after {before:?}");
        }
    }

    #[test]
    fn a_second_ready_or_a_stop_before_begin_has_no_action() {
        let (_, actions) = through(&[S::IDLE, S::READY, S::READY]);
        assert_eq!(actions.last(), Some(&SessionAction::None), "ready twice");
        let (_, actions) = through(&[S::IDLE, S::STOPPING]);
        assert_eq!(
            actions.last(),
            Some(&SessionAction::None),
            "stopping at rest"
        );
        let (life, actions) = through(&[S::from_raw(99)]);
        assert_eq!(
            actions.last(),
            Some(&SessionAction::None),
            "a state of the future"
        );
        assert_eq!(life.now(), SessionState::Made, "which is not entered");
    }
}
