//! What errors advise. A headset needs other advice than a desktop: only the app can be installed or started there.

/// For what comes with a headset's system.
pub const UPDATE_HEADSET: &str = "restart the headset, and install its updates";

/// The advice for where this program runs: on a desktop, or as the app on a headset.
#[must_use]
pub const fn advice(desktop: &'static str, headset: &'static str) -> &'static str {
    if cfg!(target_os = "android") {
        headset
    } else {
        desktop
    }
}
