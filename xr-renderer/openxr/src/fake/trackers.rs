//! The functions of the extensions that watch the wearer: body, face, eyes.

use openxr::Posef;
use openxr::sys::{self, Handle, Result as XrResult};

use super::call;
use super::pointers::{change, give, read, read_all};
use super::world::World;
use crate::pose::{posef, rigid};

const OK: XrResult = XrResult::SUCCESS;

/// A pose of the room in the space; what is no pose stays what it is.
fn in_space(world: &World, space: sys::Space, pose: &Posef) -> Posef {
    let room_from_base = world.room_from(space.into_raw()).unwrap_or_default();
    match rigid(pose) {
        Some(pose) => posef(&(room_from_base.inverse() * pose)),
        None => *pose,
    }
}

// XR_FB_body_tracking, XR_META_body_tracking_full_body, XR_META_body_tracking_fidelity.

pub(super) unsafe extern "system" fn create_body_tracker(
    session: sys::Session,
    info: *const sys::BodyTrackerCreateInfoFB,
    out: *mut sys::BodyTrackerFB,
) -> XrResult {
    let set = read(info).body_joint_set;
    call(
        session,
        "xrCreateBodyTrackerFB",
        format!("{set:?}"),
        |world| {
            let count = match set {
                sys::BodyJointSetFB::DEFAULT => 70,
                sys::BodyJointSetFB::FULL_BODY_M
                    if world.has("XR_META_body_tracking_full_body") && world.system.full_body =>
                {
                    84
                }
                _ => return XrResult::ERROR_VALIDATION_FAILURE,
            };
            if !world.system.body_tracking {
                return XrResult::ERROR_FEATURE_UNSUPPORTED;
            }
            let handle = world.make("body tracker", out);
            world.trackers.insert(handle, count);
            OK
        },
    )
}

pub(super) unsafe extern "system" fn destroy_body_tracker(it: sys::BodyTrackerFB) -> XrResult {
    call(it, "xrDestroyBodyTrackerFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn locate_body_joints(
    tracker: sys::BodyTrackerFB,
    info: *const sys::BodyJointsLocateInfoFB,
    out: *mut sys::BodyJointLocationsFB,
) -> XrResult {
    let info = read(info);
    let said = format!("{:?}", info.time);
    call(tracker, "xrLocateBodyJointsFB", said, |world| {
        let to = read(out);
        if world.trackers.get(&tracker.into_raw()) != Some(&(to.joint_count as usize)) {
            return XrResult::ERROR_VALIDATION_FAILURE;
        }
        let watched = &world.watched;
        for (place, joint) in watched
            .body
            .iter()
            .take(to.joint_count as usize)
            .enumerate()
        {
            let pose = in_space(world, info.base_space, &joint.pose);
            // As many joints as the application says it has room for.
            give(
                to.joint_locations.wrapping_add(place),
                sys::BodyJointLocationFB { pose, ..*joint },
            );
        }
        change(out, |to| {
            to.is_active = watched.body_active.into();
            to.confidence = watched.body_confidence;
            to.skeleton_changed_count = watched.skeleton_changes;
        })
    })
}

pub(super) unsafe extern "system" fn get_body_skeleton(
    tracker: sys::BodyTrackerFB,
    out: *mut sys::BodySkeletonFB,
) -> XrResult {
    call(tracker, "xrGetBodySkeletonFB", "", |world| {
        let to = read(out);
        if world.trackers.get(&tracker.into_raw()) != Some(&(to.joint_count as usize)) {
            return XrResult::ERROR_VALIDATION_FAILURE;
        }
        let joints = world.watched.skeleton.iter().take(to.joint_count as usize);
        for (place, pose) in joints.enumerate() {
            give(
                to.joints.wrapping_add(place),
                sys::BodySkeletonJointFB {
                    joint: place as i32,
                    parent_joint: place as i32 - 1,
                    pose: *pose,
                },
            );
        }
        OK
    })
}

pub(super) unsafe extern "system" fn request_body_fidelity(
    tracker: sys::BodyTrackerFB,
    fidelity: sys::BodyTrackingFidelityMETA,
) -> XrResult {
    let said = format!("{fidelity:?}");
    call(tracker, "xrRequestBodyTrackingFidelityMETA", said, |_| OK)
}

// XR_FB_face_tracking2.

pub(super) unsafe extern "system" fn create_face_tracker(
    session: sys::Session,
    info: *const sys::FaceTrackerCreateInfo2FB,
    out: *mut sys::FaceTracker2FB,
) -> XrResult {
    let info = read(info);
    let sources = read_all(
        info.requested_data_sources.cast_const(),
        info.requested_data_source_count,
    );
    let said = format!("{sources:?}");
    call(session, "xrCreateFaceTracker2FB", said, |world| {
        let has = |source: &sys::FaceTrackingDataSource2FB| match *source {
            sys::FaceTrackingDataSource2FB::VISUAL => world.system.face_seen,
            _ => world.system.face_heard,
        };
        if !sources.iter().all(has) {
            return XrResult::ERROR_FEATURE_UNSUPPORTED;
        }
        world.make("face tracker", out);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_face_tracker(it: sys::FaceTracker2FB) -> XrResult {
    call(it, "xrDestroyFaceTracker2FB", "", |_| OK)
}

pub(super) unsafe extern "system" fn get_face_weights(
    tracker: sys::FaceTracker2FB,
    info: *const sys::FaceExpressionInfo2FB,
    out: *mut sys::FaceExpressionWeights2FB,
) -> XrResult {
    let said = format!("{:?}", read(info).time);
    call(tracker, "xrGetFaceExpressionWeights2FB", said, |world| {
        let (to, watched) = (read(out), &world.watched);
        if (to.weight_count, to.confidence_count) != (70, 2) {
            return XrResult::ERROR_VALIDATION_FAILURE;
        }
        give(to.weights.cast(), watched.face);
        give(to.confidences.cast(), watched.face_confidences);
        change(out, |to| {
            to.is_valid = watched.face_valid.into();
            to.is_eye_following_blendshapes_valid = watched.face_eyes_valid.into();
            to.data_source = watched.face_source;
        })
    })
}

// XR_FB_eye_tracking_social.

pub(super) unsafe extern "system" fn create_eye_tracker(
    session: sys::Session,
    _info: *const sys::EyeTrackerCreateInfoFB,
    out: *mut sys::EyeTrackerFB,
) -> XrResult {
    call(session, "xrCreateEyeTrackerFB", "", |world| {
        if !world.system.eye_tracking {
            return XrResult::ERROR_FEATURE_UNSUPPORTED;
        }
        world.make("eye tracker", out);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_eye_tracker(it: sys::EyeTrackerFB) -> XrResult {
    call(it, "xrDestroyEyeTrackerFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn get_eye_gazes(
    tracker: sys::EyeTrackerFB,
    info: *const sys::EyeGazesInfoFB,
    out: *mut sys::EyeGazesFB,
) -> XrResult {
    let info = read(info);
    let said = format!("{:?}", info.time);
    call(tracker, "xrGetEyeGazesFB", said, |world| {
        let gazes = world.watched.gazes.map(|gaze| {
            let (pose, confidence) = gaze?;
            Some((in_space(world, info.base_space, &pose), confidence))
        });
        change(out, |to| {
            for (to, gaze) in to.gaze.iter_mut().zip(gazes) {
                to.is_valid = gaze.is_some().into();
                if let Some((pose, confidence)) = gaze {
                    (to.gaze_pose, to.gaze_confidence) = (pose, confidence);
                }
            }
        })
    })
}
