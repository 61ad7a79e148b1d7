//! The headset's app executed on Linux, without Android: `./run rehearse-android`.
//!
//! The x86_64-linux-android build of `android/` is loaded into a process of its own, the *host*, which plays Android's framework: an
//! activity and its callbacks, a Java machine, and shims for Android's C libraries. Around it are real parts: Monado, lavapipe,
//! Android's own ONNX Runtime, a server and a sender. The *driver* starts all of that and runs the cases, one host process each.
//!
//! | what | where |
//! |---|---|
//! | the driver: the app built, the cases, the report | `src/main.rs`, `app.rs`, `cases/`, `report.rs` |
//! | the host process: activity, Java machine | `src/bin/host/` |
//! | the protocol between driver and host | [`protocol`] |
//! | the rehearsal as a device that adb sees, for `android/prove.sh` | `src/device/`, `src/bin/adb.rs`, [`adb`] |
//! | Android's `libc`, `libm`, `libdl`, `liblog`, `libandroid`, `libaaudio` and OpenXR loader, on glibc's | `shims/`, compiled by [`shims`] |
//!
//! It shows that the `target_os = "android"` code starts, reads intents, draws, calls, pauses and ends, and that Rust's standard
//! library for Android behaves as assumed. It does not show ART, SELinux, Khronos' Android loader, Meta's runtime, Adreno, NNAPI, QNN or
//! arm64: docs/android.md has the whole list.

pub mod adb;
pub mod protocol;
pub mod shims;
