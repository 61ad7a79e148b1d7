//! The state of hands and controllers, once per frame.
//!
//! Controllers come first; a tracked hand is used where its controller is not active. What they do to people and panels
//! is not known here.

use std::fmt;
use std::time::Instant;

use glam::Affine3A;
use openxr::sys;
use openxr::{Action, ActionSet, Binding, Instance, Path, Posef, Session, Space, SystemId, Time};
use openxr::{ActionTy, Vulkan};

use crate::error::{XrContext, XrError};
use crate::ext::gaze_interaction::GazeInteraction;
use crate::ext::hand_tracking::{HandTracking, TrackedHand};
use crate::ext::or_without;
use crate::pose::base_from_space;
use crate::wearer::WearerHand;

/// The state of both hands in one frame. Poses are in floor space: metres, y up, -z ahead.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Controls {
    /// Left, right.
    pub hands: [Hand; 2],
    /// The overlay's button was pressed, or the left thumb and middle finger met, since the last frame.
    pub overlay_toggled: bool,
    /// The button that mutes was pressed, or the right thumb and middle finger met, since the last frame.
    pub mute_toggled: bool,
    /// The button that hides was pressed since the last frame. Bare hands have none.
    pub hide_toggled: bool,
}

/// The state of one hand in one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Hand {
    /// Where it is and how it is turned. None where it is not known.
    pub floor_from_grip: Option<Affine3A>,
    /// What it points at lies along -z. None where it is not known.
    pub floor_from_aim: Option<Affine3A>,
    /// It grabs: squeeze, select of a simple controller, or pinch.
    pub holds: bool,
}

/// A squeeze grabs from this value on, of 1 ...
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
    /// On the right hand only.
    mute: &'static [&'static str],
    hide: &'static [&'static str],
}

const PROFILES: [Profile; 2] = [
    Profile {
        name: "/interaction_profiles/khr/simple_controller",
        hold: "input/select/click",
        overlay: &["input/menu/click"],
        mute: &["input/menu/click"],
        hide: &[],
    },
    Profile {
        name: "/interaction_profiles/oculus/touch_controller",
        hold: "input/squeeze/value",
        overlay: &["input/y/click", "input/menu/click"],
        mute: &["input/a/click"],
        hide: &["input/b/click"],
    },
];

/// The actions, attached to one session.
pub struct Input {
    session: Session<Vulkan>,
    actions: Actions,
    /// Left, right.
    sides: [Side; 2],
    hands: Option<HandTracking>,
    gaze: Option<GazeInteraction>,
}

/// A button, which counts when it goes down.
struct Button {
    action: Action<bool>,
    was_pressed: bool,
}

impl Button {
    fn new(set: &ActionSet, name: &str, shown: &str) -> Result<Self, XrError> {
        Ok(Self {
            action: action(set, name, shown, &[])?,
            was_pressed: false,
        })
    }

    /// Whether it, or the fingers that stand for it, went down since it was asked last.
    fn goes_down(&mut self, session: &Session<Vulkan>, fingers: bool) -> Result<bool, XrError> {
        let state = self.action.state(session, Path::NULL);
        let state = state.during("xrGetActionStateBoolean")?;
        let pressed = (state.is_active && state.current_state) || fingers;
        let was_pressed = std::mem::replace(&mut self.was_pressed, pressed);
        Ok(pressed && !was_pressed)
    }
}

struct Actions {
    set: ActionSet,
    grip: Action<Posef>,
    aim: Action<Posef>,
    hold: Action<f32>,
    overlay: Button,
    mute: Button,
    hide: Button,
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
            .finish_non_exhaustive()
    }
}

impl Input {
    /// Makes the actions and attaches them. Once per session, which must have no others.
    ///
    /// # Errors
    /// Where the runtime refuses something of its core. Bare hands and single profiles that it refuses are logged, and left out.
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
        let gaze = or_without("a gaze", GazeInteraction::new(session, system));
        let sets: Vec<_> = [&actions.set]
            .into_iter()
            .chain(gaze.as_ref().map(GazeInteraction::set))
            .collect();
        session
            .attach_action_sets(&sets)
            .during("xrAttachSessionActionSets")?;
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
            actions,
        })
    }

    /// Whether bare hands are tracked.
    #[must_use]
    pub fn tracks_hands(&self) -> bool {
        self.hands.is_some()
    }

    /// The state of the hands at a frame's predicted display time; nothing while another program has the input.
    ///
    /// # Errors
    /// What the runtime says: a session or a runtime that is lost.
    pub fn sync(&mut self, time: Time, floor: &Space) -> Result<Controls, XrError> {
        let gaze = self.gaze.as_ref().filter(|gaze| gaze.is_wanted());
        if !(self.actions).sync(&self.session, gaze.map(GazeInteraction::set))? {
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
        let mut middle_fingers = [false; 2];
        for (place, side) in self.sides.iter_mut().enumerate() {
            let controller = side.read(&self.session, &self.actions, floor, time)?;
            // Some runtimes track the hand that holds a controller too: its fingers are ignored.
            let bare = tracked[place].filter(|_| controller.is_none());
            middle_fingers[place] = bare.is_some_and(|hand| hand.touches_middle);
            hands[place] = controller.or(bare.map(Hand::from)).unwrap_or_default();
        }
        let (session, actions) = (&self.session, &mut self.actions);
        Ok(Controls {
            hands,
            overlay_toggled: actions.overlay.goes_down(session, middle_fingers[0])?,
            mute_toggled: actions.mute.goes_down(session, middle_fingers[1])?,
            hide_toggled: actions.hide.goes_down(session, false)?,
        })
    }

    /// The wearer's own hands at a time: joints of bare ones, grips of controllers as of the last [`Self::sync`].
    ///
    /// # Errors
    /// What the runtime says.
    pub(crate) fn wearer(&self, time: Time, floor: &Space) -> Result<[WearerHand; 2], XrError> {
        let joints = match &self.hands {
            Some(hands) => hands.joints(floor, time).during("xrLocateHandJointsEXT")?,
            None => [None; 2],
        };
        let mut hands = joints.map(|joints| WearerHand {
            joints,
            floor_from_grip: None,
        });
        for (hand, side) in hands.iter_mut().zip(&self.sides) {
            hand.floor_from_grip =
                base_from_space(floor, &side.grip, time).during("xrLocateSpace")?;
        }
        Ok(hands)
    }

    /// Where the wearer looks, for headsets that tell it as input: between the eyes, -z ahead. Known from the second time on that it is
    /// asked for, after the [`Self::sync`] between them.
    pub(crate) fn gaze(&mut self, floor: &Space, (at, time): (Instant, Time)) -> Option<Affine3A> {
        self.gaze.as_mut()?.locate(floor, at, time)
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
            overlay: Button::new(&set, "overlay", "Show figures")?,
            mute: Button::new(&set, "mute", "Mute yourself")?,
            hide: Button::new(&set, "hide", "Hide yourself")?,
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
            for (button, side, sources) in [
                (&self.overlay, SIDES[0], profile.overlay),
                (&self.mute, SIDES[1], profile.mute),
                (&self.hide, SIDES[1], profile.hide),
            ] {
                for source in sources {
                    bindings.push(Binding::new(&button.action, path(side, source)?));
                }
            }
            let name = instance.string_to_path(profile.name)?;
            instance.suggest_interaction_profile_bindings(name, &bindings)
        };
        if let Err(why) = suggest() {
            log::debug!("the runtime refuses {}: {why}", profile.name);
        }
    }

    /// Brings the actions up to date, and those of `another` set. False while the session is not focused. Raw, because the wrapper drops that.
    fn sync(
        &self,
        session: &Session<Vulkan>,
        another: Option<&ActionSet>,
    ) -> Result<bool, XrError> {
        let active = [Some(&self.set), another].map(|set| sys::ActiveActionSet {
            action_set: set.unwrap_or(&self.set).as_raw(),
            subaction_path: Path::NULL,
        });
        let info = sys::ActionsSyncInfo {
            ty: sys::ActionsSyncInfo::TYPE,
            next: std::ptr::null(),
            count_active_action_sets: if another.is_some() { 2 } else { 1 },
            active_action_sets: active.as_ptr(),
        };
        // SAFETY: the session and the sets are alive, and `info` is whole.
        let result = unsafe { (session.instance().fp().sync_actions)(session.as_raw(), &info) };
        let code = crate::ext::outcome(result).during("xrSyncActions")?;
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
    /// The state of this hand's controller; None where there is none.
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
mod tests;
