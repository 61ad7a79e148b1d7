//! `XR_EXT_eye_gaze_interaction`: where the wearer looks.
//!
//! Without it, and while the runtime does not know (eyes shut, not calibrated, not allowed), there is no gaze.

use glam::Affine3A;
use openxr::{Action, ActionSet, Binding, Instance, Posef, Session, Space, SystemId, Time, Vulkan};
use openxr::{Path, sys};

use super::{Absent, ask_system, refused};
use crate::pose::base_from_space;

const EXTENSION: &str = "XR_EXT_eye_gaze_interaction";
const PROFILE: &str = "/interaction_profiles/ext/eye_gaze_interaction";
const SOURCE: &str = "/user/eyes_ext/input/gaze_ext/pose";

/// The gaze as an action. It is made with its action set, before that is attached to a session.
pub(crate) struct GazeAction(Action<Posef>);

impl GazeAction {
    /// Adds the gaze to a set that is not attached yet.
    ///
    /// # Errors
    /// [`Absent`] where the runtime or the headset has none, or refuses it.
    pub(crate) fn new(
        instance: &Instance,
        system: SystemId,
        actions: &ActionSet,
    ) -> Result<Self, Absent> {
        if instance.exts().ext_eye_gaze_interaction.is_none() {
            return Err(Absent::NotGranted(EXTENSION));
        }
        let mut gaze = sys::SystemEyeGazeInteractionPropertiesEXT {
            ty: sys::SystemEyeGazeInteractionPropertiesEXT::TYPE,
            next: std::ptr::null_mut(),
            supports_eye_gaze_interaction: sys::FALSE,
        };
        // SAFETY: it may be chained to the system's properties where the extension is enabled.
        unsafe { ask_system(instance, system, &mut gaze) }?;
        if !bool::from(gaze.supports_eye_gaze_interaction) {
            return Err(Absent::NotBySystem(EXTENSION));
        }
        let path = |text| {
            instance
                .string_to_path(text)
                .map_err(refused("xrStringToPath"))
        };
        let (profile, source) = (path(PROFILE)?, path(SOURCE)?);
        let action = actions
            .create_action("gaze", "Gaze", &[])
            .map_err(refused("xrCreateAction"))?;
        instance
            .suggest_interaction_profile_bindings(profile, &[Binding::new(&action, source)])
            .map_err(refused("xrSuggestInteractionProfileBindings"))?;
        Ok(Self(action))
    }

    /// Goes on with the set attached to a session.
    ///
    /// # Errors
    /// [`Absent`] where the runtime refuses.
    pub(crate) fn attached(self, session: &Session<Vulkan>) -> Result<EyeGaze, Absent> {
        let space = self
            .0
            .create_space(session, Path::NULL, Posef::IDENTITY)
            .map_err(refused("xrCreateActionSpace"))?;
        Ok(EyeGaze {
            session: session.clone(),
            action: self.0,
            space,
        })
    }
}

/// Where the wearer looks.
pub(crate) struct EyeGaze {
    session: Session<Vulkan>,
    action: Action<Posef>,
    space: Space,
}

impl EyeGaze {
    /// Between the eyes, -z as they look, after actions were synchronised. None where it is not known.
    ///
    /// # Errors
    /// What the runtime says.
    pub(crate) fn floor_from_gaze(
        &self,
        floor: &Space,
        time: Time,
    ) -> openxr::Result<Option<Affine3A>> {
        if !self.action.is_active(&self.session, Path::NULL)? {
            return Ok(None);
        }
        base_from_space(floor, &self.space, time)
    }
}
