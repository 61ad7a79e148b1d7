//! A headset that is there, and how to have it again.

use app_pipeline::control::Control;
use renderer_openxr::error::XrError;
use renderer_openxr::headset::{Headset, HeadsetOptions};
use renderer_openxr::runtime::Runtime;
use std::time::Duration;

/// Between two attempts to open the headset again.
const AGAIN: Duration = Duration::from_millis(500);

/// A headset that is there, and how to have it again when it went.
#[derive(Debug)]
pub struct HeadsetHandle {
    pub(super) runtime: Runtime,
    pub(super) headset: Headset,
    pub(super) options: HeadsetOptions,
}

impl HeadsetHandle {
    /// Opens a runtime's headset.
    ///
    /// # Errors
    /// As [`Headset::open`].
    pub fn open(runtime: Runtime, options: HeadsetOptions) -> Result<Self, XrError> {
        let headset = Headset::open(&runtime, options)?;
        Ok(Self {
            runtime,
            headset,
            options,
        })
    }

    /// The headset.
    #[must_use]
    pub fn headset(&self) -> &Headset {
        &self.headset
    }

    /// Opens it again after it went; nothing if it is time to leave before. What is left of it goes first: a loader has one instance
    /// at a time.
    pub(super) fn open_again(self, control: &Control, is_over: &dyn Fn() -> bool) -> Option<Self> {
        let Self {
            runtime,
            headset,
            options,
        } = self;
        close(headset, control);
        let headset = open_again(&runtime, options, control, is_over)?;
        Some(Self {
            runtime,
            headset,
            options,
        })
    }
}

/// Opens the headset again, as often as it takes; nothing if it is time to leave before.
pub(super) fn open_again(
    runtime: &Runtime,
    options: HeadsetOptions,
    control: &Control,
    is_over: &dyn Fn() -> bool,
) -> Option<Headset> {
    let mut logged = None;
    while !is_over() && control.begin_work() {
        match Headset::open(runtime, options) {
            Ok(headset) => return Some(headset),
            Err(error) => {
                let text = error.to_string();
                if logged.as_ref() != Some(&text) {
                    log::info!("not yet: {text}");
                    logged = Some(text);
                }
            }
        }
        control.end_work();
        control.sleep(AGAIN);
    }
    None
}

/// Frees a headset, and with it its device, in a step of the GPU's.
pub(super) fn close<T>(headset: T, control: &Control) {
    let step = control.step();
    drop(headset);
    drop(step);
}
