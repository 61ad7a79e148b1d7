//! The stand-in follows the specification where our tests rely on it.

use openxr::sys::Result as XrResult;
use openxr::{
    EnvironmentBlendMode, Event, EventDataBuffer, Instance, Posef, ReferenceSpaceType,
    SessionState, ViewConfigurationType,
};

use super::{FakeRuntime, REQUIRED};

const STEREO: ViewConfigurationType = ViewConfigurationType::PRIMARY_STEREO;

fn states(instance: &Instance) -> Vec<SessionState> {
    let mut buffer = EventDataBuffer::new();
    let mut states = Vec::new();
    while let Some(event) = instance.poll_event(&mut buffer).expect("polled") {
        if let Event::SessionStateChanged(change) = event {
            states.push(change.state());
        }
    }
    states
}

#[test]
fn a_session_passes_its_states_and_shows_frames() {
    let fake = FakeRuntime::new(&[REQUIRED]);
    let instance = fake.instance();
    let (session, mut waiter, mut stream) = fake.session(&instance);
    use SessionState as S;
    assert_eq!(states(&instance), [S::IDLE, S::READY], "made");
    session.begin(STEREO).expect("begun");
    assert_eq!(
        states(&instance),
        [S::SYNCHRONIZED, S::VISIBLE, S::FOCUSED],
        "begun"
    );
    let mut last = 0;
    for _ in 0..3 {
        let frame = waiter.wait().expect("waited");
        let time = frame.predicted_display_time;
        assert!(time.as_nanos() > last, "predicted times rise");
        last = time.as_nanos();
        stream.begin().expect("begun");
        stream
            .end(time, EnvironmentBlendMode::OPAQUE, &[])
            .expect("ended");
    }
    assert_eq!(fake.set(|world| world.frames.len()), 3, "frames");
    session.request_exit().expect("asked");
    assert_eq!(
        states(&instance),
        [S::VISIBLE, S::SYNCHRONIZED, S::STOPPING],
        "asked to exit"
    );
    session.end().expect("ended");
    assert_eq!(states(&instance), [S::IDLE, S::EXITING], "ended");
}

#[test]
fn calls_in_the_wrong_order_are_refused() {
    let fake = FakeRuntime::new(&[REQUIRED]);
    let instance = fake.instance();
    let (session, mut waiter, mut stream) = fake.session(&instance);
    let error = waiter.wait().expect_err("not begun");
    assert_eq!(error, XrResult::ERROR_SESSION_NOT_RUNNING, "waiting");
    session.begin(STEREO).expect("begun");
    let error = session.begin(STEREO).expect_err("twice");
    assert_eq!(error, XrResult::ERROR_SESSION_RUNNING, "beginning");
    let error = stream.begin().expect_err("not waited");
    assert_eq!(error, XrResult::ERROR_CALL_ORDER_INVALID, "a frame");
    let error = session.end().expect_err("not stopping");
    assert_eq!(error, XrResult::ERROR_SESSION_NOT_STOPPING, "ending");
}

#[test]
fn a_lost_instance_or_session_stays_lost_until_it_is_made_again() {
    let fake = FakeRuntime::new(&[REQUIRED]);
    let instance = fake.instance();
    let (session, _, _) = fake.session(&instance);
    fake.lose_session();
    let error = session.begin(STEREO).expect_err("lost");
    assert_eq!(error, XrResult::ERROR_SESSION_LOST, "the session");
    instance.properties().expect("the instance is there");
    fake.session(&instance).0.begin(STEREO).expect("a new one");
    fake.lose_instance();
    let error = instance.properties().expect_err("lost");
    assert_eq!(error, XrResult::ERROR_INSTANCE_LOST, "the instance");
    fake.instance().properties().expect("a new one");
    drop((session, instance));
    assert_eq!(fake.alive("instance"), 0, "all can be let go");
}

#[test]
fn poses_are_relative_to_the_base_space() {
    let fake = FakeRuntime::new(&[REQUIRED]);
    let (session, _, _) = fake.session(&fake.instance());
    let space = |kind| {
        session
            .create_reference_space(kind, Posef::IDENTITY)
            .expect("a space")
    };
    let (head, local) = (
        space(ReferenceSpaceType::VIEW),
        space(ReferenceSpaceType::LOCAL),
    );
    let floor = space(ReferenceSpaceType::STAGE);
    let time = openxr::Time::from_nanos(1);
    let above = |base| head.locate(base, time).expect("located").pose.position.y;
    assert!((above(&floor) - 1.6).abs() < 1e-6, "of the floor");
    assert!(above(&local).abs() < 1e-6, "of where it was at first");
    let (_, views) = session.locate_views(STEREO, time, &head).expect("two eyes");
    let apart = views[1].pose.position.x - views[0].pose.position.x;
    assert!((apart - 0.064).abs() < 1e-6, "eyes are {apart} m apart");
}

#[test]
fn runtimes_side_by_side_are_independent() {
    let one = FakeRuntime::new(&[REQUIRED]);
    let of_one = one.instance();
    let other = FakeRuntime::new(&[REQUIRED]);
    let of_other = other.instance();
    one.lose_instance();
    of_one.properties().expect_err("lost");
    of_other.properties().expect("there");
    let elsewhere = std::thread::spawn(move || of_other.properties().is_ok());
    assert!(elsewhere.join().expect("joined"), "from another thread");
}
