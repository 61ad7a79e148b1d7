//! `XR_EXT_eye_gaze_interaction`: where the wearer looks, one direction for both eyes.
//!
//! For headsets without `XR_FB_eye_tracking_social`. Its action is in a set of its own, which is active only once somebody asked: until then
//! the runtime need not watch the eyes.

use glam::Affine3A;
use openxr::{
    Action, ActionSet, Binding, Instance, Path, Posef, Session, Space, SystemId, Time, Vulkan, sys,
};
use std::time::Instant;

use super::{Absent, OnFirstUse, ask_system, refused};
use crate::pose::base_from_space;

const EXTENSION: &str = "XR_EXT_eye_gaze_interaction";
const PROFILE: &str = "/interaction_profiles/ext/eye_gaze_interaction";
const SOURCE: &str = "/user/eyes_ext/input/gaze_ext/pose";

/// The action, in a set that is to be attached with the others.
pub(crate) struct GazeInteraction {
    session: Session<Vulkan>,
    set: ActionSet,
    action: Action<Posef>,
    space: OnFirstUse<Space>,
    wanted: bool,
}

impl std::fmt::Debug for GazeInteraction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GazeInteraction")
            .field("wanted", &self.wanted)
            .finish_non_exhaustive()
    }
}

impl GazeInteraction {
    /// Makes the action, before action sets are attached.
    ///
    /// # Errors
    /// [`Absent`] where the runtime or the headset cannot, or refuses to.
    pub(crate) fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, Absent> {
        let instance = session.instance();
        if instance.exts().ext_eye_gaze_interaction.is_none() {
            return Err(Absent::NotGranted(EXTENSION));
        }
        supported(instance, system)?;
        let set = instance
            .create_action_set("gaze", "Gaze", 0)
            .map_err(refused("xrCreateActionSet"))?;
        let action = set
            .create_action("gaze", "Where you look", &[])
            .map_err(refused("xrCreateAction"))?;
        let path = |text| {
            let path = instance.string_to_path(text);
            path.map_err(refused("xrStringToPath"))
        };
        instance
            .suggest_interaction_profile_bindings(
                path(PROFILE)?,
                &[Binding::new(&action, path(SOURCE)?)],
            )
            .map_err(refused("xrSuggestInteractionProfileBindings"))?;
        Ok(Self {
            session: session.clone(),
            set,
            action,
            space: OnFirstUse::new("the wearer's gaze"),
            wanted: false,
        })
    }

    /// The action's set.
    pub(crate) fn set(&self) -> &ActionSet {
        &self.set
    }

    /// Whether somebody asked: the set is to be active.
    pub(crate) fn is_wanted(&self) -> bool {
        self.wanted
    }

    /// Between the eyes at a time, -z where they look; nothing where that is not known, and before the set was active.
    pub(crate) fn locate(&mut self, floor: &Space, at: Instant, time: Time) -> Option<Affine3A> {
        self.wanted = true;
        let (session, action) = (&self.session, &self.action);
        self.space.read(
            at,
            || {
                let space = action.create_space(session, Path::NULL, Posef::IDENTITY);
                space.map_err(refused("xrCreateActionSpace"))
            },
            |space| base_from_space(floor, space, time).map_err(refused("xrLocateSpace")),
        )
    }
}

/// Absent where the headset tracks no eyes.
fn supported(instance: &Instance, system: SystemId) -> Result<(), Absent> {
    let mut gaze = sys::SystemEyeGazeInteractionPropertiesEXT {
        ty: sys::SystemEyeGazeInteractionPropertiesEXT::TYPE,
        next: std::ptr::null_mut(),
        supports_eye_gaze_interaction: sys::FALSE,
    };
    // SAFETY: it may be chained to the system's properties where the extension is enabled.
    unsafe { ask_system(instance, system, &mut gaze) }?;
    let supported = gaze.supports_eye_gaze_interaction != sys::FALSE;
    supported
        .then_some(())
        .ok_or(Absent::NotBySystem(EXTENSION))
}
