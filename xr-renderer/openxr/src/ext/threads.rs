//! `XR_KHR_android_thread_settings`: tells a headset's scheduler which threads frames wait for.
//!
//! Anywhere but on Android, and on runtimes without it, threads run as the system likes.

use openxr::{Session, Vulkan};

use super::Absent;

/// A thread's part in making frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Waits for frames, draws and shows them.
    RendererMain,
    /// Prepares what is drawn, at the frames' rate.
    RendererWorker,
}

/// Registers the calling thread.
///
/// # Errors
/// [`Absent`] where there is nothing to register with.
#[cfg(target_os = "android")]
pub fn register(session: &Session<Vulkan>, role: Role) -> Result<(), Absent> {
    use openxr::sys::AndroidThreadTypeKHR;

    unsafe extern "C" {
        safe fn gettid() -> i32;
    }

    let exts = session.instance().exts();
    let fp = exts
        .khr_android_thread_settings
        .as_ref()
        .ok_or(Absent::NotGranted("XR_KHR_android_thread_settings"))?;
    let kind = match role {
        Role::RendererMain => AndroidThreadTypeKHR::RENDERER_MAIN,
        Role::RendererWorker => AndroidThreadTypeKHR::RENDERER_WORKER,
    };
    // SAFETY: the session is alive, and the thread is the one that asks.
    let result = unsafe {
        (fp.set_android_application_thread)(session.as_raw(), kind, gettid().cast_unsigned())
    };
    super::outcome(result).map_err(super::refused("xrSetAndroidApplicationThreadKHR"))?;
    Ok(())
}

/// Registers the calling thread, on Android only.
///
/// # Errors
/// [`Absent`] always: there is nothing to register with here.
#[cfg(not(target_os = "android"))]
pub fn register(_session: &Session<Vulkan>, _role: Role) -> Result<(), Absent> {
    Err(Absent::NotGranted("XR_KHR_android_thread_settings"))
}

#[cfg(all(test, not(target_os = "android")))]
mod tests {
    use super::*;
    use crate::fake::FakeRuntime;

    #[test]
    fn registering_a_thread_is_absent_on_other_systems_than_android() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        let before = fake.names();
        let why = register(&session, Role::RendererMain).expect_err("nothing");
        assert!(why.to_string().contains("android"), "{why}");
        assert_eq!(fake.names(), before, "the runtime is not asked");
    }
}
