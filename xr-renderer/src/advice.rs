//! What to do about what is missing, where this program runs: on a machine with a keyboard, or in a headset, where nobody can install
//! or start anything but the app.

/// Whether this is the app on a headset.
const IN_HEADSET: bool = cfg!(target_os = "android");

/// The package has it, if it is whole.
const PACKAGE: &str = "the app's package lacks it: install the app anew";

/// Whatever else a headset lacks comes with its system.
const SYSTEM: &str = "restart the headset, and install its updates";

pub(crate) const OPENXR_LOADER: &str = if IN_HEADSET {
    PACKAGE
} else {
    "start through ./run, or install it (Debian, Ubuntu: `apt install libopenxr-loader1`)"
};

pub(crate) const OPENXR_RUNTIME: &str = if IN_HEADSET {
    SYSTEM
} else {
    "start your headset's software and make it the active runtime, or point XR_RUNTIME_JSON at a runtime's manifest that exists \
     (Monado's, say)"
};

pub(crate) const OPENXR_SERVICE: &str = if IN_HEADSET {
    SYSTEM
} else {
    "start it (SteamVR, `monado-service`) and try again"
};

pub(crate) const OTHER_RUNTIME: &str = if IN_HEADSET {
    SYSTEM
} else {
    "use another OpenXR runtime"
};

pub(crate) const RUNTIME_FAILED: &str = if IN_HEADSET {
    "restart the headset"
} else {
    "restart the headset's software"
};

pub(crate) const VULKAN_LOADER: &str = if IN_HEADSET {
    SYSTEM
} else {
    "start through ./run, or install it and a driver (Debian, Ubuntu: `apt install libvulkan1 mesa-vulkan-drivers`)"
};

pub(crate) const VULKAN_DEVICE: &str = if IN_HEADSET {
    SYSTEM
} else {
    "install a Vulkan driver (Debian, Ubuntu: `apt install mesa-vulkan-drivers`, which also has lavapipe for machines without a GPU) \
     or point VK_DRIVER_FILES at one"
};

pub(crate) const OTHER_DEVICE: &str = if IN_HEADSET {
    SYSTEM
} else {
    "update its driver, choose another device, or try --gpu lavapipe"
};
