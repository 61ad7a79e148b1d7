//! Which of `OpenXR`'s extensions are wanted, and which of them a runtime has.
//!
//! One is required, on a headset's own Android another; every other one is optional and has a file in [`ext`](crate::ext).

use openxr::ExtensionSet;

use crate::error::XrError;

/// An extension: its name, its place in `ExtensionSet`, and the others that it needs.
struct Wanted {
    name: &'static str,
    needs: &'static [&'static str],
    is_in: fn(&ExtensionSet) -> bool,
    put_in: fn(&mut ExtensionSet),
}

macro_rules! wanted {
    ($name:literal, $field:ident $(, $needs:literal)*) => {
        Wanted {
            name: $name,
            needs: &[$($needs),*],
            is_in: |set| set.$field,
            put_in: |set| set.$field = true,
        }
    };
}

/// Required to show a picture.
const REQUIRED: &[Wanted] = &[
    wanted!("XR_KHR_vulkan_enable2", khr_vulkan_enable2),
    // Gives the runtime the activity that it shows.
    #[cfg(target_os = "android")]
    wanted!(
        "XR_KHR_android_create_instance",
        khr_android_create_instance
    ),
];

/// Used where available; those that others need come first.
const OPTIONAL: &[Wanted] = &[
    #[cfg(not(windows))]
    wanted!("XR_KHR_convert_timespec_time", khr_convert_timespec_time),
    wanted!("XR_EXT_local_floor", ext_local_floor),
    wanted!(
        "XR_KHR_composition_layer_depth",
        khr_composition_layer_depth
    ),
    wanted!("XR_KHR_visibility_mask", khr_visibility_mask),
    wanted!("XR_EXT_hand_tracking", ext_hand_tracking),
    wanted!("XR_FB_body_tracking", fb_body_tracking),
    wanted!(
        "XR_META_body_tracking_full_body",
        meta_body_tracking_full_body,
        "XR_FB_body_tracking"
    ),
    wanted!(
        "XR_META_body_tracking_fidelity",
        meta_body_tracking_fidelity,
        "XR_FB_body_tracking"
    ),
    wanted!("XR_FB_face_tracking2", fb_face_tracking2),
    wanted!("XR_FB_eye_tracking_social", fb_eye_tracking_social),
    wanted!("XR_EXT_eye_gaze_interaction", ext_eye_gaze_interaction),
    wanted!("XR_FB_passthrough", fb_passthrough),
    wanted!("XR_FB_display_refresh_rate", fb_display_refresh_rate),
    wanted!("XR_FB_swapchain_update_state", fb_swapchain_update_state),
    wanted!(
        "XR_FB_foveation",
        fb_foveation,
        "XR_FB_swapchain_update_state"
    ),
    wanted!(
        "XR_FB_foveation_configuration",
        fb_foveation_configuration,
        "XR_FB_foveation"
    ),
    wanted!(
        "XR_FB_foveation_vulkan",
        fb_foveation_vulkan,
        "XR_FB_foveation"
    ),
    wanted!(
        "XR_META_foveation_eye_tracked",
        meta_foveation_eye_tracked,
        "XR_FB_foveation",
        "XR_FB_foveation_configuration"
    ),
    wanted!("XR_EXT_performance_settings", ext_performance_settings),
    #[cfg(target_os = "android")]
    wanted!(
        "XR_KHR_android_thread_settings",
        khr_android_thread_settings
    ),
];

/// Wanted, and available only on a headset's own Android.
#[cfg(not(target_os = "android"))]
const ANDROID_ONLY: &[&str] = &["XR_KHR_android_thread_settings"];
#[cfg(target_os = "android")]
const ANDROID_ONLY: &[&str] = &[];

/// The extensions that an instance is made with, and those that the runtime lacks.
#[derive(Debug, Clone)]
pub struct Extensions {
    set: ExtensionSet,
    granted: Vec<&'static str>,
    missing: Vec<&'static str>,
}

impl Extensions {
    /// Those wanted of those available.
    ///
    /// # Errors
    /// [`XrError::Unsupported`] without `XR_KHR_vulkan_enable2`, on Android also without `XR_KHR_android_create_instance`.
    pub fn of(available: &ExtensionSet) -> Result<Self, XrError> {
        let mut set = ExtensionSet::default();
        let mut granted = Vec::new();
        for required in REQUIRED {
            if !(required.is_in)(available) {
                return Err(XrError::Unsupported {
                    runtime: "the OpenXR runtime".to_owned(),
                    lacks: required.name.to_owned(),
                });
            }
            (required.put_in)(&mut set);
            granted.push(required.name);
        }
        let mut missing = Vec::new();
        for wanted in OPTIONAL {
            let usable = wanted.needs.iter().all(|needed| granted.contains(needed));
            if usable && (wanted.is_in)(available) {
                (wanted.put_in)(&mut set);
                granted.push(wanted.name);
            } else {
                missing.push(wanted.name);
            }
        }
        missing.extend_from_slice(ANDROID_ONLY);
        Ok(Self {
            set,
            granted,
            missing,
        })
    }

    /// What to make the instance with.
    #[must_use]
    pub fn set(&self) -> &ExtensionSet {
        &self.set
    }

    /// Names (`XR_...`) of the wanted ones that the runtime has, the required one too.
    #[must_use]
    pub fn granted(&self) -> &[&'static str] {
        &self.granted
    }

    /// Names (`XR_...`) of the wanted ones that it lacks, or that lack another that they need.
    #[must_use]
    pub fn missing(&self) -> &[&'static str] {
        &self.missing
    }

    /// Whether the one by this name (`XR_...`) is granted.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.granted.contains(&name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{FakeRuntime, REQUIRED as VULKAN};

    fn everything() -> ExtensionSet {
        let mut set = ExtensionSet::default();
        for wanted in OPTIONAL.iter().chain(REQUIRED) {
            (wanted.put_in)(&mut set);
        }
        set
    }

    #[test]
    fn a_complete_runtime_grants_every_extension() {
        let extensions = Extensions::of(&everything()).expect("the required one is there");
        assert_eq!(extensions.granted().len(), OPTIONAL.len() + 1, "granted");
        assert_eq!(extensions.missing(), ANDROID_ONLY, "missing");
        assert_eq!(*extensions.set(), everything(), "to be enabled");
    }

    #[test]
    fn names_are_the_crates_own() {
        for wanted in OPTIONAL.iter().chain(REQUIRED) {
            let mut set = ExtensionSet::default();
            (wanted.put_in)(&mut set);
            let names: Vec<String> = set
                .names()
                .iter()
                .map(|name| String::from_utf8_lossy(name).replace('\0', ""))
                .collect();
            assert_eq!(names, [wanted.name], "the field's name");
            assert!((wanted.is_in)(&set), "{} is read", wanted.name);
        }
    }

    #[test]
    fn without_vulkan_the_error_names_what_is_missing() {
        let fake = FakeRuntime::new(&["XR_FB_passthrough"]);
        let available = fake.entry().enumerate_extensions().expect("a list");
        let error = Extensions::of(&available).expect_err("no Vulkan");
        assert!(matches!(error, XrError::Unsupported { .. }), "{error:?}");
        assert!(error.to_string().contains(VULKAN), "{error}");
    }

    #[test]
    fn other_extensions_of_a_runtime_are_not_enabled() {
        let mut available = everything();
        available.fb_color_space = true;
        available.other.push(b"XR_MON3TR_no_such_thing\0".to_vec());
        let extensions = Extensions::of(&available).expect("the required one is there");
        assert_eq!(*extensions.set(), everything(), "to be enabled");
    }

    #[test]
    fn an_extension_is_left_out_without_those_that_it_needs() {
        let mut available = everything();
        available.fb_swapchain_update_state = false;
        let extensions = Extensions::of(&available).expect("the required one is there");
        let mut missing = extensions.missing().to_vec();
        missing.retain(|name| !ANDROID_ONLY.contains(name));
        assert_eq!(
            missing,
            [
                "XR_FB_swapchain_update_state",
                "XR_FB_foveation",
                "XR_FB_foveation_configuration",
                "XR_FB_foveation_vulkan",
                "XR_META_foveation_eye_tracked"
            ],
            "all of foveation"
        );
        assert!(!extensions.set().fb_foveation, "nor is it enabled");
    }
}
