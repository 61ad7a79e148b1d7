//! `XR_FB_eye_tracking_social`: where each of the wearer's eyes looks.
//!
//! Without it the eyes look ahead, or as the face's expressions tell. Raw calls, because `openxr` 0.22 has no wrapper.

use glam::Affine3A;
use openxr::sys::{self, Handle as _};
use openxr::{Instance, Posef, Session, Space, SystemId, Time, Vulkan, raw};

use super::{Absent, ask_system, outcome, refused, share};
use crate::pose::rigid;

const EXTENSION: &str = "XR_FB_eye_tracking_social";

/// Where one eye looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaze {
    /// The eye in floor space, metres: it looks along -z.
    pub floor_from_eye: Affine3A,
    /// 0..=1.
    pub confidence: f32,
}

/// The tracker of both eyes.
pub(crate) struct EyeTracking {
    session: Session<Vulkan>,
    tracker: sys::EyeTrackerFB,
}

impl std::fmt::Debug for EyeTracking {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EyeTracking").finish_non_exhaustive()
    }
}

impl EyeTracking {
    /// Starts tracking the eyes.
    ///
    /// # Errors
    /// [`Absent`] where the runtime or the headset cannot, or refuses to: it does so until the wearer gives leave.
    pub(crate) fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, Absent> {
        let instance = session.instance();
        let fp = functions(instance)?;
        let mut eyes = sys::SystemEyeTrackingPropertiesFB {
            ty: sys::SystemEyeTrackingPropertiesFB::TYPE,
            next: std::ptr::null_mut(),
            supports_eye_tracking: sys::FALSE,
        };
        // SAFETY: it may be chained to the system's properties where the extension is enabled.
        unsafe { ask_system(instance, system, &mut eyes) }?;
        if eyes.supports_eye_tracking == sys::FALSE {
            return Err(Absent::NotBySystem(EXTENSION));
        }
        let info = sys::EyeTrackerCreateInfoFB {
            ty: sys::EyeTrackerCreateInfoFB::TYPE,
            next: std::ptr::null(),
        };
        let mut tracker = sys::EyeTrackerFB::NULL;
        // SAFETY: the session is alive, and `info` is whole.
        let result = unsafe { (fp.create_eye_tracker)(session.as_raw(), &info, &mut tracker) };
        outcome(result).map_err(refused("xrCreateEyeTrackerFB"))?;
        Ok(Self {
            session: session.clone(),
            tracker,
        })
    }

    /// Both eyes at a time, left and right; nothing for one that is not tracked.
    ///
    /// # Errors
    /// [`Absent::Refused`] with what the runtime says.
    pub(crate) fn read(&self, floor: &Space, time: Time) -> Result<[Option<Gaze>; 2], Absent> {
        let fp = functions(self.session.instance())?;
        let info = sys::EyeGazesInfoFB {
            ty: sys::EyeGazesInfoFB::TYPE,
            next: std::ptr::null(),
            base_space: floor.as_raw(),
            time,
        };
        let none = sys::EyeGazeFB {
            is_valid: sys::FALSE,
            gaze_pose: Posef::IDENTITY,
            gaze_confidence: 0.0,
        };
        let mut gazes = sys::EyeGazesFB {
            ty: sys::EyeGazesFB::TYPE,
            next: std::ptr::null_mut(),
            gaze: [none; 2],
            time,
        };
        // SAFETY: tracker and space are alive, and both structures are whole.
        let result = unsafe { (fp.get_eye_gazes)(self.tracker, &info, &mut gazes) };
        outcome(result).map_err(refused("xrGetEyeGazesFB"))?;
        Ok(gazes.gaze.map(|gaze| {
            let pose = (gaze.is_valid != sys::FALSE).then(|| rigid(&gaze.gaze_pose));
            pose.flatten().map(|floor_from_eye| Gaze {
                floor_from_eye,
                confidence: share(gaze.gaze_confidence),
            })
        }))
    }
}

impl Drop for EyeTracking {
    fn drop(&mut self) {
        if let Ok(fp) = functions(self.session.instance()) {
            // SAFETY: made by the session, which `self` keeps alive. What the runtime says is of no use any more.
            unsafe { (fp.destroy_eye_tracker)(self.tracker) };
        }
    }
}

fn functions(instance: &Instance) -> Result<&raw::EyeTrackingSocialFB, Absent> {
    let functions = instance.exts().fb_eye_tracking_social.as_ref();
    functions.ok_or(Absent::NotGranted(EXTENSION))
}
