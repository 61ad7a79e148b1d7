//! A headset and its session on the stand-in runtime, with the machine's own Vulkan: what follows from the runtime's events.

use openxr::SessionState as XrSessionState;
use openxr::{ReferenceSpaceType, Time, sys};

mod lenses;
mod pictures;

use renderer_splat::error::RenderError;
use renderer_vulkan::error::VulkanError;

use crate::error::XrError;
use crate::fake::{FakeRuntime, REQUIRED, hand, posef};
use crate::frame::Frame;
use crate::headset::{Headset, HeadsetOptions};
use crate::runtime::Runtime;
use crate::session::{Session, SessionEnd, SessionOptions, Tracks};
use crate::space::Floor;
use crate::state::SessionState;
use glam::{Affine3A, Vec3};

/// The headset of a stand-in; nothing where there is no Vulkan and CI does not demand one.
fn open(fake: &FakeRuntime) -> Option<Headset> {
    open_sized(fake, [64, 64])
}

/// The same, with pictures of a size.
fn open_sized(fake: &FakeRuntime, eye_size: [u32; 2]) -> Option<Headset> {
    let options = HeadsetOptions {
        eye_size: Some(eye_size),
        validation: true,
    };
    match Headset::open(&Runtime::of(fake.entry()), options) {
        Ok(headset) => Some(headset),
        Err(XrError::Render(RenderError::Vulkan(
            why @ (VulkanError::NoLoader(_) | VulkanError::NoDevice),
        ))) => {
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "no Vulkan device: {why}"
            );
            println!("skipped: no Vulkan device: {why}");
            None
        }
        Err(why) => panic!("a headset opens: {why}"),
    }
}

fn begun(headset: &Headset) -> Session {
    let options = SessionOptions {
        room: true,
        read_back: false,
        display_hz: None,
    };
    let mut session = Session::new(headset, options).expect("a session");
    session.poll().expect("polled");
    session
}

/// Waits for a frame and ends it without a picture.
fn frame(session: &mut Session) -> Frame {
    let frame = session.wait().expect("waited");
    session.locate_views(&frame).expect("looked");
    session.skip(frame).expect("ended");
    frame
}

fn everything() -> FakeRuntime {
    FakeRuntime::with_everything().with_vulkan()
}

#[test]
fn a_session_goes_from_made_to_exit_and_leaves_nothing_behind() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    assert!(session.lifecycle().is_running(), "begun when ready");
    let times: Vec<_> = (0..5)
        .map(|_| frame(&mut session).time.as_nanos())
        .collect();
    assert!(times.is_sorted_by(|a, b| a < b), "{times:?}");
    session.request_exit().expect("asked");
    let end = session.poll().expect("polled").end;
    assert_eq!(end, Some(SessionEnd::Exited), "left");
    assert_eq!(
        session.lifecycle().now(),
        SessionState::Exiting,
        "the last state"
    );
    assert_eq!(fake.calls("xrEndSession").len(), 1, "ended once");
    let messages = headset.gpu().validation_messages();
    drop((session, headset));
    for kind in [
        "session",
        "space",
        "swapchain",
        "hand tracker",
        "action",
        "instance",
    ] {
        assert_eq!(fake.alive(kind), 0, "{kind}s left");
    }
    assert_eq!(messages, 0, "validation");
}

#[test]
fn a_lost_runtime_is_a_loss_and_can_be_opened_again() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    frame(&mut session);
    fake.lose_instance();
    assert!(session.poll().expect_err("lost").is_loss(), "polling");
    assert!(session.wait().expect_err("lost").is_loss(), "waiting");
    drop((session, headset));
    let again = open(&fake).expect("the headset is back");
    let mut session = begun(&again);
    frame(&mut session);
    assert!(session.lifecycle().is_running(), "frames again");
}

#[test]
fn a_lost_session_is_a_loss_in_every_call() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    frame(&mut session);
    let waited = session.wait().expect("waited");
    fake.lose_session();
    assert!(
        session.locate_views(&waited).expect_err("lost").is_loss(),
        "looking"
    );
    assert!(
        session.controls(&waited).expect_err("lost").is_loss(),
        "hands"
    );
    assert!(session.skip(waited).expect_err("lost").is_loss(), "ending");
}

#[test]
fn an_announced_loss_is_reported_before_it_happens() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    fake.queue_state(XrSessionState::LOSS_PENDING);
    let end = session.poll().expect("polled").end;
    assert_eq!(end, Some(SessionEnd::Lost), "the session");
    let mut session = begun(&headset);
    fake.queue_instance_loss();
    let end = session.poll().expect("polled").end;
    assert_eq!(end, Some(SessionEnd::Lost), "the runtime");
}

#[test]
fn recentring_is_reported_once() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    fake.queue_recentre(ReferenceSpaceType::LOCAL_FLOOR, Time::from_nanos(1));
    assert!(session.poll().expect("polled").recentred, "recentred");
    assert!(!session.poll().expect("polled").recentred, "once");
}

#[test]
fn the_room_is_shown_while_the_session_is_seen() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    session.poll().expect("polled");
    let frames = |fake: &FakeRuntime| fake.set(|world| std::mem::take(&mut world.frames));
    frame(&mut session);
    let layers = frames(&fake)[0].layers.concat();
    assert!(layers.contains("PASSTHROUGH"), "seen: {layers}");
    fake.queue_state(XrSessionState::VISIBLE);
    fake.queue_state(XrSessionState::SYNCHRONIZED);
    session.poll().expect("polled");
    frame(&mut session);
    let layers = frames(&fake)[0].layers.concat();
    assert!(!layers.contains("PASSTHROUGH"), "hidden: {layers}");
}

#[test]
fn a_runtime_without_optional_extensions_runs_a_session() {
    let fake = FakeRuntime::new(&[REQUIRED]).with_vulkan();
    fake.set(|world| {
        world.reference_spaces = vec![ReferenceSpaceType::VIEW, ReferenceSpaceType::LOCAL];
        // R8G8B8A8_SRGB.
        world.formats = vec![43];
    });
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    frame(&mut session);
    assert_eq!(session.floor(), Floor::Assumed, "the floor");
    assert!(!session.takes_depth(), "depth");
    assert!(!session.shows_room(), "the room");
    assert_eq!(session.refresh_hz(), None, "the rate");
    let none = Tracks {
        hands: false,
        foveation_follows_gaze: false,
    };
    assert_eq!(session.tracks(), none, "hands and gaze");
    let missing = headset.extensions().missing();
    assert!(missing.contains(&"XR_FB_passthrough"), "{missing:?}");
}

#[test]
fn each_missing_extension_has_its_own_log_line() {
    type Is = fn(&XrError) -> bool;
    let cases: [(&str, sys::Result, Is, &str); 4] = [
        (
            "xrEnumerateInstanceExtensionProperties",
            sys::Result::ERROR_RUNTIME_UNAVAILABLE,
            |error| matches!(error, XrError::NoRuntime { .. }),
            "no OpenXR runtime is active",
        ),
        (
            "xrCreateInstance",
            sys::Result::ERROR_RUNTIME_FAILURE,
            |error| matches!(error, XrError::NoService { .. }),
            "does not answer",
        ),
        (
            "xrGetSystem",
            sys::Result::ERROR_FORM_FACTOR_UNAVAILABLE,
            |error| matches!(error, XrError::NoHeadset { .. }),
            "has no headset",
        ),
        (
            "xrGetVulkanGraphicsDevice2KHR",
            sys::Result::ERROR_RUNTIME_FAILURE,
            |error| matches!(error, XrError::HeadsetDevice { .. }),
            "failed to open Vulkan",
        ),
    ];
    for (call, result, is, line) in cases {
        let fake = everything();
        if open(&fake).is_none() {
            return;
        }
        fake.fail(call, result);
        let options = HeadsetOptions::default();
        let error = Headset::open(&Runtime::of(fake.entry()), options).expect_err("not there");
        assert!(is(&error), "{call}: {error:?}");
        assert!(error.to_string().contains(line), "{call}: {error}");
    }
}

#[test]
fn the_wearer_has_a_head_bare_hands_and_controllers_and_begins_anew_when_recentred() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    let wearer = |session: &mut Session| {
        let frame = session.wait().expect("waited");
        session.controls(&frame).expect("controls");
        session.locate_views(&frame).expect("looked");
        let wearer = session.wearer(&frame).expect("located");
        session.skip(frame).expect("ended");
        wearer
    };
    let floor_from_palm = Affine3A::from_translation(Vec3::new(-0.2, 1.1, -0.4));
    fake.set(|world| {
        world.head = posef(&Affine3A::from_translation(Vec3::new(0.1, 1.5, 0.2)));
        world.joints[0] = Some(hand(floor_from_palm, 0.06, 0.08));
    });
    let seen = wearer(&mut session);
    let head = seen.floor_from_view.expect("a head").translation;
    assert!(
        head.abs_diff_eq(glam::Vec3A::new(0.1, 1.5, 0.2), 1e-5),
        "{head}"
    );
    let joints = seen.hands[0].joints.expect("a bare hand");
    let palm = joints[0].expect("a palm");
    assert!(palm.abs_diff_eq(floor_from_palm, 1e-5), "{palm}");
    assert!(joints.iter().all(Option::is_some), "all joints");
    assert_eq!(seen.hands[1], Default::default(), "no right hand");
    let profile = "/interaction_profiles/khr/simple_controller";
    fake.hold_controllers(Some(profile));
    let grip = Affine3A::from_translation(Vec3::new(0.3, 1.2, -0.3));
    fake.put("/user/hand/right/input/grip/pose", posef(&grip));
    let right = wearer(&mut session).hands[1];
    let held = right.floor_from_grip.expect("a grip");
    assert!(held.abs_diff_eq(grip, 1e-5), "{held}");
    assert_eq!(right.joints, None, "fingers unknown");
    assert_eq!((seen.body, seen.face), (None, None), "not active");
    fake.set(|world| (world.watched.body_active, world.watched.face_valid) = (true, true));
    let seen = wearer(&mut session);
    assert!(seen.body.is_some() && seen.face.is_some(), "they are now");
}
