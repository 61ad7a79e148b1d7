//! `XR_FB_body_tracking`: the joints of the wearer's body; with `XR_META_body_tracking_full_body` those of the legs too.
//!
//! Without it whoever follows the wearer has head and hands. Raw calls, because `openxr` 0.22 has no wrapper.

use glam::Affine3A;
use openxr::sys::{self, Handle as _};
use openxr::{Instance, Posef, Session, Space, SpaceLocationFlags, SystemId, Time, Vulkan, raw};

use super::{Absent, ask_system, body_fidelity, outcome, refused, share};
use crate::pose::{is_known, rigid};

const EXTENSION: &str = "XR_FB_body_tracking";
const FULL: &str = "XR_META_body_tracking_full_body";

/// Joints of the whole body, in the order of `XrFullBodyJointMETA`. The first 70 of them are `XrBodyJointFB`'s.
pub const BODY_JOINTS: usize = 84;
/// Joints of a body without legs.
const UPPER_JOINTS: usize = 70;

/// A joint of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyJoint {
    /// Metres, floor space; the joint's axes are the runtime's own, see [`Body::t_pose`].
    pub floor_from_joint: Affine3A,
    /// Whether it was measured, and not inferred.
    pub tracked: bool,
}

/// The wearer's body at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Of the whole body, 0..=1.
    pub confidence: f32,
    /// In the order of `XrFullBodyJointMETA`; nothing for joints that are not known.
    pub joints: [Option<BodyJoint>; BODY_JOINTS],
    /// The same joints of the wearer in T-pose, in a space of their own: y up, metres. Nothing where the runtime does not tell it.
    pub t_pose: [Option<Affine3A>; BODY_JOINTS],
}

/// The tracker of one body.
pub(crate) struct BodyTracking {
    session: Session<Vulkan>,
    tracker: sys::BodyTrackerFB,
    joints: usize,
    t_pose: [Option<Affine3A>; BODY_JOINTS],
    /// Of which count of the skeleton's changes that is.
    t_pose_of: Option<u32>,
}

impl std::fmt::Debug for BodyTracking {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BodyTracking")
            .field("joints", &self.joints)
            .finish_non_exhaustive()
    }
}

impl BodyTracking {
    /// Starts tracking the body.
    ///
    /// # Errors
    /// [`Absent`] where the runtime or the headset cannot, or refuses to: it does so until the wearer gives leave.
    pub(crate) fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, Absent> {
        let instance = session.instance();
        let fp = functions(instance)?;
        let full = supported(instance, system)?;
        let mut this = Self {
            session: session.clone(),
            tracker: sys::BodyTrackerFB::NULL,
            joints: UPPER_JOINTS,
            t_pose: [None; BODY_JOINTS],
            t_pose_of: None,
        };
        let mut create = |body_joint_set| {
            let info = sys::BodyTrackerCreateInfoFB {
                ty: sys::BodyTrackerCreateInfoFB::TYPE,
                next: std::ptr::null(),
                body_joint_set,
            };
            // SAFETY: the session is alive, and `info` is whole.
            outcome(unsafe { (fp.create_body_tracker)(session.as_raw(), &info, &mut this.tracker) })
        };
        // A runtime may have legs in general, and not now.
        if full && create(sys::BodyJointSetFB::FULL_BODY_M).is_ok() {
            this.joints = BODY_JOINTS;
        } else {
            create(sys::BodyJointSetFB::DEFAULT).map_err(refused("xrCreateBodyTrackerFB"))?;
        }
        // SAFETY: it was just made.
        if let Err(why) = unsafe { body_fidelity::ask_for_high(instance, system, this.tracker) } {
            log::debug!("the body is tracked as the runtime likes: {why}");
        }
        Ok(this)
    }

    /// The body at a time; nothing while it is not tracked.
    ///
    /// # Errors
    /// [`Absent::Refused`] with what the runtime says.
    pub(crate) fn locate(&mut self, floor: &Space, time: Time) -> Result<Option<Body>, Absent> {
        let fp = functions(self.session.instance())?;
        let info = sys::BodyJointsLocateInfoFB {
            ty: sys::BodyJointsLocateInfoFB::TYPE,
            next: std::ptr::null(),
            base_space: floor.as_raw(),
            time,
        };
        let mut located = [sys::BodyJointLocationFB {
            location_flags: SpaceLocationFlags::EMPTY,
            pose: Posef::IDENTITY,
        }; BODY_JOINTS];
        let mut locations = sys::BodyJointLocationsFB {
            ty: sys::BodyJointLocationsFB::TYPE,
            next: std::ptr::null_mut(),
            is_active: sys::FALSE,
            confidence: 0.0,
            joint_count: u32::try_from(self.joints).unwrap_or(0),
            joint_locations: located.as_mut_ptr(),
            skeleton_changed_count: 0,
            time,
        };
        // SAFETY: tracker and space are alive; `located` has room for the joints of either set.
        let result = unsafe { (fp.locate_body_joints)(self.tracker, &info, &mut locations) };
        outcome(result).map_err(refused("xrLocateBodyJointsFB"))?;
        if locations.is_active == sys::FALSE {
            return Ok(None);
        }
        if self.t_pose_of != Some(locations.skeleton_changed_count) {
            // One that the runtime does not have yet is asked for again with the next frame.
            match self.skeleton(fp) {
                Ok(t_pose) => {
                    self.t_pose = t_pose;
                    self.t_pose_of = Some(locations.skeleton_changed_count);
                }
                Err(why) => {
                    // The former one is of a body that is no longer tracked.
                    self.t_pose = [None; BODY_JOINTS];
                    log::debug!("without the body's T-pose so far: {why}");
                }
            }
        }
        let mut joints = [None; BODY_JOINTS];
        for (joint, located) in joints.iter_mut().zip(located).take(self.joints) {
            let known = is_known(located.location_flags).then(|| rigid(&located.pose));
            let tracked =
                SpaceLocationFlags::POSITION_TRACKED | SpaceLocationFlags::ORIENTATION_TRACKED;
            *joint = known.flatten().map(|floor_from_joint| BodyJoint {
                floor_from_joint,
                tracked: located.location_flags.contains(tracked),
            });
        }
        Ok(Some(Body {
            confidence: share(locations.confidence),
            joints,
            t_pose: self.t_pose,
        }))
    }

    fn skeleton(
        &self,
        fp: &raw::BodyTrackingFB,
    ) -> Result<[Option<Affine3A>; BODY_JOINTS], Absent> {
        let mut joints = [sys::BodySkeletonJointFB {
            joint: -1,
            parent_joint: -1,
            pose: Posef::IDENTITY,
        }; BODY_JOINTS];
        let mut skeleton = sys::BodySkeletonFB {
            ty: sys::BodySkeletonFB::TYPE,
            next: std::ptr::null_mut(),
            joint_count: u32::try_from(self.joints).unwrap_or(0),
            joints: joints.as_mut_ptr(),
        };
        // SAFETY: the tracker is alive; `joints` has room for the joints of either set.
        let result = unsafe { (fp.get_body_skeleton)(self.tracker, &mut skeleton) };
        outcome(result).map_err(refused("xrGetBodySkeletonFB"))?;
        let mut t_pose = [None; BODY_JOINTS];
        for joint in joints.iter().take(self.joints) {
            let place = usize::try_from(joint.joint).ok();
            if let Some(to) = place.and_then(|place| t_pose.get_mut(place)) {
                *to = rigid(&joint.pose);
            }
        }
        Ok(t_pose)
    }
}

impl Drop for BodyTracking {
    fn drop(&mut self) {
        if let Ok(fp) = functions(self.session.instance())
            && self.tracker != sys::BodyTrackerFB::NULL
        {
            // SAFETY: made by the session, which `self` keeps alive. What the runtime says is of no use any more.
            unsafe { (fp.destroy_body_tracker)(self.tracker) };
        }
    }
}

fn functions(instance: &Instance) -> Result<&raw::BodyTrackingFB, Absent> {
    let functions = instance.exts().fb_body_tracking.as_ref();
    functions.ok_or(Absent::NotGranted(EXTENSION))
}

/// Whether the headset has legs too; absent where it tracks no body.
fn supported(instance: &Instance, system: SystemId) -> Result<bool, Absent> {
    let mut body = sys::SystemBodyTrackingPropertiesFB {
        ty: sys::SystemBodyTrackingPropertiesFB::TYPE,
        next: std::ptr::null_mut(),
        supports_body_tracking: sys::FALSE,
    };
    // SAFETY: it may be chained to the system's properties where the extension is enabled.
    unsafe { ask_system(instance, system, &mut body) }?;
    if body.supports_body_tracking == sys::FALSE {
        return Err(Absent::NotBySystem(EXTENSION));
    }
    let full = instance.exts().meta_body_tracking_full_body.is_some() && {
        let mut full = sys::SystemPropertiesBodyTrackingFullBodyMETA {
            ty: sys::SystemPropertiesBodyTrackingFullBodyMETA::TYPE,
            next: std::ptr::null_mut(),
            supports_full_body_tracking: sys::FALSE,
        };
        // SAFETY: as above.
        unsafe { ask_system(instance, system, &mut full) }.is_ok()
            && full.supports_full_body_tracking != sys::FALSE
    };
    if !full {
        log::debug!("the body is tracked without its legs: no {FULL}");
    }
    Ok(full)
}
