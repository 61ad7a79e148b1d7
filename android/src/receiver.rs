//! The call in a headset, as the activity's life drives it. This is the one place where the app meets the receiver.

use crate::first_run;
use crate::launch::Launch;
use crate::lifecycle::{Receiver, Trim};
use crate::settings::{Settings, Task};

/// Shows the call in the headset.
///
/// It does not yet: it tells the log what the panel in the headset would say, and what it was asked to do.
#[derive(Debug, Default)]
pub struct HeadsetReceiver {
    over: bool,
}

impl HeadsetReceiver {
    /// One that was not asked for anything yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// What a panel shows instead of a call.
    fn panel(launch: &Launch) -> Vec<String> {
        match &launch.settings {
            Ok(settings) => vec![
                "This build of Mon3tr cannot show calls in a headset yet.".to_owned(),
                Self::asked_for(settings),
            ],
            Err(problems) => first_run::lines(problems),
        }
    }

    fn asked_for(settings: &Settings) -> String {
        match &settings.task {
            Task::Call(rooms) => format!("It was asked for {:?} by {}.", rooms.value, rooms.origin),
            Task::Profile(seconds) => format!(
                "It was asked to measure for {} s by {}.",
                seconds.value.as_secs(),
                seconds.origin
            ),
        }
    }
}

impl Receiver for HeadsetReceiver {
    fn start(&mut self, launch: Launch) {
        for line in Self::panel(&launch) {
            log::warn!("{line}");
        }
    }

    fn pause(&mut self) {}

    fn resume(&mut self) {}

    fn trim_memory(&mut self, _what: Trim) {}

    fn leave(&mut self) {
        self.over = true;
    }

    fn is_over(&self) -> bool {
        self.over
    }
}
