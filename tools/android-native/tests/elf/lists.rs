//! The lists of what Android exports, against what its documentation says of single functions.

use android_native::elf::Platform;

#[test]
fn functions_are_listed_from_the_level_on_that_their_documentation_names() {
    let platform = Platform::api_29();
    // From bionic's status page (docs/status.md) and the NDK's reference, by library: up to API 29, and after it.
    let documented: [(&str, &[&str], &[&str]); 6] = [
        (
            "libc.so",
            // From the start, 21, 23, 24, 26, 28, 28, 28, 28, 29, 29, 29, 29.
            &[
                "malloc",
                "pthread_create",
                "epoll_create1",
                "fmemopen",
                "preadv",
                "mblen",
                "getentropy",
                "getrandom",
                "glob",
                "iconv",
                "timespec_get",
                "reallocarray",
                "getloadavg",
                "android_fdsan_close_with_tag",
            ],
            // 30, 30, 30, 30, 30, 31, 33, 34, 35.
            &[
                "memfd_create",
                "mtx_lock",
                "pthread_cond_clockwait",
                "renameat2",
                "statx",
                "pidfd_open",
                "preadv2",
                "close_range",
                "tcgetwinsize",
            ],
        ),
        ("libm.so", &["sinf", "fma", "cexp", "clog"], &[]),
        (
            "libdl.so",
            &["dlopen", "dlsym", "dl_iterate_phdr"],
            &["android_create_namespace"],
        ),
        (
            "liblog.so",
            &[
                "__android_log_write",
                "__android_log_print",
                "__android_log_is_loggable",
            ],
            &[
                "__android_log_set_logger",
                "__android_log_call_aborter",
                "android_logger_open",
            ],
        ),
        (
            "libaaudio.so",
            &[
                "AAudio_createStreamBuilder",
                "AAudioStream_getTimestamp",
                "AAudioStreamBuilder_setInputPreset",
            ],
            &[
                "AAudioStream_release",
                "AAudioStreamBuilder_setPrivacySensitive",
                "AAudioStreamBuilder_setChannelMask",
            ],
        ),
        (
            "libandroid.so",
            &[
                "ALooper_pollOnce",
                "AAssetManager_open",
                "ANativeWindow_acquire",
                "AConfiguration_getLanguage",
                "AChoreographer_postFrameCallback64",
                "ATrace_setCounter",
            ],
            &[
                "AThermal_acquireManager",
                "AInputEvent_release",
                "APerformanceHint_getManager",
            ],
        ),
    ];
    for (library, there, later) in documented {
        let names = platform.exports_of(library).expect("a list");
        for name in there {
            assert!(names.contains(name), "{library} has {name}");
        }
        for name in later {
            assert!(!names.contains(name), "{library} does not have {name} yet");
        }
    }
}

#[test]
fn no_function_is_listed_for_another_processor() {
    let platform = Platform::api_29();
    // Of 32-bit ARM alone.
    for (library, name) in [
        ("libc.so", "__aeabi_memcpy"),
        ("libc.so", "__atomic_swap"),
        ("libdl.so", "dl_unwind_find_exidx"),
    ] {
        let names = platform.exports_of(library).expect("a list");
        assert!(!names.contains(name), "{library} has no {name} on arm64");
    }
}

#[test]
fn every_library_with_a_list_is_one_that_applications_may_open() {
    let platform = Platform::api_29();
    for (library, names) in platform.listed() {
        assert!(platform.has_library(library), "{library}");
        assert!(!names.is_empty(), "{library} exports something");
    }
    for (library, there) in [
        ("libvulkan.so", true),
        ("libX11.so", false),
        ("libssl.so", false),
    ] {
        assert_eq!(platform.has_library(library), there, "{library}");
    }
}
