use super::*;
use crate::fake::{FakeRuntime, REQUIRED, hand, posef};
use glam::Vec3;
use openxr::ReferenceSpaceType;
use openxr::sys::Result as XrResult;

const SIMPLE: &str = PROFILES[0].name;
const TOUCH: &str = PROFILES[1].name;

struct Scene {
    input: Input,
    floor: Space,
    fake: FakeRuntime,
}

impl Scene {
    fn of(fake: FakeRuntime) -> Self {
        let (session, _, _) = fake.session(&fake.instance());
        Self {
            input: Input::new(&session, fake.system()).expect("input"),
            floor: session
                .create_reference_space(ReferenceSpaceType::LOCAL_FLOOR, Posef::IDENTITY)
                .expect("a space"),
            fake,
        }
    }

    fn new() -> Self {
        Self::of(FakeRuntime::with_everything())
    }

    /// Controllers of this profile in both hands, the left one at the left.
    fn with(profile: &'static str) -> Self {
        let scene = Self::new();
        scene.fake.hold_controllers(Some(profile));
        for (side, x) in SIDES.iter().zip([-0.2, 0.2]) {
            let pose = posef(&at(x));
            scene.fake.put(&format!("{side}/input/grip/pose"), pose);
            scene.fake.put(&format!("{side}/input/aim/pose"), pose);
        }
        scene
    }

    fn sync(&mut self) -> Controls {
        let time = Time::from_nanos(1);
        self.input.sync(time, &self.floor).expect("synchronised")
    }

    fn holds(&mut self) -> [bool; 2] {
        self.sync().hands.map(|hand| hand.holds)
    }

    fn press(&self, source: &str, value: f32) {
        self.fake.press(source, value);
    }
}

fn at(x: f32) -> Affine3A {
    Affine3A::from_translation(Vec3::new(x, 1.2, -0.4))
}

#[test]
fn controllers_have_poses_and_missing_ones_have_none() {
    for profile in [SIMPLE, TOUCH] {
        let controls = Scene::with(profile).sync();
        for (hand, x) in controls.hands.iter().zip([-0.2, 0.2]) {
            for pose in [hand.floor_from_grip, hand.floor_from_aim] {
                let pose = pose.expect("it is known");
                assert!(pose.abs_diff_eq(at(x), 1e-6), "{profile}: {pose}");
            }
        }
    }
    assert_eq!(Scene::new().sync(), Controls::default(), "empty hands");
}

#[test]
fn the_select_button_of_a_simple_controller_grabs() {
    let mut scene = Scene::with(SIMPLE);
    assert_eq!(scene.holds(), [false, false], "at first");
    scene.press("/user/hand/right/input/select/click", 1.0);
    assert_eq!(scene.holds(), [false, true], "pressed");
    scene.press("/user/hand/right/input/select/click", 0.0);
    assert_eq!(scene.holds(), [false, false], "let go");
}

#[test]
fn a_firm_squeeze_grabs_and_a_loose_one_lets_go() {
    let mut scene = Scene::with(TOUCH);
    let mut squeezed = |value| {
        scene.press("/user/hand/left/input/squeeze/value", value);
        scene.holds()[0]
    };
    assert!(!squeezed(0.6), "not firm yet");
    assert!(squeezed(0.8), "firm");
    assert!(squeezed(0.5), "looser");
    assert!(!squeezed(0.3), "loose");
    assert!(!squeezed(0.5), "firmer");
}

#[test]
fn a_controller_that_disappears_lets_go() {
    let mut scene = Scene::with(TOUCH);
    scene.press("/user/hand/left/input/squeeze/value", 0.8);
    assert!(scene.holds()[0], "held");
    scene.fake.hold_controllers(None);
    assert!(!scene.holds()[0], "put down");
    scene.press("/user/hand/left/input/squeeze/value", 0.5);
    scene.fake.hold_controllers(Some(TOUCH));
    assert!(!scene.holds()[0], "taken up, half squeezed");
}

#[test]
fn each_button_does_its_own_once_for_each_press() {
    for (profile, button, what) in [
        (SIMPLE, "left/input/menu/click", 0),
        (SIMPLE, "right/input/menu/click", 1),
        (TOUCH, "left/input/menu/click", 0),
        (TOUCH, "left/input/y/click", 0),
        (TOUCH, "right/input/a/click", 1),
        (TOUCH, "right/input/b/click", 2),
    ] {
        let mut scene = Scene::with(profile);
        let mut toggled = Vec::new();
        for value in [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
            scene.press(&format!("/user/hand/{button}"), value);
            let now = scene.sync();
            toggled.push([now.overlay_toggled, now.mute_toggled, now.hide_toggled]);
        }
        let expected = [false, true, false, false, false, true, false]
            .map(|pressed| std::array::from_fn(|it| pressed && it == what));
        assert_eq!(toggled, expected, "{button} of {profile}");
    }
}

#[test]
fn a_tracked_hand_replaces_a_missing_controller() {
    let mut scene = Scene::with(TOUCH);
    for side in [0, 1] {
        let pinched = Some(hand(at(0.0), 0.01, 0.08));
        scene.fake.set(|world| world.joints[side] = pinched);
    }
    // The left controller lies on the table.
    scene.fake.set(|world| {
        world
            .sources
            .retain(|source, _| !source.starts_with(SIDES[0]));
    });
    let [left, right] = scene.sync().hands;
    let grip = left.floor_from_grip.expect("the bare hand");
    assert!(grip.abs_diff_eq(at(0.0), 1e-5), "{grip}");
    assert!(left.holds && left.floor_from_aim.is_some(), "it pinches");
    let grip = right.floor_from_grip.expect("the controller");
    assert!(grip.abs_diff_eq(at(0.2), 1e-5), "{grip}");
    assert!(!right.holds, "its squeeze counts, not the fingers");
}

#[test]
fn the_left_hands_middle_finger_calls_the_overlay_and_the_rights_mutes() {
    for side in [0, 1] {
        let mut scene = Scene::new();
        let mut with = |middle| {
            let joints = Some(hand(at(0.0), 0.06, middle));
            scene.fake.set(|world| world.joints[side] = joints);
            let now = scene.sync();
            [now.overlay_toggled, now.mute_toggled]
        };
        let toggled = [with(0.08), with(0.01), with(0.01), with(0.08), with(0.01)];
        let expected = [false, true, false, false, true]
            .map(|met| std::array::from_fn(|it| met && it == side));
        assert_eq!(toggled, expected, "hand {side}");
    }
}

#[test]
fn the_fingers_of_a_hand_that_holds_a_controller_are_ignored() {
    let mut scene = Scene::with(TOUCH);
    let joints = Some(hand(at(0.0), 0.06, 0.01));
    scene.fake.set(|world| world.joints[0] = joints);
    assert!(!scene.sync().overlay_toggled, "around the controller");
    scene.fake.hold_controllers(None);
    assert!(scene.sync().overlay_toggled, "bare");
}

#[test]
fn while_another_program_has_the_input_there_is_none() {
    let mut scene = Scene::with(TOUCH);
    scene.press("/user/hand/left/input/squeeze/value", 1.0);
    let joints = Some(hand(at(0.0), 0.01, 0.08));
    scene.fake.set(|world| world.joints = [joints; 2]);
    assert!(scene.holds()[0], "ours");
    scene
        .fake
        .fail_times("xrSyncActions", XrResult::SESSION_NOT_FOCUSED, 1);
    assert_eq!(scene.sync(), Controls::default(), "another's");
    assert!(scene.holds()[0], "ours again");
}

#[test]
fn a_session_that_is_lost_is_an_error_that_says_so() {
    let mut scene = Scene::with(TOUCH);
    scene.fake.lose_session();
    let error = scene.input.sync(Time::from_nanos(1), &scene.floor);
    assert!(error.expect_err("lost").is_loss(), "to be opened again");
}

#[test]
fn a_profile_that_the_runtime_refuses_leaves_the_other() {
    for (refused, left, button) in [
        (SIMPLE, TOUCH, "squeeze/value"),
        (TOUCH, SIMPLE, "select/click"),
    ] {
        let fake = FakeRuntime::new(&[REQUIRED]);
        fake.set(|world| world.refused_profiles.push(refused));
        let mut scene = Scene::of(fake);
        scene.fake.hold_controllers(Some(left));
        let side = SIDES[1];
        scene
            .fake
            .put(&format!("{side}/input/grip/pose"), posef(&at(0.2)));
        scene.press(&format!("{side}/input/{button}"), 1.0);
        assert_eq!(scene.holds(), [false, true], "without {refused}");
    }
}

#[test]
fn a_runtime_that_refuses_actions_is_an_error_that_names_the_call() {
    for call in ["xrCreateActionSet", "xrAttachSessionActionSets"] {
        let fake = FakeRuntime::new(&[REQUIRED]);
        fake.fail(call, XrResult::ERROR_LIMIT_REACHED);
        let (session, _, _) = fake.session(&fake.instance());
        let error = Input::new(&session, fake.system()).expect_err("refused");
        assert!(error.to_string().contains(call), "{error}");
    }
}

const GAZE: &str = "/user/eyes_ext/input/gaze_ext/pose";

impl Scene {
    fn gaze(&mut self) -> Option<Affine3A> {
        self.sync();
        let now = (Instant::now(), Time::from_nanos(1));
        self.input.gaze(&self.floor, now)
    }
}

#[test]
fn eyes_are_followed_from_when_somebody_asks() {
    let mut scene = Scene::new();
    scene.fake.put(GAZE, posef(&at(0.01)));
    scene.sync();
    scene.gaze();
    assert_eq!(scene.fake.calls("xrSyncActions"), ["1", "1"], "hands only");
    let gaze = scene.gaze().expect("it is known");
    assert!(gaze.abs_diff_eq(at(0.01), 1e-6), "{gaze}");
    let synced = scene.fake.calls("xrSyncActions");
    assert_eq!(synced.last().map(String::as_str), Some("2"), "eyes too");
    scene.fake.put(GAZE, {
        let mut nowhere = posef(&at(0.0));
        nowhere.position.x = f32::NAN;
        nowhere
    });
    assert_eq!(scene.gaze(), None, "no number");
    scene.fake.set(|world| world.sources.remove(GAZE));
    assert_eq!(scene.gaze(), None, "not tracked");
}

#[test]
fn without_a_gaze_or_with_one_that_is_refused_hands_work_on() {
    const PROFILE: &str = "/interaction_profiles/ext/eye_gaze_interaction";
    let changes: [fn(&mut crate::fake::World); 3] = [
        |world| {
            world
                .extensions
                .retain(|name| *name != "XR_EXT_eye_gaze_interaction");
        },
        |world| world.system.eye_gaze = false,
        |world| world.refused_profiles.push(PROFILE),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let fake = FakeRuntime::with_everything();
        fake.set(change);
        let mut scene = Scene::of(fake);
        scene.fake.put(GAZE, posef(&at(0.01)));
        scene.fake.hold_controllers(Some(SIMPLE));
        let grip = "/user/hand/right/input/grip/pose";
        scene.fake.put(grip, posef(&at(0.2)));
        for _ in 0..2 {
            assert_eq!(scene.gaze(), None, "way {number}");
        }
        let hand = scene.sync().hands[1];
        assert!(hand.floor_from_grip.is_some(), "way {number}: a hand");
    }
    for call in ["xrCreateActionSpace", "xrLocateSpace"] {
        let mut scene = Scene::new();
        scene.fake.put(GAZE, posef(&at(0.01)));
        scene.fake.fail(call, XrResult::ERROR_RUNTIME_FAILURE);
        assert_eq!(scene.gaze(), None, "where {call} fails");
    }
}
