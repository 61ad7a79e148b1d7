//! The app's names on a headset. `AndroidManifest.xml` says the same; a test compares them.

/// The package's name.
pub const PACKAGE: &str = "org.mon3tr.quest";

/// What `adb shell am start -n` starts.
pub const COMPONENT: &str = "org.mon3tr.quest/android.app.NativeActivity";

/// The settings' file, in the app's files folder.
pub const SETTINGS_FILE: &str = "mon3tr.toml";

/// Where adb finds the app's files folder.
pub const FILES_FOLDER: &str = "/sdcard/Android/data/org.mon3tr.quest/files";
