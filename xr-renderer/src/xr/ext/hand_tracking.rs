//! `XR_EXT_hand_tracking`: bare hands that hold by pinching.
//!
//! Without it hands are controllers. No model of a hand is drawn, and no gesture but two pinches is known.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use openxr::{HandJoint, HandJointLocations, HandTracker, Session, Space, SystemId, Time, Vulkan};

use super::pinch::Pinch;
use super::{Absent, refused};
use crate::xr::pose::{is_known, point, rigid};

const EXTENSION: &str = "XR_EXT_hand_tracking";

/// What one hand does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackedHand {
    /// The palm: -z towards the finger tips, y out of the hand's back.
    pub floor_from_grip: Affine3A,
    /// From the index finger's knuckle, -z as the hand points. None where a joint is not known.
    pub floor_from_aim: Option<Affine3A>,
    /// Thumb and index finger touch.
    pub pinches: bool,
    /// Thumb and middle finger touch, and the index finger does not.
    pub calls_overlay: bool,
}

/// Both hands' trackers.
pub struct HandTracking {
    /// Left, right.
    trackers: [HandTracker; 2],
    index: [Pinch; 2],
    middle: [Pinch; 2],
}

impl std::fmt::Debug for HandTracking {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HandTracking").finish_non_exhaustive()
    }
}

impl HandTracking {
    /// Starts tracking both hands.
    ///
    /// # Errors
    /// [`Absent`] where the runtime or the headset cannot, or refuses to.
    pub fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, Absent> {
        let instance = session.instance();
        if instance.exts().ext_hand_tracking.is_none() {
            return Err(Absent::NotGranted(EXTENSION));
        }
        let there = instance
            .supports_hand_tracking(system)
            .map_err(refused("xrGetSystemProperties"))?;
        if !there {
            return Err(Absent::NotBySystem(EXTENSION));
        }
        let tracker = |hand| {
            session
                .create_hand_tracker(hand)
                .map_err(refused("xrCreateHandTrackerEXT"))
        };
        Ok(Self {
            trackers: [
                tracker(openxr::HandEXT::LEFT)?,
                tracker(openxr::HandEXT::RIGHT)?,
            ],
            index: Default::default(),
            middle: Default::default(),
        })
    }

    /// Both hands at a time, left and right; None for one that is not seen.
    ///
    /// # Errors
    /// What the runtime says.
    pub fn locate(
        &mut self,
        floor: &Space,
        time: Time,
    ) -> openxr::Result<[Option<TrackedHand>; 2]> {
        let mut hands = [None; 2];
        for (side, hand) in hands.iter_mut().enumerate() {
            let joints = floor.locate_hand_joints(&self.trackers[side], time)?;
            *hand = self.read(side, joints.as_ref());
        }
        Ok(hands)
    }

    fn read(&mut self, side: usize, joints: Option<&HandJointLocations>) -> Option<TrackedHand> {
        let apart = |tip| {
            let thumb = place(joints?, HandJoint::THUMB_TIP)?;
            Some(thumb.distance(place(joints?, tip)?))
        };
        let pinches = self.index[side].update(apart(HandJoint::INDEX_TIP));
        let middle = self.middle[side].update(apart(HandJoint::MIDDLE_TIP));
        let joints = joints?;
        let palm = joints.get(joint(HandJoint::PALM))?;
        if !is_known(palm.location_flags) {
            return None;
        }
        let floor_from_grip = rigid(&palm.pose)?;
        Some(TrackedHand {
            floor_from_grip,
            floor_from_aim: aim(joints, floor_from_grip.matrix3.y_axis),
            pinches,
            // A fist touches everything at once.
            calls_overlay: middle && !pinches,
        })
    }
}

/// Looks from the index finger's knuckle the way that the hand points: from the wrist between the knuckles of the index and the
/// middle finger. Both hardly move while finger tips pinch, so the aim holds still just when it matters.
fn aim(joints: &HandJointLocations, up: Vec3A) -> Option<Affine3A> {
    let wrist = place(joints, HandJoint::WRIST)?;
    let index = place(joints, HandJoint::INDEX_PROXIMAL)?;
    let middle = place(joints, HandJoint::MIDDLE_PROXIMAL)?;
    let back = Vec3A::from(wrist - 0.5 * (index + middle)).try_normalize()?;
    let right = up.cross(back).try_normalize()?;
    let floor_from_aim = Mat3A::from_cols(right, back.cross(right), back);
    Some(Affine3A {
        matrix3: floor_from_aim,
        translation: index.into(),
    })
}

fn joint(joint: HandJoint) -> usize {
    // Joints count from 0; a negative one is no place in any array.
    usize::try_from(joint.into_raw()).unwrap_or(usize::MAX)
}

/// Where a joint is, metres. None where it is not known.
fn place(joints: &HandJointLocations, which: HandJoint) -> Option<Vec3> {
    let found = joints.get(joint(which))?;
    let place = point(&found.pose.position);
    (is_known(found.location_flags) && place.is_finite()).then_some(place)
}
