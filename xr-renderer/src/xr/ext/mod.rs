//! `OpenXR`'s optional extensions, one file each, each with what happens where it is missing.
//!
//! A constructor gives the thing or says why there is none ([`Absent`]); the caller goes on without. Nothing here ends a
//! session: a runtime that is lost is found out by the calls that cannot do without it.

pub mod depth;
pub mod eye_gaze;
pub mod foveation;
pub mod hand_tracking;
pub mod passthrough;
pub mod performance;
mod pinch;
mod rate_choice;
pub mod refresh_rate;
pub mod threads;

use std::fmt;

use openxr::sys;
use openxr::{Instance, SystemId};

pub use rate_choice::Held;

/// Why an optional thing is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Absent {
    /// The runtime lacks the extension, or it was not asked for.
    NotGranted(&'static str),
    /// The runtime has the extension, and the headset nothing to do it with.
    NotBySystem(&'static str),
    /// The runtime has the extension, and the graphics device lacks what it needs.
    NotByDevice(&'static str),
    /// The runtime has it and refuses it.
    Refused {
        /// The call.
        call: &'static str,
        /// What it returned.
        result: sys::Result,
    },
}

impl fmt::Display for Absent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotGranted(extension) => write!(f, "the runtime has no {extension}"),
            Self::NotBySystem(extension) => {
                write!(
                    f,
                    "the runtime has {extension}, but the headset does not support it"
                )
            }
            Self::NotByDevice(feature) => write!(f, "the graphics device has no {feature}"),
            Self::Refused { call, result } => write!(f, "{call} failed: {result}"),
        }
    }
}

/// The thing, or none with the reason in the log.
pub fn or_without<T>(what: &str, found: Result<T, Absent>) -> Option<T> {
    found
        .inspect_err(|why| log::info!("without {what}: {why}"))
        .ok()
}

/// Adds the call's name to a refusal.
fn refused(call: &'static str) -> impl FnOnce(sys::Result) -> Absent {
    move |result| Absent::Refused { call, result }
}

/// A raw call's outcome: its success code, or its error.
pub(crate) fn outcome(result: sys::Result) -> Result<sys::Result, sys::Result> {
    if result.into_raw() >= 0 {
        Ok(result)
    } else {
        Err(result)
    }
}

/// Asks a system about one thing: fills `properties`, and whatever is chained to it.
///
/// # Safety
/// `properties` is a structure of `OpenXR` that may be chained to `XrSystemProperties`, its type set, its `next` null or such too.
unsafe fn ask_system<T>(
    instance: &Instance,
    system: SystemId,
    properties: &mut T,
) -> Result<(), Absent> {
    let mut all = sys::SystemProperties::out(std::ptr::from_mut(properties).cast());
    // SAFETY: the instance is alive, `all` is typed and chained to what the caller vouches for.
    let result = unsafe {
        (instance.fp().get_system_properties)(instance.as_raw(), system, all.as_mut_ptr())
    };
    outcome(result).map_err(refused("xrGetSystemProperties"))?;
    Ok(())
}
