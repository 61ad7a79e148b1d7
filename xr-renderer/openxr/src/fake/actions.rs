//! The core's functions of input.

use std::ffi::c_char;

use openxr::Path;
use openxr::sys::{self, Handle, Result as XrResult};

use super::call;
use super::pointers::{change, give, read, read_all, text, values};

const OK: XrResult = XrResult::SUCCESS;

pub(super) unsafe extern "system" fn create_action_set(
    instance: sys::Instance,
    info: *const sys::ActionSetCreateInfo,
    set: *mut sys::ActionSet,
) -> XrResult {
    let name = text(read(info).action_set_name.as_ptr());
    call(instance, "xrCreateActionSet", name, |world| {
        world.make("action set", set);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_action_set(set: sys::ActionSet) -> XrResult {
    call(set, "xrDestroyActionSet", "", |_| OK)
}

pub(super) unsafe extern "system" fn create_action(
    set: sys::ActionSet,
    info: *const sys::ActionCreateInfo,
    action: *mut sys::Action,
) -> XrResult {
    let info = read(info);
    let name = text(info.action_name.as_ptr());
    let said = format!("{name} {:?}", info.action_type);
    call(set, "xrCreateAction", said, |world| {
        if world.attached {
            return XrResult::ERROR_ACTIONSETS_ALREADY_ATTACHED;
        }
        let handle = world.make("action", action);
        world.actions.insert(handle, name);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_action(action: sys::Action) -> XrResult {
    call(action, "xrDestroyAction", "", |_| OK)
}

pub(super) unsafe extern "system" fn suggest_bindings(
    instance: sys::Instance,
    info: *const sys::InteractionProfileSuggestedBinding,
) -> XrResult {
    let info = read(info);
    let bindings = read_all(info.suggested_bindings, info.count_suggested_bindings);
    let name = "xrSuggestInteractionProfileBindings";
    let at = info.interaction_profile.into_raw();
    call(
        instance,
        name,
        format!("{} bindings", bindings.len()),
        |world| {
            let Some(profile) = world.path(at).map(str::to_owned) else {
                return XrResult::ERROR_PATH_INVALID;
            };
            if let Some(last) = world.calls.last_mut() {
                last.1 = profile.clone();
            }
            if world.refused_profiles.contains(&profile.as_str()) {
                return XrResult::ERROR_PATH_UNSUPPORTED;
            }
            if world.attached {
                return XrResult::ERROR_ACTIONSETS_ALREADY_ATTACHED;
            }
            world.bindings.retain(|(of, _, _)| *of != profile);
            for binding in bindings {
                let Some(source) = world.path(binding.binding.into_raw()).map(str::to_owned) else {
                    return XrResult::ERROR_PATH_INVALID;
                };
                let action = binding.action.into_raw();
                world.bindings.push((profile.clone(), action, source));
            }
            OK
        },
    )
}

pub(super) unsafe extern "system" fn attach_action_sets(
    session: sys::Session,
    _info: *const sys::SessionActionSetsAttachInfo,
) -> XrResult {
    call(session, "xrAttachSessionActionSets", "", |world| {
        if std::mem::replace(&mut world.attached, true) {
            return XrResult::ERROR_ACTIONSETS_ALREADY_ATTACHED;
        }
        OK
    })
}

pub(super) unsafe extern "system" fn get_current_profile(
    session: sys::Session,
    _hand: Path,
    out: *mut sys::InteractionProfileState,
) -> XrResult {
    call(session, "xrGetCurrentInteractionProfile", "", |world| {
        let profile = world.profile.map_or(0, |profile| world.path_of(profile));
        change(out, |to| to.interaction_profile = Path::from_raw(profile))
    })
}

pub(super) unsafe extern "system" fn sync_actions(
    session: sys::Session,
    info: *const sys::ActionsSyncInfo,
) -> XrResult {
    let sets = read(info).count_active_action_sets;
    call(session, "xrSyncActions", sets.to_string(), |world| {
        if world.attached {
            OK
        } else {
            XrResult::ERROR_ACTIONSET_NOT_ATTACHED
        }
    })
}

pub(super) unsafe extern "system" fn get_boolean(
    session: sys::Session,
    info: *const sys::ActionStateGetInfo,
    out: *mut sys::ActionStateBoolean,
) -> XrResult {
    let info = read(info);
    call(session, "xrGetActionStateBoolean", "", |world| {
        let value = world.value_of(info.action.into_raw(), info.subaction_path.into_raw());
        change(out, |to| {
            to.current_state = value.is_some_and(|value| value > 0.5).into();
            to.changed_since_last_sync = sys::FALSE;
            to.last_change_time = sys::Time::from_nanos(0);
            to.is_active = value.is_some().into();
        })
    })
}

pub(super) unsafe extern "system" fn get_float(
    session: sys::Session,
    info: *const sys::ActionStateGetInfo,
    out: *mut sys::ActionStateFloat,
) -> XrResult {
    let info = read(info);
    call(session, "xrGetActionStateFloat", "", |world| {
        let value = world.value_of(info.action.into_raw(), info.subaction_path.into_raw());
        change(out, |to| {
            to.current_state = value.unwrap_or(0.0);
            to.changed_since_last_sync = sys::FALSE;
            to.last_change_time = sys::Time::from_nanos(0);
            to.is_active = value.is_some().into();
        })
    })
}

pub(super) unsafe extern "system" fn get_vector(
    session: sys::Session,
    _info: *const sys::ActionStateGetInfo,
    _out: *mut sys::ActionStateVector2f,
) -> XrResult {
    call(session, "xrGetActionStateVector2f", "", |_| {
        XrResult::ERROR_ACTION_TYPE_MISMATCH
    })
}

pub(super) unsafe extern "system" fn get_pose(
    session: sys::Session,
    info: *const sys::ActionStateGetInfo,
    out: *mut sys::ActionStatePose,
) -> XrResult {
    let info = read(info);
    call(session, "xrGetActionStatePose", "", |world| {
        let pose = world.pose_of(info.action.into_raw(), info.subaction_path.into_raw());
        change(out, |to| to.is_active = pose.is_some().into())
    })
}

pub(super) unsafe extern "system" fn enumerate_bound_sources(
    session: sys::Session,
    info: *const sys::BoundSourcesForActionEnumerateInfo,
    capacity: u32,
    count: *mut u32,
    out: *mut Path,
) -> XrResult {
    let action = read(info).action.into_raw();
    call(session, "xrEnumerateBoundSourcesForAction", "", |world| {
        let bound: Vec<String> = world
            .bindings
            .iter()
            .filter(|(profile, bound, _)| {
                *bound == action && Some(profile.as_str()) == world.profile
            })
            .map(|(_, _, source)| source.clone())
            .collect();
        let paths: Vec<Path> = bound
            .iter()
            .map(|source| Path::from_raw(world.path_of(source)))
            .collect();
        values(capacity, count, out, &paths)
    })
}

pub(super) unsafe extern "system" fn get_source_name(
    session: sys::Session,
    _info: *const sys::InputSourceLocalizedNameGetInfo,
    capacity: u32,
    count: *mut u32,
    out: *mut c_char,
) -> XrResult {
    call(session, "xrGetInputSourceLocalizedName", "", |_| {
        values(capacity, count, out, &[b'?' as c_char, 0])
    })
}

pub(super) unsafe extern "system" fn apply_haptics(
    session: sys::Session,
    _info: *const sys::HapticActionInfo,
    _haptics: *const sys::HapticBaseHeader,
) -> XrResult {
    call(session, "xrApplyHapticFeedback", "", |_| OK)
}

pub(super) unsafe extern "system" fn stop_haptics(
    session: sys::Session,
    _info: *const sys::HapticActionInfo,
) -> XrResult {
    call(session, "xrStopHapticFeedback", "", |_| OK)
}

// Hands.

pub(super) unsafe extern "system" fn create_hand_tracker(
    session: sys::Session,
    info: *const sys::HandTrackerCreateInfoEXT,
    tracker: *mut sys::HandTrackerEXT,
) -> XrResult {
    let hand = read(info).hand;
    call(
        session,
        "xrCreateHandTrackerEXT",
        format!("{hand:?}"),
        |world| {
            if !world.system.hand_tracking {
                return XrResult::ERROR_FEATURE_UNSUPPORTED;
            }
            let side = usize::from(hand == openxr::HandEXT::RIGHT);
            let handle = world.make("hand tracker", tracker);
            world.trackers.insert(handle, side);
            OK
        },
    )
}

pub(super) unsafe extern "system" fn destroy_hand_tracker(
    tracker: sys::HandTrackerEXT,
) -> XrResult {
    call(tracker, "xrDestroyHandTrackerEXT", "", |_| OK)
}

pub(super) unsafe extern "system" fn locate_hand_joints(
    tracker: sys::HandTrackerEXT,
    info: *const sys::HandJointsLocateInfoEXT,
    out: *mut sys::HandJointLocationsEXT,
) -> XrResult {
    let info = read(info);
    call(tracker, "xrLocateHandJointsEXT", "", |world| {
        let side = world.trackers.get(&tracker.into_raw());
        let hand = side.and_then(|side| world.joints[*side]);
        let base = world.room_from(info.base_space.into_raw());
        let to = read(out);
        let Some((hand, room_from_base)) = hand.zip(base) else {
            return change(out, |to| to.is_active = sys::FALSE);
        };
        let base_from_room = room_from_base.inverse();
        let mut count = 0;
        super::pointers::list(
            to.joint_count,
            &mut count,
            to.joint_locations,
            &hand,
            |to, joint| {
                let pose = crate::pose::rigid(&joint.pose).unwrap_or_default();
                let pose = crate::pose::posef(&(base_from_room * pose));
                give(to, sys::HandJointLocationEXT { pose, ..*joint });
            },
        );
        change(out, |to| to.is_active = sys::TRUE)
    })
}
