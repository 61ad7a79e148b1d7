//! `XR_EXT_hand_tracking`: bare hands that grab by pinching.
//!
//! Without it hands are controllers. No hand is drawn, and two pinches are the only gestures.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use openxr::{HandJoint, HandJointLocations, HandTracker, Session, Space, SystemId, Time, Vulkan};

use super::pinch::Pinch;
use super::{Absent, refused};
use crate::pose::{is_known, point, rigid};

const EXTENSION: &str = "XR_EXT_hand_tracking";

/// The state of one hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackedHand {
    /// The palm: -z towards the finger tips, y out of the hand's back.
    pub floor_from_grip: Affine3A,
    /// From the index finger's knuckle, -z as the hand points. None where a joint is not known.
    pub floor_from_aim: Option<Affine3A>,
    /// Thumb and index finger touch.
    pub pinches: bool,
    /// Thumb and middle finger touch, and the index finger does not.
    pub touches_middle: bool,
}

/// `floor_from_joint` of a hand's joints in the extension's order; nothing for one that is not known.
pub type HandJointPoses = [Option<Affine3A>; 26];

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

    /// All joints of both hands at a time, left and right; None for one that is not seen.
    ///
    /// # Errors
    /// What the runtime says.
    pub fn joints(&self, floor: &Space, time: Time) -> openxr::Result<[Option<HandJointPoses>; 2]> {
        let mut hands = [None; 2];
        for (tracker, hand) in self.trackers.iter().zip(&mut hands) {
            let Some(joints) = floor.locate_hand_joints(tracker, time)? else {
                continue;
            };
            let mut poses = [None; 26];
            for (to, joint) in poses.iter_mut().zip(joints.iter()) {
                *to = is_known(joint.location_flags)
                    .then(|| rigid(&joint.pose))
                    .flatten();
            }
            *hand = Some(poses);
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
            touches_middle: middle && !pinches,
        })
    }
}

/// The aim from the index finger's knuckle in the direction that the hand points: from the wrist between the knuckles of the index and the
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
    // Joints count from 0; a negative number is no index.
    usize::try_from(joint.into_raw()).unwrap_or(usize::MAX)
}

/// Where a joint is, metres. None where it is not known.
fn place(joints: &HandJointLocations, which: HandJoint) -> Option<Vec3> {
    let found = joints.get(joint(which))?;
    let place = point(&found.pose.position);
    (is_known(found.location_flags) && place.is_finite()).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{FakeRuntime, hand};
    use glam::Quat;
    use openxr::{Posef, ReferenceSpaceType, SpaceLocationFlags};

    struct Scene {
        tracking: HandTracking,
        floor: Space,
        fake: FakeRuntime,
    }

    impl Scene {
        fn new() -> Self {
            let fake = FakeRuntime::with_everything();
            let (session, _, _) = fake.session(&fake.instance());
            Self {
                tracking: HandTracking::new(&session, fake.system()).expect("tracking"),
                floor: session
                    .create_reference_space(ReferenceSpaceType::LOCAL_FLOOR, Posef::IDENTITY)
                    .expect("a space"),
                fake,
            }
        }

        fn locate(&mut self) -> [Option<TrackedHand>; 2] {
            let time = Time::from_nanos(1);
            self.tracking.locate(&self.floor, time).expect("located")
        }
    }

    /// A right hand before the chest whose fingers point ahead and left, turned about y.
    fn floor_from_palm() -> Affine3A {
        Affine3A::from_rotation_translation(Quat::from_rotation_y(0.5), Vec3::new(0.2, 1.2, -0.4))
    }

    #[test]
    fn the_grip_is_the_palm_and_the_aim_follows_the_fingers() {
        let mut scene = Scene::new();
        scene
            .fake
            .set(|world| world.joints[1] = Some(hand(floor_from_palm(), 0.06, 0.08)));
        let [left, right] = scene.locate();
        assert!(left.is_none(), "not tracked");
        let right = right.expect("seen");
        assert!(
            right.floor_from_grip.abs_diff_eq(floor_from_palm(), 1e-5),
            "{right:?}"
        );
        let aim = right.floor_from_aim.expect("all joints are known");
        let ahead = aim.transform_vector3(Vec3::NEG_Z);
        let fingers = floor_from_palm().transform_vector3(Vec3::NEG_Z);
        assert!(ahead.dot(fingers) > 0.99, "{ahead} and {fingers}");
        let turn = glam::Mat3::from(aim.matrix3);
        assert!((turn.determinant() - 1.0).abs() < 1e-4, "{turn}");
        assert!(aim.transform_vector3(Vec3::Y).y > 0.9, "upright");
    }

    #[test]
    fn an_index_pinch_grabs_and_a_middle_finger_pinch_is_another_thing() {
        let mut scene = Scene::new();
        let mut with = |index, middle| {
            scene
                .fake
                .set(|world| world.joints[0] = Some(hand(floor_from_palm(), index, middle)));
            let [left, _] = scene.locate();
            left.map(|left| (left.pinches, left.touches_middle))
        };
        assert_eq!(with(0.06, 0.08), Some((false, false)), "open");
        assert_eq!(with(0.01, 0.08), Some((true, false)), "pinched");
        assert_eq!(with(0.02, 0.08), Some((true, false)), "trembling");
        assert_eq!(with(0.06, 0.01), Some((false, true)), "middle finger");
        assert_eq!(with(0.01, 0.01), Some((true, false)), "a fist");
    }

    #[test]
    fn an_untracked_hand_is_none_and_lets_go() {
        let mut scene = Scene::new();
        let pinched = hand(floor_from_palm(), 0.01, 0.08);
        scene.fake.set(|world| world.joints[1] = Some(pinched));
        assert!(
            scene.locate()[1].is_some_and(|hand| hand.pinches),
            "pinches"
        );
        scene.fake.set(|world| world.joints[1] = None);
        assert_eq!(scene.locate(), [None, None], "gone");
        let between = hand(floor_from_palm(), 0.02, 0.08);
        scene.fake.set(|world| world.joints[1] = Some(between));
        let back = scene.locate()[1].expect("back");
        assert!(!back.pinches, "it has let go");
    }

    #[test]
    fn unknown_finger_joints_end_pinch_and_aim_and_an_unknown_palm_ends_the_hand() {
        let mut scene = Scene::new();
        let mut joints = hand(floor_from_palm(), 0.01, 0.08);
        joints[joint(HandJoint::INDEX_TIP)].location_flags = SpaceLocationFlags::EMPTY;
        joints[joint(HandJoint::WRIST)].location_flags = SpaceLocationFlags::EMPTY;
        scene.fake.set(|world| world.joints[0] = Some(joints));
        let left = scene.locate()[0].expect("a palm");
        assert!(!left.pinches && left.floor_from_aim.is_none(), "{left:?}");
        joints[joint(HandJoint::PALM)].location_flags = SpaceLocationFlags::EMPTY;
        scene.fake.set(|world| world.joints[0] = Some(joints));
        assert_eq!(scene.locate()[0], None, "no palm, no hand");
    }

    #[test]
    fn dropping_it_destroys_the_trackers() {
        let scene = Scene::new();
        let Scene { tracking, fake, .. } = scene;
        assert_eq!(fake.alive("hand tracker"), 2, "both hands'");
        drop(tracking);
        assert_eq!(fake.alive("hand tracker"), 0, "gone");
    }
}
