//! `XR_FB_passthrough`: the wearer's room, shown below our pictures.
//!
//! Without it the caller draws what is behind the people: a studio or a scene. Raw calls, because `openxr` 0.22's
//! `Passthrough::start` calls `xrPassthroughPauseFB` and its handle is private.

use std::marker::PhantomData;
use std::ops::Deref;

use openxr::sys::{self, Handle as _};
use openxr::{CompositionLayerBase, Instance, Session, SystemId, Vulkan, raw};

use super::{Absent, ask_system, outcome, refused};

const EXTENSION: &str = "XR_FB_passthrough";

/// A full view of the room. It is shown while it runs and its layer is submitted below all others.
pub struct Passthrough {
    session: Session<Vulkan>,
    feature: sys::PassthroughFB,
    layer: sys::PassthroughLayerFB,
    runs: bool,
    in_colour: bool,
}

impl std::fmt::Debug for Passthrough {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Passthrough")
            .field("runs", &self.runs)
            .field("in_colour", &self.in_colour)
            .finish_non_exhaustive()
    }
}

impl Passthrough {
    /// Makes it, paused: [`Self::show`] starts it.
    ///
    /// # Errors
    /// [`Absent`] where the runtime or the headset has none, or refuses it.
    pub fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, Absent> {
        let instance = session.instance();
        let fp = functions(instance).ok_or(Absent::NotGranted(EXTENSION))?;
        let in_colour = capability(instance, system)?;
        let info = sys::PassthroughCreateInfoFB {
            ty: sys::PassthroughCreateInfoFB::TYPE,
            next: std::ptr::null(),
            flags: sys::PassthroughFlagsFB::EMPTY,
        };
        let mut this = Self {
            session: session.clone(),
            feature: sys::PassthroughFB::NULL,
            layer: sys::PassthroughLayerFB::NULL,
            runs: false,
            in_colour,
        };
        // SAFETY: the session is alive, and `info` is whole.
        let result = unsafe { (fp.create_passthrough)(session.as_raw(), &info, &mut this.feature) };
        outcome(result).map_err(refused("xrCreatePassthroughFB"))?;
        let info = sys::PassthroughLayerCreateInfoFB {
            ty: sys::PassthroughLayerCreateInfoFB::TYPE,
            next: std::ptr::null(),
            passthrough: this.feature,
            flags: sys::PassthroughFlagsFB::EMPTY,
            purpose: sys::PassthroughLayerPurposeFB::RECONSTRUCTION,
        };
        // SAFETY: the session and its passthrough are alive, and `info` is whole.
        let result =
            unsafe { (fp.create_passthrough_layer)(session.as_raw(), &info, &mut this.layer) };
        outcome(result).map_err(refused("xrCreatePassthroughLayerFB"))?;
        Ok(this)
    }

    /// Runs or pauses it. Call it whenever the session becomes visible or hidden, or the wearer switches the room on or off;
    /// a second call with the same value does nothing. A runtime's refusal is logged, and the picture stays as it was.
    pub fn show(&mut self, shown: bool) {
        if shown == self.runs {
            return;
        }
        let done = if shown { self.start() } else { self.pause() };
        match done {
            Ok(()) => self.runs = shown,
            Err(why) => log::warn!("passthrough stays as it was: {why}"),
        }
    }

    /// Whether it runs.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.runs
    }

    /// Whether the room is shown in colour. Runtimes of the extension's first versions do not say so.
    #[must_use]
    pub fn is_in_colour(&self) -> bool {
        self.in_colour
    }

    /// The layer to submit before all others (OpenXR composes in order). None while it is paused.
    #[must_use]
    pub fn layer(&self) -> Option<PassthroughLayer<'_>> {
        self.runs.then_some(PassthroughLayer {
            layer: sys::CompositionLayerPassthroughFB {
                ty: sys::CompositionLayerPassthroughFB::TYPE,
                next: std::ptr::null(),
                flags: sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
                space: sys::Space::NULL,
                layer_handle: self.layer,
            },
            passthrough: PhantomData,
        })
    }

    fn start(&self) -> Result<(), Absent> {
        let fp = functions(self.session.instance()).ok_or(Absent::NotGranted(EXTENSION))?;
        // SAFETY: both are alive until `self` is dropped.
        let result = unsafe { (fp.passthrough_start)(self.feature) };
        outcome(result).map_err(refused("xrPassthroughStartFB"))?;
        // SAFETY: as above.
        let result = unsafe { (fp.passthrough_layer_resume)(self.layer) };
        outcome(result).map_err(refused("xrPassthroughLayerResumeFB"))?;
        Ok(())
    }

    fn pause(&self) -> Result<(), Absent> {
        let fp = functions(self.session.instance()).ok_or(Absent::NotGranted(EXTENSION))?;
        // SAFETY: both are alive until `self` is dropped.
        let result = unsafe { (fp.passthrough_layer_pause)(self.layer) };
        outcome(result).map_err(refused("xrPassthroughLayerPauseFB"))?;
        // SAFETY: as above.
        let result = unsafe { (fp.passthrough_pause)(self.feature) };
        outcome(result).map_err(refused("xrPassthroughPauseFB"))?;
        Ok(())
    }
}

impl Drop for Passthrough {
    fn drop(&mut self) {
        let Some(fp) = functions(self.session.instance()) else {
            return;
        };
        // SAFETY: made by the session, which `self` keeps alive; the layer goes before what it is of. What the runtime
        // says is of no use any more: it may be gone.
        unsafe {
            if self.layer != sys::PassthroughLayerFB::NULL {
                (fp.destroy_passthrough_layer)(self.layer);
            }
            if self.feature != sys::PassthroughFB::NULL {
                (fp.destroy_passthrough)(self.feature);
            }
        }
    }
}

/// The room's layer, for `FrameStream::end`.
#[derive(Debug)]
#[repr(transparent)]
pub struct PassthroughLayer<'a> {
    layer: sys::CompositionLayerPassthroughFB,
    passthrough: PhantomData<&'a Passthrough>,
}

impl<'a> Deref for PassthroughLayer<'a> {
    type Target = CompositionLayerBase<'a, Vulkan>;

    fn deref(&self) -> &Self::Target {
        // SAFETY: the structure opens with a layer's header (type, next, flags, space), which is all that a base is.
        unsafe { &*std::ptr::from_ref(&self.layer).cast() }
    }
}

fn functions(instance: &Instance) -> Option<&raw::PassthroughFB> {
    instance.exts().fb_passthrough.as_ref()
}

/// Whether the headset's passthrough is in colour; absent where it has none. Version 3 of the extension says both in flags,
/// those before it know a boolean only.
fn capability(instance: &Instance, system: SystemId) -> Result<bool, Absent> {
    let mut flags = sys::SystemPassthroughProperties2FB {
        ty: sys::SystemPassthroughProperties2FB::TYPE,
        next: std::ptr::null(),
        capabilities: sys::PassthroughCapabilityFlagsFB::EMPTY,
    };
    let mut simple = sys::SystemPassthroughPropertiesFB {
        ty: sys::SystemPassthroughPropertiesFB::TYPE,
        next: std::ptr::from_mut(&mut flags).cast(),
        supports_passthrough: sys::FALSE,
    };
    // SAFETY: both may be chained to the system's properties where the extension is enabled.
    unsafe { ask_system(instance, system, &mut simple) }?;
    let has = |flag| flags.capabilities.contains(flag);
    let there = has(sys::PassthroughCapabilityFlagsFB::PASSTHROUGH_CAPABILITY)
        || simple.supports_passthrough.into();
    there
        .then(|| has(sys::PassthroughCapabilityFlagsFB::COLOR))
        .ok_or(Absent::NotBySystem(EXTENSION))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::FakeRuntime;
    use openxr::EnvironmentBlendMode;
    use openxr::sys::Result as XrResult;

    fn made(fake: &FakeRuntime) -> Passthrough {
        let (session, _, _) = fake.session(&fake.instance());
        Passthrough::new(&session, fake.system()).expect("passthrough")
    }

    #[test]
    fn showing_the_room_starts_it_and_hiding_it_pauses_it() {
        let fake = FakeRuntime::with_everything();
        let mut room = made(&fake);
        fake.forget_calls();
        room.show(false);
        assert!(fake.names().is_empty(), "it is made paused");
        room.show(true);
        room.show(true);
        let started = ["xrPassthroughStartFB", "xrPassthroughLayerResumeFB"];
        assert_eq!(fake.names(), started, "to start");
        fake.forget_calls();
        room.show(false);
        let paused = ["xrPassthroughLayerPauseFB", "xrPassthroughPauseFB"];
        assert_eq!(fake.names(), paused, "to pause");
    }

    #[test]
    fn its_layer_is_in_the_frame_while_it_runs() {
        let fake = FakeRuntime::with_everything();
        let instance = fake.instance();
        let (session, mut waiter, mut stream) = fake.session(&instance);
        let mut room = Passthrough::new(&session, fake.system()).expect("passthrough");
        assert!(room.layer().is_none(), "paused");
        room.show(true);
        session
            .begin(openxr::ViewConfigurationType::PRIMARY_STEREO)
            .expect("begun");
        let frame = waiter.wait().expect("waited");
        stream.begin().expect("begun");
        let layer = room.layer().expect("it runs");
        let time = frame.predicted_display_time;
        stream
            .end(time, EnvironmentBlendMode::OPAQUE, &[&*layer])
            .expect("ended");
        let layers = fake.set(|world| world.frames[0].layers.clone());
        assert_eq!(layers.len(), 1, "{layers:?}");
        assert!(layers[0].contains("PASSTHROUGH"), "{layers:?}");
    }

    #[test]
    fn a_runtime_that_refuses_to_start_leaves_it_paused_and_is_asked_again() {
        let fake = FakeRuntime::with_everything();
        let mut room = made(&fake);
        fake.fail_times("xrPassthroughStartFB", XrResult::ERROR_RUNTIME_FAILURE, 1);
        room.show(true);
        assert!(!room.is_shown() && room.layer().is_none(), "refused");
        room.show(true);
        assert!(room.is_shown() && room.layer().is_some(), "granted");
    }

    #[test]
    fn it_is_destroyed_with_its_layer_before_its_session() {
        let fake = FakeRuntime::with_everything();
        drop(made(&fake));
        let names = fake.names();
        let last = &names[names.len() - 4..];
        let order = [
            "xrDestroyPassthroughLayerFB",
            "xrDestroyPassthroughFB",
            "xrDestroySession",
            "xrDestroyInstance",
        ];
        assert_eq!(last, order, "destroyed");
    }

    #[test]
    fn older_versions_of_the_extension_report_support_in_a_boolean() {
        let fake = FakeRuntime::with_everything();
        assert!(made(&fake).is_in_colour(), "the flags say colour");
        fake.set(|world| {
            world.system.passthrough = false;
            world.system.passthrough_of_old = true;
        });
        assert!(!made(&fake).is_in_colour(), "the boolean does not");
    }
}
