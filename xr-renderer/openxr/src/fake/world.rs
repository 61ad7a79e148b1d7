//! The runtime's state: its headset, the objects made with it, and the calls so far.

use std::collections::{BTreeMap, HashMap, VecDeque};

use ash::vk;
use glam::Affine3A;
use openxr::sys::{self, Handle, Result as XrResult};
use openxr::{
    EnvironmentBlendMode, Fovf, HandJointLocation, Posef, ReferenceSpaceType, SessionState,
    SwapchainUsageFlags,
};

use super::device::{Images, Loader, SessionDevice};
use super::lenses::Lens;
use super::pointers;
use super::watched::Watched;
use crate::pose::rigid;

/// The state of a source of input. A missing one is not active.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Source {
    /// Of a button, trigger or squeeze.
    Value(f32),
    /// Of a hand or the eyes, in the room.
    Pose(Posef),
}

/// What the headset supports, given the extension.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct System {
    pub(crate) hand_tracking: bool,
    /// Said in the flags of version 3 of the extension.
    pub(crate) passthrough: bool,
    /// Said in the boolean of version 1.
    pub(crate) passthrough_of_old: bool,
    pub(crate) foveation_around_gaze: bool,
    pub(crate) body_tracking: bool,
    pub(crate) full_body: bool,
    pub(crate) body_fidelity: bool,
    pub(crate) face_seen: bool,
    pub(crate) face_heard: bool,
    pub(crate) eye_tracking: bool,
    pub(crate) eye_gaze: bool,
}

/// A frame that was ended.
#[derive(Debug, Clone)]
pub(crate) struct EndedFrame {
    pub(crate) display_ns: i64,
    pub(crate) blend_mode: EnvironmentBlendMode,
    /// Each as text, in order: its type, its flags, its views, with what is chained to them.
    pub(crate) layers: Vec<String>,
}

/// The interaction profile of the eyes.
const EYES_PROFILE: &str = "/interaction_profiles/ext/eye_gaze_interaction";

#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    Reference(ReferenceSpaceType),
    Action { action: u64, subaction: u64 },
}

pub(super) struct FakeSwapchain {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) density_maps: bool,
    pub(super) acquired: u32,
    /// Where Vulkan is real.
    pub(super) images: Option<Images>,
    /// The same, if there are any.
    pub(super) maps: Option<Images>,
}

/// Everything. The fields that tests change come first.
pub(crate) struct World {
    /// Names of the extensions that it lists.
    pub(crate) extensions: Vec<&'static str>,
    pub(crate) system: System,
    /// Whether it moves a session through its states by itself: to READY when made, to FOCUSED when begun, to STOPPING when asked
    /// to exit, to EXITING when ended.
    pub(crate) obliging: bool,
    /// Whether Vulkan is the machine's own, and not dummy handles.
    pub(crate) vulkan: bool,
    pub(crate) reference_spaces: Vec<ReferenceSpaceType>,
    pub(crate) blend_modes: Vec<EnvironmentBlendMode>,
    /// Of Vulkan, the best first.
    pub(crate) formats: Vec<i64>,
    /// What images cannot be used for.
    pub(crate) refused_usage: SwapchainUsageFlags,
    /// One eye's, pixels.
    pub(crate) eye_size: [u32; 2],
    /// Left, right: pose in the room, field of view.
    pub(crate) eyes: [(Posef, Fovf); 2],
    /// What each one's lens hides; without corners nothing.
    pub(crate) lenses: [Lens; 2],
    pub(crate) head: Posef,
    /// LOCAL's origin in the room, whose own is LOCAL_FLOOR's and STAGE's.
    pub(crate) local: Posef,
    pub(crate) should_render: bool,
    pub(crate) period_ns: i64,
    /// The time that the last frame was predicted for.
    pub(crate) now_ns: i64,
    pub(crate) rates_hz: Vec<f32>,
    pub(crate) rate_hz: f32,
    /// Left, right: poses in the room.
    pub(crate) joints: [Option<[HandJointLocation; openxr::HAND_JOINT_COUNT]>; 2],
    /// The interaction profile in use.
    pub(crate) profile: Option<&'static str>,
    /// Interaction profiles that it does not know.
    pub(crate) refused_profiles: Vec<&'static str>,
    /// By full path.
    pub(crate) sources: HashMap<String, Source>,
    /// Where foveation is centred, if that is tracked.
    pub(crate) gaze_centres: Option<[[f32; 2]; 2]>,
    /// What body, face and eyes do.
    pub(crate) watched: Watched,
    /// Frames that were ended.
    pub(crate) frames: Vec<EndedFrame>,
    pub(super) events: VecDeque<pointers::Event>,

    pub(super) calls: Vec<(&'static str, String)>,
    pub(super) scripts: HashMap<&'static str, (XrResult, u32)>,
    pub(super) instance_lost: bool,
    pub(super) session_lost: bool,
    pub(super) alive: BTreeMap<u64, &'static str>,
    pub(super) enabled: Vec<String>,
    pub(super) session: u64,
    pub(super) state: SessionState,
    pub(super) running: bool,
    pub(super) waited: u32,
    pub(super) begun: bool,
    pub(super) paths: Vec<String>,
    pub(super) actions: HashMap<u64, String>,
    /// Profile, action, source.
    pub(super) bindings: Vec<(String, u64, String)>,
    pub(super) attached: bool,
    pub(super) spaces: HashMap<u64, (Place, Affine3A)>,
    pub(super) swapchains: HashMap<u64, FakeSwapchain>,
    /// Of hands which one, of bodies how many joints.
    pub(super) trackers: HashMap<u64, usize>,
    pub(super) loader: Option<Loader>,
    /// The Vulkan instance that was made last.
    pub(super) vulkan_instance: vk::Instance,
    pub(super) device: Option<SessionDevice>,
    id: u32,
    made: u32,
}

impl World {
    pub(super) fn new(id: u32, extensions: &[&'static str]) -> Self {
        let eye = |x| {
            let mut pose = Posef::IDENTITY;
            pose.position.x = x;
            pose.position.y = 1.6;
            pose
        };
        let fov = |left, right| Fovf {
            angle_left: left,
            angle_right: right,
            angle_up: 0.8,
            angle_down: -0.9,
        };
        Self {
            extensions: extensions.to_vec(),
            system: System::default(),
            obliging: true,
            vulkan: false,
            reference_spaces: vec![
                ReferenceSpaceType::VIEW,
                ReferenceSpaceType::LOCAL,
                ReferenceSpaceType::LOCAL_FLOOR,
                ReferenceSpaceType::STAGE,
            ],
            blend_modes: vec![EnvironmentBlendMode::OPAQUE],
            // R8G8B8A8_SRGB, R8G8B8A8_UNORM, D32_SFLOAT.
            formats: vec![43, 37, 126],
            refused_usage: SwapchainUsageFlags::EMPTY,
            eye_size: [1680, 1760],
            eyes: [(eye(-0.032), fov(-0.9, 0.7)), (eye(0.032), fov(-0.7, 0.9))],
            lenses: [Lens::default(), Lens::default()],
            head: eye(0.0),
            local: eye(0.0),
            should_render: true,
            period_ns: 1_000_000_000 / 72,
            now_ns: 1_000_000_000,
            rates_hz: vec![72.0, 90.0, 120.0],
            rate_hz: 72.0,
            joints: [None; 2],
            profile: None,
            refused_profiles: Vec::new(),
            sources: HashMap::new(),
            gaze_centres: None,
            watched: Watched::default(),
            frames: Vec::new(),
            events: VecDeque::new(),
            calls: Vec::new(),
            scripts: HashMap::new(),
            instance_lost: false,
            session_lost: false,
            alive: BTreeMap::new(),
            enabled: Vec::new(),
            session: 0,
            state: SessionState::UNKNOWN,
            running: false,
            waited: 0,
            begun: false,
            paths: Vec::new(),
            actions: HashMap::new(),
            bindings: Vec::new(),
            attached: false,
            spaces: HashMap::new(),
            swapchains: HashMap::new(),
            trackers: HashMap::new(),
            loader: None,
            vulkan_instance: vk::Instance::null(),
            device: None,
            id,
            made: 0,
        }
    }

    /// A new handle.
    pub(super) fn make<H: Handle>(&mut self, kind: &'static str, to: *mut H) -> u64 {
        self.made += 1;
        let handle = u64::from(self.id) << 32 | u64::from(self.made);
        self.alive.insert(handle, kind);
        pointers::give(to, H::from_raw(handle));
        handle
    }

    /// The result that the test set, else what `work` returns.
    pub(super) fn scripted(
        &mut self,
        name: &'static str,
        done: impl FnOnce(&mut Self) -> XrResult,
    ) -> XrResult {
        let Some((result, times)) = self.scripts.get_mut(name) else {
            return done(self);
        };
        let result = *result;
        *times = times.saturating_sub(1);
        if *times == 0 {
            self.scripts.remove(name);
        }
        if result.into_raw() < 0 {
            return result;
        }
        match done(self) {
            XrResult::SUCCESS => result,
            failed => failed,
        }
    }

    pub(super) fn queue_state(&mut self, state: SessionState) {
        self.events
            .push_back(pointers::event(&sys::EventDataSessionStateChanged {
                ty: sys::EventDataSessionStateChanged::TYPE,
                next: std::ptr::null(),
                session: sys::Session::from_raw(self.session),
                state,
                time: sys::Time::from_nanos(self.now_ns),
            }));
        self.state = state;
    }

    /// Moves the session to its next state, if it does so by itself.
    pub(super) fn oblige(&mut self, states: &[SessionState]) {
        if self.obliging {
            for state in states {
                self.queue_state(*state);
            }
        }
    }

    pub(super) fn has(&self, extension: &str) -> bool {
        self.enabled.iter().any(|name| name == extension)
    }

    /// The active sources of an action, in the profile in use. The profile of the eyes is always in use.
    pub(super) fn sources_of(&self, action: u64, subaction: u64) -> Vec<Source> {
        let hand = self.path(subaction);
        let in_use =
            |profile: &String| Some(profile.as_str()) == self.profile || profile == EYES_PROFILE;
        self.bindings
            .iter()
            .filter(|(profile, bound, source)| {
                *bound == action
                    && in_use(profile)
                    && hand.is_none_or(|hand| source.starts_with(hand))
            })
            .filter_map(|(_, _, source)| self.sources.get(source).copied())
            .collect()
    }

    /// The greatest of an action's values, None where there is none.
    pub(super) fn value_of(&self, action: u64, subaction: u64) -> Option<f32> {
        let sources = self.sources_of(action, subaction);
        let values = sources.iter().filter_map(|source| match source {
            Source::Value(value) => Some(*value),
            Source::Pose(_) => None,
        });
        values.reduce(f32::max)
    }

    pub(super) fn pose_of(&self, action: u64, subaction: u64) -> Option<Posef> {
        let sources = self.sources_of(action, subaction);
        sources.iter().find_map(|source| match source {
            Source::Pose(pose) => Some(*pose),
            Source::Value(_) => None,
        })
    }

    /// Where a space is in the room. None where that is not known.
    pub(super) fn room_from(&self, space: u64) -> Option<Affine3A> {
        let (place, offset) = self.spaces.get(&space)?;
        let pose = match *place {
            Place::Reference(ReferenceSpaceType::VIEW) => self.head,
            Place::Reference(ReferenceSpaceType::LOCAL) => self.local,
            Place::Reference(_) => Posef::IDENTITY,
            Place::Action { action, subaction } => self.pose_of(action, subaction)?,
        };
        Some(rigid(&pose)? * *offset)
    }

    pub(super) fn path(&self, path: u64) -> Option<&str> {
        let place = usize::try_from(path).ok()?.checked_sub(1)?;
        self.paths.get(place).map(String::as_str)
    }

    pub(super) fn path_of(&mut self, text: &str) -> u64 {
        let known = self.paths.iter().position(|path| path == text);
        let place = known.unwrap_or_else(|| {
            self.paths.push(text.to_owned());
            self.paths.len() - 1
        });
        place as u64 + 1
    }
}
