//! From events to commands. It has two states: the phase, which Android's last event gives, and the state of the
//! call. An order of events that Android promises not to send is reported as an [`Oddity`]; the response is always the careful
//! choice: it may stop the GPU's work, and starts it only for an activity that is in front.

use super::Event;
use std::fmt;

/// A command to the call.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Command {
    /// Begin. The call may use the GPU from now on.
    Start,
    /// Stop the GPU's work, before another event is taken. The network goes on.
    Pause,
    /// Draw again.
    Resume,
    /// Free what can be made again.
    Trim(Trim),
    /// Hang up, and end every thread.
    Leave,
}

/// The memory that may be freed now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Trim {
    /// The host's, and the device's.
    All,
    /// The host's alone: while the call is paused the GPU is not touched, not even to free something.
    HostOnly,
}

/// An order of events that Android promises not to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Oddity {
    /// The event.
    pub event: Event,
    /// The phase before it.
    after: Phase,
}

impl fmt::Display for Oddity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "Android says `{}` to an activity that {}",
            self.event,
            match self.after {
                Phase::Made => "was not started",
                Phase::Started => "is not in front",
                Phase::Resumed => "is in front",
                Phase::Stopped => "is stopped",
                Phase::Destroyed => "is destroyed",
            }
        )
    }
}

/// The result of one event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// The commands, to be done in this order, before another event is taken.
    pub commands: &'static [Command],
    /// To be logged.
    pub oddity: Option<Oddity>,
}

/// The phase by Android's last event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Made,
    /// Started and not in front: before the first resume, or after a pause.
    Started,
    Resumed,
    Stopped,
    Destroyed,
}

/// The state of the call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Call {
    NotBegun,
    Running,
    Paused,
    Over,
}

/// The state of one activity.
#[derive(Debug, Clone)]
pub struct Machine {
    phase: Phase,
    call: Call,
    window: bool,
}

impl Default for Machine {
    fn default() -> Self {
        Self::new()
    }
}

impl Machine {
    /// Of an activity that was just made.
    #[must_use]
    pub fn new() -> Self {
        Self {
            phase: Phase::Made,
            call: Call::NotBegun,
            window: false,
        }
    }

    /// Whether the GPU may be touched now.
    #[must_use]
    pub fn may_draw(&self) -> bool {
        self.call == Call::Running
    }

    /// Whether no event can follow.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.phase == Phase::Destroyed
    }

    /// Takes an event.
    pub fn on(&mut self, event: Event) -> Step {
        let after = self.phase;
        let oddity = (!self.expects(event)).then_some(Oddity { event, after });
        let commands = if self.is_over() {
            &[]
        } else {
            self.take(event)
        };
        Step { commands, oddity }
    }

    /// Whether Android may send this now.
    fn expects(&self, event: Event) -> bool {
        let phases: &[Phase] = match event {
            Event::Start => &[Phase::Made, Phase::Stopped],
            Event::Resume => &[Phase::Started],
            Event::Pause => &[Phase::Resumed],
            Event::Stop => &[Phase::Started],
            // `Made`: an activity whose own onCreate failed.
            Event::Destroy => &[Phase::Made, Phase::Stopped],
            _ => return self.phase != Phase::Destroyed && self.expects_window(event),
        };
        phases.contains(&self.phase)
    }

    fn expects_window(&self, event: Event) -> bool {
        match event {
            Event::WindowMade => !self.window,
            Event::WindowDestroyed => self.window,
            _ => true,
        }
    }

    fn take(&mut self, event: Event) -> &'static [Command] {
        match event {
            Event::Start => {
                // For one that is in front it changes nothing.
                if self.phase != Phase::Resumed {
                    self.phase = Phase::Started;
                }
                &[]
            }
            Event::Resume => {
                self.phase = Phase::Resumed;
                match self.call {
                    Call::NotBegun => {
                        self.call = Call::Running;
                        &[Command::Start]
                    }
                    Call::Paused => {
                        self.call = Call::Running;
                        &[Command::Resume]
                    }
                    Call::Running | Call::Over => &[],
                }
            }
            Event::Pause => {
                if self.phase == Phase::Resumed {
                    self.phase = Phase::Started;
                }
                self.pause()
            }
            Event::Stop => {
                self.phase = Phase::Stopped;
                self.pause()
            }
            Event::LowMemory => match self.call {
                Call::Running => &[Command::Trim(Trim::All)],
                Call::Paused => &[Command::Trim(Trim::HostOnly)],
                Call::NotBegun | Call::Over => &[],
            },
            Event::Destroy => {
                self.phase = Phase::Destroyed;
                match std::mem::replace(&mut self.call, Call::Over) {
                    Call::Running => &[Command::Pause, Command::Leave],
                    Call::Paused => &[Command::Leave],
                    Call::NotBegun | Call::Over => &[],
                }
            }
            Event::WindowMade | Event::WindowDestroyed => {
                self.window = event == Event::WindowMade;
                &[]
            }
            // Nothing is saved: intent and file have all of it.
            Event::FocusGained | Event::FocusLost | Event::ConfigChanged | Event::SaveState => &[],
        }
    }

    fn pause(&mut self) -> &'static [Command] {
        if self.call != Call::Running {
            return &[];
        }
        self.call = Call::Paused;
        &[Command::Pause]
    }
}
