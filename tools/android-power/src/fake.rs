//! Android's functions for tests: what they are asked for is remembered, and what they answer is as the test says.

use std::ffi::{c_float, c_int, c_void};
use std::ptr::without_provenance_mut;
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use crate::native::System;
use crate::shape::{HintFunctions, Object, StatusCallback, ThermalFunctions};

/// A call of the performance hints, with nanoseconds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Hint {
    Created(Vec<i32>, i64),
    Target(i64),
    Reported(i64),
    Closed,
}

pub(crate) struct Fake {
    pub(crate) gives_managers: bool,
    pub(crate) gives_sessions: bool,
    pub(crate) registers: bool,
    pub(crate) status: c_int,
    pub(crate) headroom: c_float,
    /// What every hint returns.
    pub(crate) errno: c_int,
    /// Thermal managers that were acquired and not released.
    pub(crate) managers: i32,
    pub(crate) listeners: i32,
    /// The seconds of each question for the headroom.
    pub(crate) forecasts: Vec<c_int>,
    callback: Option<StatusCallback>,
    hints: Vec<Hint>,
}

const NEW: Fake = Fake {
    gives_managers: true,
    gives_sessions: true,
    registers: true,
    status: 0,
    headroom: 0.5,
    errno: 0,
    managers: 0,
    listeners: 0,
    forecasts: Vec::new(),
    callback: None,
    hints: Vec::new(),
};

static FAKE: Mutex<Fake> = Mutex::new(NEW);
static ALONE: Mutex<()> = Mutex::new(());
static LINES: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// As new, and for the calling test alone while this is held: the functions have nothing to tell one test from another by.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    let guard = locked(&ALONE);
    set(|fake| *fake = NEW);
    guard
}

pub(crate) fn set<T>(change: impl FnOnce(&mut Fake) -> T) -> T {
    change(&mut locked(&FAKE))
}

/// The hints since the last time.
pub(crate) fn hints() -> Vec<Hint> {
    set(|fake| std::mem::take(&mut fake.hints))
}

/// What was logged since the last time, at level info or worse.
pub(crate) fn logged() -> Vec<String> {
    static START: Once = Once::new();
    START.call_once(|| {
        log::set_logger(&Lines).expect("no other logger");
        log::set_max_level(log::LevelFilter::Info);
    });
    std::mem::take(&mut *locked(&LINES))
}

struct Lines;

impl log::Log for Lines {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        locked(&LINES).push(format!("{} {}", record.level(), record.args()));
    }

    fn flush(&self) {}
}

/// Has the platform tell its listener of another status, if there is one.
pub(crate) fn tell_status(status: c_int) {
    let callback = set(|fake| fake.callback);
    if let Some(callback) = callback {
        // SAFETY: it was registered with no data.
        unsafe { callback(std::ptr::null_mut(), status) };
    }
}

/// All of them.
pub(crate) fn system() -> System {
    System {
        thermal: Some(ThermalFunctions {
            acquire_manager,
            release_manager,
            current_status,
            register,
            unregister,
            headroom: Some(headroom),
        }),
        hints: Some(HintFunctions {
            manager,
            create_session,
            update_target,
            report_actual,
            close_session,
        }),
    }
}

const MANAGER: usize = 0x10;
const SESSION: usize = 0x20;

fn object(there: bool, number: usize) -> Object {
    without_provenance_mut(if there { number } else { 0 })
}

fn assert_is(object: Object, number: usize) {
    assert_eq!(object.addr(), number, "the object");
}

extern "C" fn acquire_manager() -> Object {
    set(|fake| {
        fake.managers += i32::from(fake.gives_managers);
        object(fake.gives_managers, MANAGER)
    })
}

extern "C" fn release_manager(manager: Object) {
    assert_is(manager, MANAGER);
    set(|fake| fake.managers -= 1);
}

extern "C" fn current_status(manager: Object) -> c_int {
    assert_is(manager, MANAGER);
    set(|fake| fake.status)
}

extern "C" fn register(manager: Object, callback: StatusCallback, data: *mut c_void) -> c_int {
    assert_is(manager, MANAGER);
    assert!(data.is_null(), "no data");
    set(|fake| {
        if !fake.registers {
            return 32;
        }
        fake.listeners += 1;
        fake.callback = Some(callback);
        0
    })
}

extern "C" fn unregister(manager: Object, _: StatusCallback, _: *mut c_void) -> c_int {
    assert_is(manager, MANAGER);
    set(|fake| {
        fake.listeners -= 1;
        fake.callback = None;
    });
    0
}

extern "C" fn headroom(manager: Object, seconds: c_int) -> c_float {
    assert_is(manager, MANAGER);
    set(|fake| {
        fake.forecasts.push(seconds);
        fake.headroom
    })
}

extern "C" fn manager() -> Object {
    set(|fake| object(fake.gives_managers, MANAGER))
}

extern "C" fn create_session(
    manager: Object,
    threads: *const i32,
    count: usize,
    target: i64,
) -> Object {
    assert_is(manager, MANAGER);
    // SAFETY: the caller has as many numbers.
    let threads = unsafe { std::slice::from_raw_parts(threads, count) }.to_vec();
    set(|fake| {
        if fake.gives_sessions {
            fake.hints.push(Hint::Created(threads, target));
        }
        object(fake.gives_sessions, SESSION)
    })
}

fn told(session: Object, hint: Hint) -> c_int {
    assert_is(session, SESSION);
    set(|fake| {
        fake.hints.push(hint);
        fake.errno
    })
}

extern "C" fn update_target(session: Object, target: i64) -> c_int {
    told(session, Hint::Target(target))
}

extern "C" fn report_actual(session: Object, worked: i64) -> c_int {
    told(session, Hint::Reported(worked))
}

extern "C" fn close_session(session: Object) {
    told(session, Hint::Closed);
}
