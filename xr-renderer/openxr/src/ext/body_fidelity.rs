//! `XR_META_body_tracking_fidelity`: a body that is seen by cameras, and not only guessed from head and hands.
//!
//! Without it the runtime chooses by itself.

use openxr::{Instance, SystemId, sys};

use super::{Absent, ask_system, outcome, refused};

const EXTENSION: &str = "XR_META_body_tracking_fidelity";

/// Asks for the better tracking of that body. The runtime may ignore it, for example when it is hot.
///
/// # Errors
/// [`Absent`] where the runtime or the headset has no choice, or refuses it.
///
/// # Safety
/// `tracker` was made by `instance` and is not destroyed.
pub(super) unsafe fn ask_for_high(
    instance: &Instance,
    system: SystemId,
    tracker: sys::BodyTrackerFB,
) -> Result<(), Absent> {
    let functions = instance.exts().meta_body_tracking_fidelity.as_ref();
    let fp = functions.ok_or(Absent::NotGranted(EXTENSION))?;
    let mut choice = sys::SystemPropertiesBodyTrackingFidelityMETA {
        ty: sys::SystemPropertiesBodyTrackingFidelityMETA::TYPE,
        next: std::ptr::null_mut(),
        supports_body_tracking_fidelity: sys::FALSE,
    };
    // SAFETY: it may be chained to the system's properties where the extension is enabled.
    unsafe { ask_system(instance, system, &mut choice) }?;
    if choice.supports_body_tracking_fidelity == sys::FALSE {
        return Err(Absent::NotBySystem(EXTENSION));
    }
    let high = sys::BodyTrackingFidelityMETA::HIGH;
    // SAFETY: the caller vouches for the tracker.
    let result = unsafe { (fp.request_body_tracking_fidelity)(tracker, high) };
    outcome(result).map_err(refused("xrRequestBodyTrackingFidelityMETA"))?;
    Ok(())
}
