//! `OpenXR`'s optional extensions, one file each, each with its fallback.
//!
//! A constructor returns the extension's object or why there is none ([`Absent`]); the caller goes on without. Nothing here ends a
//! session: a lost runtime is reported by the calls that need it.

mod body_fidelity;
pub mod body_tracking;
pub mod depth;
pub mod eye_tracking;
pub mod face_tracking;
pub mod foveation;
pub(crate) mod gaze_interaction;
pub mod hand_tracking;
mod on_first_use;
pub mod passthrough;
pub mod performance;
mod pinch;
mod rate_choice;
pub mod refresh_rate;
pub mod threads;
pub(crate) mod visibility_mask;

use std::fmt;

use openxr::sys;
use openxr::{Instance, SystemId};

pub(crate) use on_first_use::OnFirstUse;
pub use rate_choice::FrameTiming;

/// Why an optional extension is not available.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Absent {
    /// The runtime lacks the extension, or it was not asked for.
    NotGranted(&'static str),
    /// The runtime has the extension, but the headset does not support it.
    NotBySystem(&'static str),
    /// The runtime has the extension, but the graphics device lacks what it needs.
    NotByDevice(&'static str),
    /// The runtime has it but refuses it.
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

/// The extension's object, or none with the reason in the log.
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

/// A share of 1; 0 for what is no number.
fn share(value: f32) -> f32 {
    if value.is_finite() {
        value.clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Queries a system's properties: fills `properties`, and whatever is chained to it.
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

#[cfg(test)]
mod tests {
    use super::depth::DepthRange;
    use super::foveation::Foveation;
    use super::passthrough::Passthrough;
    use super::refresh_rate::RefreshRate;
    use super::visibility_mask::VisibilityMask;
    use super::*;
    use crate::fake::{FakeRuntime, REQUIRED};
    use crate::input::Input;

    /// The available extensions of a runtime, by name.
    fn had(fake: &FakeRuntime) -> Vec<&'static str> {
        let instance = fake.instance();
        let (session, _, _) = fake.session(&instance);
        let system = fake.system();
        let input = Input::new(&session, system).expect("input needs no extension");
        let foveation = Foveation::new(&session, system, true).ok();
        let around_gaze = foveation.as_ref().is_some_and(Foveation::follows_gaze);
        let passthrough = Passthrough::new(&session, system);
        let rate = RefreshRate::new(&session, 72.0);
        let depth = DepthRange::new(&instance, 0.05, 50.0);
        let levels = performance::sustain(&session);
        let mask = VisibilityMask::new(&session);
        let found = [
            ("XR_KHR_composition_layer_depth", depth.is_ok()),
            ("XR_EXT_hand_tracking", input.tracks_hands()),
            ("XR_FB_passthrough", passthrough.is_ok()),
            ("XR_FB_display_refresh_rate", rate.is_ok()),
            ("XR_FB_foveation", foveation.is_some()),
            ("XR_META_foveation_eye_tracked", around_gaze),
            ("XR_EXT_performance_settings", levels.is_ok()),
            ("XR_KHR_visibility_mask", mask.is_ok()),
        ];
        let there = found.iter().filter(|(_, there)| *there);
        there.map(|(name, _)| *name).collect()
    }

    const ALL: [&str; 8] = [
        "XR_KHR_composition_layer_depth",
        "XR_EXT_hand_tracking",
        "XR_FB_passthrough",
        "XR_FB_display_refresh_rate",
        "XR_FB_foveation",
        "XR_META_foveation_eye_tracked",
        "XR_EXT_performance_settings",
        "XR_KHR_visibility_mask",
    ];

    /// Extensions, and which others need each.
    const TAKES_AWAY: [(&str, &[&str]); 13] = [
        ("XR_KHR_convert_timespec_time", &[]),
        ("XR_EXT_local_floor", &[]),
        ("XR_KHR_composition_layer_depth", &[ALL[0]]),
        ("XR_EXT_hand_tracking", &[ALL[1]]),
        ("XR_FB_passthrough", &[ALL[2]]),
        ("XR_FB_display_refresh_rate", &[ALL[3]]),
        ("XR_FB_swapchain_update_state", &[ALL[4], ALL[5]]),
        ("XR_FB_foveation", &[ALL[4], ALL[5]]),
        ("XR_FB_foveation_configuration", &[ALL[4], ALL[5]]),
        ("XR_FB_foveation_vulkan", &[ALL[4], ALL[5]]),
        ("XR_META_foveation_eye_tracked", &[ALL[5]]),
        ("XR_EXT_performance_settings", &[ALL[6]]),
        ("XR_KHR_visibility_mask", &[ALL[7]]),
    ];

    #[test]
    fn a_complete_runtime_provides_all_extensions() {
        assert_eq!(had(&FakeRuntime::with_everything()), ALL, "had");
    }

    #[test]
    fn each_missing_extension_removes_only_those_that_need_it() {
        for (off, gone) in TAKES_AWAY {
            let fake = FakeRuntime::with_everything();
            fake.set(|world| world.extensions.retain(|name| *name != off));
            let mut expected = ALL.to_vec();
            expected.retain(|name| !gone.contains(name));
            assert_eq!(had(&fake), expected, "without {off}");
        }
    }

    #[test]
    fn each_single_extension_provides_only_what_needs_no_other() {
        let foveation: &[&str] = &[
            "XR_FB_swapchain_update_state",
            "XR_FB_foveation",
            "XR_FB_foveation_configuration",
            "XR_FB_foveation_vulkan",
        ];
        for on in ALL {
            let fake = FakeRuntime::with_everything();
            let needed = if on.contains("foveation") {
                foveation
            } else {
                &[]
            };
            let stays = |name: &str| name == REQUIRED || name == on || needed.contains(&name);
            fake.set(|world| world.extensions.retain(|name| stays(name)));
            let mut expected = vec![on];
            if on == "XR_META_foveation_eye_tracked" {
                expected.insert(0, "XR_FB_foveation");
            }
            assert_eq!(had(&fake), expected, "with {on} alone");
        }
    }

    #[test]
    fn a_bare_runtime_provides_no_extension_and_gets_no_call_of_one() {
        let fake = FakeRuntime::new(&[REQUIRED]);
        assert!(had(&fake).is_empty(), "nothing is had");
        let names = fake.names();
        let vendors =
            |name: &&&str| name.ends_with("FB") || name.ends_with("EXT") || name.ends_with("META");
        let asked: Vec<_> = names.iter().filter(vendors).collect();
        assert!(asked.is_empty(), "{asked:?}");
    }

    #[test]
    fn a_headset_without_support_is_distinguished_from_a_runtime_without_the_extension() {
        let fake = FakeRuntime::with_everything();
        fake.set(|world| {
            world.system = Default::default();
            world.rates_hz.clear();
        });
        let expected = [ALL[0], ALL[4], ALL[6], ALL[7]];
        assert_eq!(had(&fake), expected, "what needs no parts");
        let instance = fake.instance();
        let (session, _, _) = fake.session(&instance);
        let why = Passthrough::new(&session, fake.system()).expect_err("no cameras");
        assert_eq!(why, Absent::NotBySystem("XR_FB_passthrough"), "the reason");
        assert!(why.to_string().contains("headset"), "{why}");
    }

    #[test]
    fn a_failing_call_of_one_extension_leaves_the_others() {
        let fails = [
            ("xrCreateHandTrackerEXT", ALL[1]),
            ("xrCreatePassthroughFB", ALL[2]),
            ("xrCreatePassthroughLayerFB", ALL[2]),
            ("xrEnumerateDisplayRefreshRatesFB", ALL[3]),
            ("xrPerfSettingsSetPerformanceLevelEXT", ALL[6]),
        ];
        for (call, gone) in fails {
            let fake = FakeRuntime::with_everything();
            fake.fail(call, sys::Result::ERROR_RUNTIME_FAILURE);
            let mut expected = ALL.to_vec();
            expected.retain(|name| *name != gone);
            assert_eq!(had(&fake), expected, "where {call} fails");
            for kind in ["passthrough", "passthrough layer", "hand tracker"] {
                assert_eq!(fake.alive(kind), 0, "{kind}s left where {call} fails");
            }
        }
    }
}
