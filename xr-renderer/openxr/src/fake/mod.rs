//! A runtime for tests that is a table of functions: no loader, service, headset or GPU.
//!
//! [`FakeRuntime::new`] lists the extensions that it is given. Its answers come from its [`World`] and can be changed at
//! any time ([`FakeRuntime::set`]); every call that is made to it is remembered as a line ([`FakeRuntime::calls`]); any call
//! can be made to fail ([`FakeRuntime::fail`]). It refuses calls in the wrong order, as a real runtime does.
//! Where `World::obliging` is set, as it is at first, it leads sessions through their states by itself.
//!
//! Each test has its own: handles carry their runtime's number, so tests run side by side. Only what has no handle (making an
//! instance) goes to the runtime that the calling thread made last or was given by [`FakeRuntime::on_this_thread`].
//!
//! ```ignore
//! let fake = FakeRuntime::new(&[REQUIRED, "XR_FB_passthrough"]);
//! fake.set(|world| world.system.passthrough = true);
//! let instance = fake.instance();                                  // or Runtime::of(fake.entry())
//! let (session, waiter, stream) = fake.session(&instance);        // dummy Vulkan handles
//! fake.fail("xrPassthroughStartFB", sys::Result::ERROR_RUNTIME_FAILURE);
//! fake.queue_state(SessionState::VISIBLE);                          // an event
//! fake.press("/user/hand/left/input/select/click", 1.0);            // a button
//! assert_eq!(fake.calls("xrPassthroughStartFB").len(), 1);
//! let headset = Headset::open(&Runtime::of(FakeRuntime::with_everything().with_vulkan().entry()), ..); // with real images
//! fake.lose_instance();                                             // everything says ERROR_INSTANCE_LOST until a new one
//! ```

#![allow(
    clippy::cast_possible_truncation,
    reason = "counts and bytes of tests, all small"
)]
#![allow(
    dead_code,
    reason = "a runtime has more to it than any one test asks of it"
)]

mod actions;
mod device;
mod lenses;
mod pointers;
mod runtime;
mod session;
mod swapchain;
mod table;
mod tests;
mod trackers;
mod vendor;
mod watched;
mod world;

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

use glam::{Affine3A, Vec3};
use openxr::sys::{self, Handle, Result as XrResult};
use openxr::{
    ApplicationInfo, Entry, FrameStream, FrameWaiter, HandJoint, HandJointLocation, Instance,
    Posef, Session, SessionState, SpaceLocationFlags, SystemId, Vulkan,
};

pub(crate) use crate::pose::posef;
pub(crate) use lenses::Lens;
pub(crate) use world::{EndedFrame, Source, World};

/// What [`crate::extensions::Extensions`] insists on.
pub(crate) const REQUIRED: &str = "XR_KHR_vulkan_enable2";

/// The only system.
pub(crate) const SYSTEM: u64 = 7;

static RUNTIMES: LazyLock<Mutex<HashMap<u32, Arc<Mutex<World>>>>> = LazyLock::new(Mutex::default);
static COUNT: AtomicU32 = AtomicU32::new(1);

thread_local! {
    static CURRENT: Cell<u32> = const { Cell::new(0) };
}

/// One runtime. Dropping this value ends it: drop what was made with it first.
pub(crate) struct FakeRuntime {
    id: u32,
    world: Arc<Mutex<World>>,
}

impl Drop for FakeRuntime {
    fn drop(&mut self) {
        locked(&RUNTIMES).remove(&self.id);
    }
}

impl FakeRuntime {
    /// A runtime with these extensions, on this thread. Name [`REQUIRED`] too, unless the test needs it to be missing.
    pub(crate) fn new(extensions: &[&'static str]) -> Self {
        let id = COUNT.fetch_add(1, Ordering::Relaxed);
        let world = Arc::new(Mutex::new(World::new(id, extensions)));
        locked(&RUNTIMES).insert(id, Arc::clone(&world));
        let this = Self { id, world };
        this.on_this_thread();
        this
    }

    /// A runtime with every extension that we want, of a headset that supports all of them.
    pub(crate) fn with_everything() -> Self {
        let fake = Self::new(table::EXTENSIONS);
        fake.set(|world| {
            world.system.hand_tracking = true;
            world.system.passthrough = true;
            world.system.foveation_around_gaze = true;
            world.system.body_tracking = true;
            world.system.full_body = true;
            world.system.body_fidelity = true;
            world.system.face_seen = true;
            world.system.face_heard = true;
            world.system.eye_tracking = true;
            world.system.eye_gaze = true;
        });
        fake
    }

    /// The same with the machine's Vulkan: its instances, devices and swapchain images are real.
    pub(crate) fn with_vulkan(self) -> Self {
        self.set(|world| world.vulkan = true);
        self
    }

    /// The calling thread makes its instances with this runtime from now on.
    pub(crate) fn on_this_thread(&self) {
        CURRENT.set(self.id);
    }

    /// Its entry points, for `Runtime::of`.
    pub(crate) fn entry(&self) -> Entry {
        self.on_this_thread();
        // SAFETY: the table has every function of the core, each doing what the specification lets it.
        unsafe { Entry::from_get_instance_proc_addr(table::get_instance_proc_addr, &()) }
            .expect("the table has what an entry needs")
    }

    /// An instance with whatever of its extensions we want.
    pub(crate) fn instance(&self) -> Instance {
        let entry = self.entry();
        let available = entry.enumerate_extensions().expect("a list of extensions");
        let extensions =
            crate::extensions::Extensions::of(&available).expect("the required extension");
        entry
            .create_instance(&ApplicationInfo::default(), extensions.set(), &[], &())
            .expect("an instance")
    }

    /// A session on dummy Vulkan handles.
    pub(crate) fn session(
        &self,
        instance: &Instance,
    ) -> (Session<Vulkan>, FrameWaiter, FrameStream<Vulkan>) {
        let info = openxr::vulkan::SessionCreateInfo {
            instance: std::ptr::null(),
            physical_device: std::ptr::null(),
            device: std::ptr::null(),
            queue_family_index: 0,
            queue_index: 0,
        };
        // SAFETY: this runtime never looks at them.
        unsafe { instance.create_session(self.system(), &info) }.expect("a session")
    }

    /// The headset.
    pub(crate) fn system(&self) -> SystemId {
        SystemId::from_raw(SYSTEM)
    }

    /// Changes what it answers.
    pub(crate) fn set<T>(&self, change: impl FnOnce(&mut World) -> T) -> T {
        change(&mut locked(&self.world))
    }

    /// The arguments of every call of that function so far, a line each, in order.
    pub(crate) fn calls(&self, name: &str) -> Vec<String> {
        self.set(|world| {
            let of_it = world.calls.iter().filter(|call| call.0 == name);
            of_it.map(|call| call.1.clone()).collect()
        })
    }

    /// The names of all functions called so far, in order.
    pub(crate) fn names(&self) -> Vec<&'static str> {
        self.set(|world| world.calls.iter().map(|call| call.0).collect())
    }

    /// Forgets the calls so far.
    pub(crate) fn forget_calls(&self) {
        self.set(|world| world.calls.clear());
    }

    /// That function returns this result from now on: a failure, without any effect, or another success code.
    pub(crate) fn fail(&self, name: &'static str, result: XrResult) {
        self.set(|world| world.scripts.insert(name, (result, u32::MAX)));
    }

    /// The next `times` calls of that function give this result.
    pub(crate) fn fail_times(&self, name: &'static str, result: XrResult, times: u32) {
        self.set(|world| world.scripts.insert(name, (result, times)));
    }

    /// That function works again from now on.
    pub(crate) fn heal(&self, name: &'static str) {
        self.set(|world| world.scripts.remove(name));
    }

    /// Every call returns `ERROR_INSTANCE_LOST` until there is a new instance.
    pub(crate) fn lose_instance(&self) {
        self.set(|world| world.instance_lost = true);
    }

    /// Every call on a session returns `ERROR_SESSION_LOST` until there is a new one.
    pub(crate) fn lose_session(&self) {
        self.set(|world| world.session_lost = true);
    }

    /// How many things of a kind (`"instance"`, `"session"`, `"space"`, `"swapchain"`, ...) were made and not destroyed.
    pub(crate) fn alive(&self, kind: &str) -> usize {
        self.set(|world| world.alive.values().filter(|one| **one == kind).count())
    }

    /// Queues a change of the newest session's state.
    pub(crate) fn queue_state(&self, state: SessionState) {
        self.set(|world| world.queue_state(state));
    }

    /// Queues any event: a structure `XrEventData...`.
    pub(crate) fn queue<T: Copy>(&self, event: T) {
        self.set(|world| world.events.push_back(pointers::event(&event)));
    }

    /// Queues that the instance will be lost.
    pub(crate) fn queue_instance_loss(&self) {
        self.queue(sys::EventDataInstanceLossPending {
            ty: sys::EventDataInstanceLossPending::TYPE,
            next: std::ptr::null(),
            loss_time: sys::Time::from_nanos(0),
        });
    }

    /// Queues that the wearer recentred, from a frame's time on.
    pub(crate) fn queue_recentre(&self, space: openxr::ReferenceSpaceType, change_time: sys::Time) {
        let session = self.set(|world| world.session);
        self.queue(sys::EventDataReferenceSpaceChangePending {
            ty: sys::EventDataReferenceSpaceChangePending::TYPE,
            next: std::ptr::null(),
            session: sys::Session::from_raw(session),
            reference_space_type: space,
            change_time,
            pose_valid: sys::FALSE,
            pose_in_previous_space: Posef::IDENTITY,
        });
    }

    /// Queues that the display's rate changed, and changes it.
    pub(crate) fn queue_rate(&self, to_hz: f32) {
        let from = self.set(|world| std::mem::replace(&mut world.rate_hz, to_hz));
        self.queue(sys::EventDataDisplayRefreshRateChangedFB {
            ty: sys::EventDataDisplayRefreshRateChangedFB::TYPE,
            next: std::ptr::null(),
            from_display_refresh_rate: from,
            to_display_refresh_rate: to_hz,
        });
    }

    /// Changes what a view's lens hides, and queues the event of it.
    pub(crate) fn queue_lens(&self, view: u32, lens: Lens) {
        let session = self.set(|world| {
            world.lenses[view as usize] = lens;
            world.session
        });
        self.queue(sys::EventDataVisibilityMaskChangedKHR {
            ty: sys::EventDataVisibilityMaskChangedKHR::TYPE,
            next: std::ptr::null(),
            session: sys::Session::from_raw(session),
            view_configuration_type: openxr::ViewConfigurationType::PRIMARY_STEREO,
            view_index: view,
        });
    }

    /// Puts these controllers into the hands (an interaction profile's path), or none, and queues the event of it.
    pub(crate) fn hold_controllers(&self, profile: Option<&'static str>) {
        let session = self.set(|world| {
            world.profile = profile;
            world.session
        });
        self.queue(sys::EventDataInteractionProfileChanged {
            ty: sys::EventDataInteractionProfileChanged::TYPE,
            next: std::ptr::null(),
            session: sys::Session::from_raw(session),
        });
    }

    /// Sets a button, trigger or squeeze by its full path: 0 to 1.
    pub(crate) fn press(&self, path: &str, value: f32) {
        self.set(|world| world.sources.insert(path.to_owned(), Source::Value(value)));
    }

    /// Sets a pose by its source's full path, in the room.
    pub(crate) fn put(&self, path: &str, pose: Posef) {
        self.set(|world| world.sources.insert(path.to_owned(), Source::Pose(pose)));
    }
}

/// Runs a call on its runtime: records it, then fails it where the test asks for that or something is lost.
fn call(
    handle: impl Handle,
    name: &'static str,
    arguments: impl Into<String>,
    done: impl FnOnce(&mut World) -> XrResult,
) -> XrResult {
    let handle = handle.into_raw();
    let found = locked(&RUNTIMES).get(&((handle >> 32) as u32)).cloned();
    let Some(world) = found else {
        return XrResult::ERROR_HANDLE_INVALID;
    };
    let mut world = locked(&world);
    world.calls.push((name, arguments.into()));
    let Some(kind) = world.alive.get(&handle).copied() else {
        return XrResult::ERROR_HANDLE_INVALID;
    };
    if name.starts_with("xrDestroy") {
        world.alive.remove(&handle);
        return done(&mut world);
    }
    if world.instance_lost {
        return XrResult::ERROR_INSTANCE_LOST;
    }
    if world.session_lost && !matches!(kind, "instance" | "action set" | "action") {
        return XrResult::ERROR_SESSION_LOST;
    }
    world.scripted(name, done)
}

/// As [`call`], for what has no handle yet.
fn call_here(
    name: &'static str,
    arguments: impl Into<String>,
    done: impl FnOnce(&mut World) -> XrResult,
) -> XrResult {
    let Some(world) = locked(&RUNTIMES).get(&CURRENT.get()).cloned() else {
        return XrResult::ERROR_RUNTIME_UNAVAILABLE;
    };
    let mut world = locked(&world);
    world.calls.push((name, arguments.into()));
    world.scripted(name, done)
}

/// A test that failed with the lock held does not fail those after it.
fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A hand with its palm there, -z towards the finger tips, y out of its back, whose thumb's tip is so far from the tips of the
/// index and the middle finger. Only the joints that this crate reads have their right place.
pub(crate) fn hand(
    room_from_palm: Affine3A,
    thumb_to_index_metres: f32,
    thumb_to_middle_metres: f32,
) -> [HandJointLocation; openxr::HAND_JOINT_COUNT] {
    let at = |x, y, z| {
        let place = Affine3A::from_translation(Vec3::new(x, y, z));
        HandJointLocation {
            location_flags: SpaceLocationFlags::ORIENTATION_VALID
                | SpaceLocationFlags::POSITION_VALID,
            pose: posef(&(room_from_palm * place)),
            radius: 0.01,
        }
    };
    let mut joints = [at(0.0, 0.0, 0.0); openxr::HAND_JOINT_COUNT];
    let thumb = Vec3::new(-0.04, -0.03, -0.06);
    for (joint, place) in [
        (HandJoint::WRIST, Vec3::new(0.0, 0.0, 0.08)),
        (HandJoint::INDEX_PROXIMAL, Vec3::new(-0.02, 0.0, -0.03)),
        (HandJoint::MIDDLE_PROXIMAL, Vec3::new(0.0, 0.0, -0.03)),
        (HandJoint::THUMB_TIP, thumb),
        (
            HandJoint::INDEX_TIP,
            thumb - thumb_to_index_metres * Vec3::Z,
        ),
        (
            HandJoint::MIDDLE_TIP,
            thumb + thumb_to_middle_metres * Vec3::X,
        ),
    ] {
        joints[joint] = at(place.x, place.y, place.z);
    }
    joints
}
