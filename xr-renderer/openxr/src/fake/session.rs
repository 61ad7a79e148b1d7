//! The core's functions of sessions, frames and spaces.

use openxr::sys::{self, Handle, Result as XrResult};
use openxr::{ReferenceSpaceType, SessionState, SpaceLocationFlags, Time, ViewStateFlags};

use super::pointers::{change, describe, layers, list, read, values};
use super::world::Place;
use super::{EndedFrame, call, device};
use crate::pose::{posef, rigid};

const OK: XrResult = XrResult::SUCCESS;

pub(super) unsafe extern "system" fn create_session(
    instance: sys::Instance,
    info: *const sys::SessionCreateInfo,
    session: *mut sys::Session,
) -> XrResult {
    let next = read(info).next;
    call(instance, "xrCreateSession", describe(next), |world| {
        world.device = match (&world.loader, device::binding(next)) {
            (Some(loader), Some(binding)) => Some(loader.device(&binding)),
            _ => None,
        };
        world.session_lost = false;
        world.session = world.make("session", session);
        (world.running, world.attached, world.begun, world.waited) = (false, false, false, 0);
        world.oblige(&[SessionState::IDLE, SessionState::READY]);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_session(session: sys::Session) -> XrResult {
    call(session, "xrDestroySession", "", |_| OK)
}

pub(super) unsafe extern "system" fn begin_session(
    session: sys::Session,
    info: *const sys::SessionBeginInfo,
) -> XrResult {
    let views = read(info).primary_view_configuration_type;
    call(session, "xrBeginSession", format!("{views:?}"), |world| {
        if world.running {
            return XrResult::ERROR_SESSION_RUNNING;
        }
        if world.state != SessionState::READY {
            return XrResult::ERROR_SESSION_NOT_READY;
        }
        world.running = true;
        world.oblige(&[
            SessionState::SYNCHRONIZED,
            SessionState::VISIBLE,
            SessionState::FOCUSED,
        ]);
        OK
    })
}

pub(super) unsafe extern "system" fn end_session(session: sys::Session) -> XrResult {
    call(session, "xrEndSession", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        if world.state != SessionState::STOPPING {
            return XrResult::ERROR_SESSION_NOT_STOPPING;
        }
        (world.running, world.begun, world.waited) = (false, false, 0);
        world.oblige(&[SessionState::IDLE, SessionState::EXITING]);
        OK
    })
}

pub(super) unsafe extern "system" fn request_exit(session: sys::Session) -> XrResult {
    call(session, "xrRequestExitSession", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        world.oblige(&[
            SessionState::VISIBLE,
            SessionState::SYNCHRONIZED,
            SessionState::STOPPING,
        ]);
        OK
    })
}

pub(super) unsafe extern "system" fn wait_frame(
    session: sys::Session,
    _info: *const sys::FrameWaitInfo,
    state: *mut sys::FrameState,
) -> XrResult {
    call(session, "xrWaitFrame", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        world.waited += 1;
        world.now_ns += world.period_ns;
        change(state, |to| {
            to.predicted_display_time = Time::from_nanos(world.now_ns);
            to.predicted_display_period = sys::Duration::from_nanos(world.period_ns);
            to.should_render = world.should_render.into();
        })
    })
}

pub(super) unsafe extern "system" fn begin_frame(
    session: sys::Session,
    _info: *const sys::FrameBeginInfo,
) -> XrResult {
    call(session, "xrBeginFrame", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        if world.waited == 0 {
            return XrResult::ERROR_CALL_ORDER_INVALID;
        }
        world.waited -= 1;
        if std::mem::replace(&mut world.begun, true) {
            return XrResult::FRAME_DISCARDED;
        }
        OK
    })
}

pub(super) unsafe extern "system" fn end_frame(
    session: sys::Session,
    info: *const sys::FrameEndInfo,
) -> XrResult {
    let info = read(info);
    let layers = layers(&info);
    let (time, mode) = (info.display_time, info.environment_blend_mode);
    call(session, "xrEndFrame", format!("{layers:?}"), |world| {
        if !world.begun {
            return XrResult::ERROR_CALL_ORDER_INVALID;
        }
        world.begun = false;
        world.frames.push(EndedFrame {
            display_ns: time.as_nanos(),
            blend_mode: mode,
            layers,
        });
        OK
    })
}

// Spaces and views.

pub(super) unsafe extern "system" fn enumerate_reference_spaces(
    session: sys::Session,
    capacity: u32,
    count: *mut u32,
    out: *mut ReferenceSpaceType,
) -> XrResult {
    call(session, "xrEnumerateReferenceSpaces", "", |world| {
        values(capacity, count, out, &world.reference_spaces)
    })
}

pub(super) unsafe extern "system" fn get_bounds(
    session: sys::Session,
    _ty: ReferenceSpaceType,
    _out: *mut openxr::Extent2Df,
) -> XrResult {
    call(session, "xrGetReferenceSpaceBoundsRect", "", |_| {
        XrResult::SPACE_BOUNDS_UNAVAILABLE
    })
}

pub(super) unsafe extern "system" fn create_reference_space(
    session: sys::Session,
    info: *const sys::ReferenceSpaceCreateInfo,
    space: *mut sys::Space,
) -> XrResult {
    let info = read(info);
    let ty = info.reference_space_type;
    let said = format!("{ty:?}");
    call(session, "xrCreateReferenceSpace", said, |world| {
        if !world.reference_spaces.contains(&ty) {
            return XrResult::ERROR_REFERENCE_SPACE_UNSUPPORTED;
        }
        let Some(offset) = rigid(&info.pose_in_reference_space) else {
            return XrResult::ERROR_POSE_INVALID;
        };
        let handle = world.make("space", space);
        world.spaces.insert(handle, (Place::Reference(ty), offset));
        OK
    })
}

pub(super) unsafe extern "system" fn create_action_space(
    session: sys::Session,
    info: *const sys::ActionSpaceCreateInfo,
    space: *mut sys::Space,
) -> XrResult {
    let info = read(info);
    call(session, "xrCreateActionSpace", "", |world| {
        let Some(offset) = rigid(&info.pose_in_action_space) else {
            return XrResult::ERROR_POSE_INVALID;
        };
        let place = Place::Action {
            action: info.action.into_raw(),
            subaction: info.subaction_path.into_raw(),
        };
        let handle = world.make("space", space);
        world.spaces.insert(handle, (place, offset));
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_space(space: sys::Space) -> XrResult {
    call(space, "xrDestroySpace", "", |_| OK)
}

pub(super) unsafe extern "system" fn locate_space(
    space: sys::Space,
    base: sys::Space,
    time: Time,
    location: *mut sys::SpaceLocation,
) -> XrResult {
    call(space, "xrLocateSpace", format!("{time:?}"), |world| {
        let known = world
            .room_from(base.into_raw())
            .zip(world.room_from(space.into_raw()));
        change(location, |to| {
            to.location_flags = SpaceLocationFlags::EMPTY;
            if let Some((room_from_base, room_from_space)) = known {
                to.location_flags = SpaceLocationFlags::ORIENTATION_VALID
                    | SpaceLocationFlags::POSITION_VALID
                    | SpaceLocationFlags::ORIENTATION_TRACKED
                    | SpaceLocationFlags::POSITION_TRACKED;
                to.pose = posef(&(room_from_base.inverse() * room_from_space));
            }
        })
    })
}

pub(super) unsafe extern "system" fn locate_views(
    session: sys::Session,
    info: *const sys::ViewLocateInfo,
    state: *mut sys::ViewState,
    capacity: u32,
    count: *mut u32,
    out: *mut sys::View,
) -> XrResult {
    let info = read(info);
    let said = format!("{:?}", info.display_time);
    call(session, "xrLocateViews", said, |world| {
        let base = world.room_from(info.space.into_raw());
        change(state, |to| {
            to.view_state_flags = match base {
                Some(_) => ViewStateFlags::ORIENTATION_VALID | ViewStateFlags::POSITION_VALID,
                None => ViewStateFlags::EMPTY,
            };
        });
        let base_from_room = base.unwrap_or_default().inverse();
        list(capacity, count, out, &world.eyes, |to, (pose, fov)| {
            change(to, |to| {
                to.pose = posef(&(base_from_room * rigid(pose).unwrap_or_default()));
                to.fov = *fov;
            });
        })
    })
}
