//! What hands, controllers and eyes do, once per frame.
//!
//! Controllers come first; a tracked hand is used where its controller is not active. What the hands do to people and panels
//! is not known here.

use std::fmt;

use glam::Affine3A;
use openxr::sys;
use openxr::{Action, ActionSet, Binding, Instance, Path, Posef, Session, Space, SystemId, Time};
use openxr::{ActionTy, Vulkan};

use super::error::{XrContext, XrError};
use super::ext::eye_gaze::{EyeGaze, GazeAction};
use super::ext::hand_tracking::{HandTracking, TrackedHand};
use super::ext::or_without;
use super::pose::base_from_space;

/// What hands and eyes do in one frame. Poses are in floor space: metres, y up, -z ahead.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Controls {
    /// Left, right.
    pub hands: [Hand; 2],
    /// The overlay's button was pressed, or the left thumb and middle finger met, since the last frame.
    pub overlay_toggled: bool,
    /// Between the eyes, -z as they look. None where it is not known.
    pub gaze: Option<Affine3A>,
}

/// What one hand does in one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Hand {
    /// Where it is and how it is turned. None where it is not known.
    pub floor_from_grip: Option<Affine3A>,
    /// What it points at lies along -z. None where it is not known.
    pub floor_from_aim: Option<Affine3A>,
    /// It holds: squeeze, select of a simple controller, or pinch.
    pub holds: bool,
}

/// A squeeze holds from here, of 1 ...
const SQUEEZE_HOLDS: f32 = 0.7;

/// ... and lets go below here.
const SQUEEZE_ENDS: f32 = 0.4;

const SIDES: [&str; 2] = [openxr::USER_HAND_LEFT, openxr::USER_HAND_RIGHT];

/// A profile's sources below a hand's path.
struct Profile {
    name: &'static str,
    hold: &'static str,
    /// On the left hand only; any of them.
    overlay: &'static [&'static str],
}

const PROFILES: [Profile; 2] = [
    Profile {
        name: "/interaction_profiles/khr/simple_controller",
        hold: "input/select/click",
        overlay: &["input/menu/click"],
    },
    Profile {
        name: "/interaction_profiles/oculus/touch_controller",
        hold: "input/squeeze/value",
        overlay: &["input/y/click", "input/menu/click"],
    },
];

/// The actions, attached to one session.
pub struct Input {
    session: Session<Vulkan>,
    actions: Actions,
    /// Left, right.
    sides: [Side; 2],
    hands: Option<HandTracking>,
    gaze: Option<EyeGaze>,
    overlay_was_pressed: bool,
}

struct Actions {
    set: ActionSet,
    grip: Action<Posef>,
    aim: Action<Posef>,
    hold: Action<f32>,
    overlay: Action<bool>,
}

struct Side {
    path: Path,
    grip: Space,
    aim: Space,
    holds: bool,
}

impl fmt::Debug for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Input")
            .field("hands", &self.hands.is_some())
            .field("gaze", &self.gaze.is_some())
            .finish_non_exhaustive()
    }
}

impl Input {
    /// Makes the actions and attaches them. Once per session, which must have no others.
    ///
    /// # Errors
    /// Where the runtime refuses something of its core. Hands, gaze and single profiles that it refuses are logged, and done without.
    pub fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, XrError> {
        let instance = session.instance();
        let mut paths = [Path::NULL; 2];
        for (path, side) in paths.iter_mut().zip(SIDES) {
            *path = instance.string_to_path(side).during("xrStringToPath")?;
        }
        let actions = Actions::new(instance, &paths)?;
        for profile in &PROFILES {
            actions.suggest(instance, profile);
        }
        let gaze = or_without("gaze", GazeAction::new(instance, system, &actions.set));
        session
            .attach_action_sets(&[&actions.set])
            .during("xrAttachSessionActionSets")?;
        let gaze = gaze.and_then(|gaze| or_without("gaze", gaze.attached(session)));
        let side = |path| -> Result<Side, XrError> {
            let space = |action: &Action<Posef>| {
                action
                    .create_space(session, path, Posef::IDENTITY)
                    .during("xrCreateActionSpace")
            };
            Ok(Side {
                path,
                grip: space(&actions.grip)?,
                aim: space(&actions.aim)?,
                holds: false,
            })
        };
        let sides = [side(paths[0])?, side(paths[1])?];
        Ok(Self {
            session: session.clone(),
            sides,
            hands: or_without("bare hands", HandTracking::new(session, system)),
            gaze,
            overlay_was_pressed: false,
            actions,
        })
    }

    /// Whether bare hands are tracked.
    #[must_use]
    pub fn tracks_hands(&self) -> bool {
        self.hands.is_some()
    }

    /// Whether the gaze is tracked.
    #[must_use]
    pub fn tracks_gaze(&self) -> bool {
        self.gaze.is_some()
    }

    /// What hands and eyes do at a frame's predicted display time. Nothing while another program has the input.
    ///
    /// # Errors
    /// What the runtime says: a session or a runtime that is lost.
    pub fn sync(&mut self, time: Time, floor: &Space) -> Result<Controls, XrError> {
        if !self.actions.sync(&self.session)? {
            for side in &mut self.sides {
                side.holds = false;
            }
            return Ok(Controls::default());
        }
        let tracked = match &mut self.hands {
            Some(hands) => hands.locate(floor, time).during("xrLocateHandJointsEXT")?,
            None => [None; 2],
        };
        let mut hands = [Hand::default(); 2];
        let mut calls_overlay = [false; 2];
        for (place, side) in self.sides.iter_mut().enumerate() {
            let controller = side.read(&self.session, &self.actions, floor, time)?;
            // Some runtimes track the hand that holds a controller too: its fingers mean nothing.
            let bare = tracked[place].filter(|_| controller.is_none());
            calls_overlay[place] = bare.is_some_and(|hand| hand.calls_overlay);
            hands[place] = controller.or(bare.map(Hand::from)).unwrap_or_default();
        }
        let button = self
            .actions
            .overlay
            .state(&self.session, Path::NULL)
            .during("xrGetActionStateBoolean")?;
        let pressed = (button.is_active && button.current_state) || calls_overlay[0];
        let was_pressed = std::mem::replace(&mut self.overlay_was_pressed, pressed);
        let gaze = match &self.gaze {
            Some(gaze) => gaze.floor_from_gaze(floor, time).during("xrLocateSpace")?,
            None => None,
        };
        Ok(Controls {
            hands,
            overlay_toggled: pressed && !was_pressed,
            gaze,
        })
    }
}

impl Actions {
    fn new(instance: &Instance, hands: &[Path]) -> Result<Self, XrError> {
        let set = instance
            .create_action_set("presence", "Presence", 0)
            .during("xrCreateActionSet")?;
        Ok(Self {
            grip: action(&set, "grip", "Hand", hands)?,
            aim: action(&set, "aim", "Pointing", hands)?,
            hold: action(&set, "hold", "Hold", hands)?,
            overlay: action(&set, "overlay", "Show figures", &[])?,
            set,
        })
    }

    /// A runtime that refuses a profile knows another.
    fn suggest(&self, instance: &Instance, profile: &Profile) {
        let suggest = || -> openxr::Result<()> {
            let path =
                |side: &str, source: &str| instance.string_to_path(&format!("{side}/{source}"));
            let mut bindings = Vec::new();
            for side in SIDES {
                bindings.push(Binding::new(&self.grip, path(side, "input/grip/pose")?));
                bindings.push(Binding::new(&self.aim, path(side, "input/aim/pose")?));
                bindings.push(Binding::new(&self.hold, path(side, profile.hold)?));
            }
            for source in profile.overlay {
                bindings.push(Binding::new(&self.overlay, path(SIDES[0], source)?));
            }
            let name = instance.string_to_path(profile.name)?;
            instance.suggest_interaction_profile_bindings(name, &bindings)
        };
        if let Err(why) = suggest() {
            log::debug!("the runtime refuses {}: {why}", profile.name);
        }
    }

    /// Brings the actions up to date. False while the session is not focused. Raw, because the wrapper drops that.
    fn sync(&self, session: &Session<Vulkan>) -> Result<bool, XrError> {
        let active = sys::ActiveActionSet {
            action_set: self.set.as_raw(),
            subaction_path: Path::NULL,
        };
        let info = sys::ActionsSyncInfo {
            ty: sys::ActionsSyncInfo::TYPE,
            next: std::ptr::null(),
            count_active_action_sets: 1,
            active_action_sets: &active,
        };
        // SAFETY: the session and the set are alive, and `info` is whole.
        let result = unsafe { (session.instance().fp().sync_actions)(session.as_raw(), &info) };
        let code = super::ext::outcome(result).during("xrSyncActions")?;
        Ok(code != sys::Result::SESSION_NOT_FOCUSED)
    }
}

fn action<T: ActionTy>(
    set: &ActionSet,
    name: &str,
    shown: &str,
    hands: &[Path],
) -> Result<Action<T>, XrError> {
    set.create_action(name, shown, hands)
        .during("xrCreateAction")
}

impl Side {
    /// What this hand's controller does; None where there is none.
    fn read(
        &mut self,
        session: &Session<Vulkan>,
        actions: &Actions,
        floor: &Space,
        time: Time,
    ) -> Result<Option<Hand>, XrError> {
        let there = actions
            .grip
            .is_active(session, self.path)
            .during("xrGetActionStatePose")?;
        let squeeze = actions
            .hold
            .state(session, self.path)
            .during("xrGetActionStateFloat")?;
        let limit = if self.holds {
            SQUEEZE_ENDS
        } else {
            SQUEEZE_HOLDS
        };
        self.holds = there && squeeze.is_active && squeeze.current_state >= limit;
        if !there {
            return Ok(None);
        }
        let place = |space| base_from_space(floor, space, time).during("xrLocateSpace");
        Ok(Some(Hand {
            floor_from_grip: place(&self.grip)?,
            floor_from_aim: place(&self.aim)?,
            holds: self.holds,
        }))
    }
}

impl From<TrackedHand> for Hand {
    fn from(hand: TrackedHand) -> Self {
        Self {
            floor_from_grip: Some(hand.floor_from_grip),
            floor_from_aim: hand.floor_from_aim,
            holds: hand.pinches,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xr::ext::Absent;
    use crate::xr::fake::{FakeRuntime, REQUIRED, hand, posef};
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
    fn controllers_say_where_they_are_and_nothing_where_there_are_none() {
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
    fn the_select_button_of_a_simple_controller_holds() {
        let mut scene = Scene::with(SIMPLE);
        assert_eq!(scene.holds(), [false, false], "at first");
        scene.press("/user/hand/right/input/select/click", 1.0);
        assert_eq!(scene.holds(), [false, true], "pressed");
        scene.press("/user/hand/right/input/select/click", 0.0);
        assert_eq!(scene.holds(), [false, false], "let go");
    }

    #[test]
    fn a_squeeze_holds_when_firm_and_lets_go_when_loose() {
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
    fn a_controller_that_goes_lets_go() {
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
    fn the_overlay_is_toggled_once_for_each_press() {
        for (profile, button) in [
            (SIMPLE, "menu/click"),
            (TOUCH, "menu/click"),
            (TOUCH, "y/click"),
        ] {
            let mut scene = Scene::with(profile);
            let button = format!("/user/hand/left/input/{button}");
            let mut toggled = Vec::new();
            for value in [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
                scene.press(&button, value);
                toggled.push(scene.sync().overlay_toggled);
            }
            let expected = [false, true, false, false, false, true, false];
            assert_eq!(toggled, expected, "{button} of {profile}");
        }
    }

    #[test]
    fn a_tracked_hand_stands_in_for_a_controller_that_is_not_there() {
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
    fn the_left_hands_middle_finger_toggles_the_overlay_and_the_rights_does_not() {
        for (side, toggles) in [(0, true), (1, false)] {
            let mut scene = Scene::new();
            let mut with = |middle| {
                let joints = Some(hand(at(0.0), 0.06, middle));
                scene.fake.set(|world| world.joints[side] = joints);
                scene.sync().overlay_toggled
            };
            let toggled = [with(0.08), with(0.01), with(0.01), with(0.08), with(0.01)];
            let expected = [false, toggles, false, false, toggles];
            assert_eq!(toggled, expected, "hand {side}");
        }
    }

    #[test]
    fn the_fingers_of_a_hand_that_holds_a_controller_mean_nothing() {
        let mut scene = Scene::with(TOUCH);
        let joints = Some(hand(at(0.0), 0.06, 0.01));
        scene.fake.set(|world| world.joints[0] = joints);
        assert!(!scene.sync().overlay_toggled, "around the controller");
        scene.fake.hold_controllers(None);
        assert!(scene.sync().overlay_toggled, "bare");
    }

    #[test]
    fn the_gaze_is_there_while_the_eyes_are_tracked() {
        let mut scene = Scene::new();
        assert_eq!(scene.sync().gaze, None, "eyes are shut");
        let source = "/user/eyes_ext/input/gaze_ext/pose";
        scene.fake.put(source, posef(&at(0.03)));
        let gaze = scene.sync().gaze.expect("eyes are open");
        assert!(gaze.abs_diff_eq(at(0.03), 1e-6), "{gaze}");
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

    #[test]
    fn a_gaze_that_the_runtime_refuses_leaves_the_hands() {
        for call in [
            "xrSuggestInteractionProfileBindings",
            "xrGetSystemProperties",
        ] {
            let fake = FakeRuntime::with_everything();
            fake.fail(call, XrResult::ERROR_FEATURE_UNSUPPORTED);
            let (session, _, _) = fake.session(&fake.instance());
            let input = Input::new(&session, fake.system()).expect("the hands");
            assert!(!input.tracks_gaze(), "where {call} fails");
        }
    }

    #[test]
    fn eyes_that_the_headset_does_not_track_are_told_from_a_runtime_that_cannot() {
        let fake = FakeRuntime::with_everything();
        fake.set(|world| world.system.eye_gaze = false);
        let instance = fake.instance();
        let set = instance
            .create_action_set("test", "Test", 0)
            .expect("a set");
        let why = GazeAction::new(&instance, fake.system(), &set).err();
        let extension = "XR_EXT_eye_gaze_interaction";
        assert_eq!(why, Some(Absent::NotBySystem(extension)), "the headset");
        let fake = FakeRuntime::new(&[REQUIRED]);
        let why = GazeAction::new(&fake.instance(), fake.system(), &set).err();
        assert_eq!(why, Some(Absent::NotGranted(extension)), "the runtime");
    }
}
