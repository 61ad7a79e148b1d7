//! References that native code holds: numbers, never addresses, so that a reference that was deleted is noticed and not followed.

use super::objects::Object;
use android_rehearsal::protocol::JavaCensus;
use jni_sys::{jobject, jobjectRefType};
use std::collections::HashMap;
use std::ffi::{CString, c_char, c_void};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

/// Local references that native code may hold without saying so before (the JNI's specification).
const PROMISED: usize = 16;

#[derive(Debug, Default)]
struct State {
    last: usize,
    live: HashMap<usize, Reference>,
    /// By address, the strings that native code has borrowed.
    borrowed: HashMap<usize, (Arc<Object>, u32)>,
    /// Those that are attached.
    threads: HashMap<i32, Attached>,
    faults: Vec<String>,
}

#[derive(Debug)]
struct Reference {
    object: Arc<Object>,
    global: bool,
}

static STATE: LazyLock<Mutex<State>> = LazyLock::new(Mutex::default);

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One frame of a thread's local references.
#[derive(Debug, Default)]
struct Frame {
    promised: usize,
    references: Vec<usize>,
    is_reported: bool,
}

/// A thread that is attached.
#[derive(Debug)]
struct Attached {
    frames: Vec<Frame>,
    exception: Option<Arc<Object>>,
}

impl State {
    /// Forgets a thread and its local references; returns whether it was attached.
    fn detach(&mut self, thread: i32) -> bool {
        let Some(attached) = self.threads.remove(&thread) else {
            return false;
        };
        for reference in attached
            .frames
            .into_iter()
            .flat_map(|frame| frame.references)
        {
            self.live.remove(&reference);
        }
        true
    }
}

/// The calling thread.
fn this_thread() -> i32 {
    rustix::thread::gettid().as_raw_nonzero().get()
}

/// Rounds of destructors of thread-local values that the C library runs at least (`PTHREAD_DESTRUCTOR_ITERATIONS`).
const ROUNDS: usize = 4;

/// Calls `at_end` when the calling thread ends, after the destructors of all other thread-local values: jni-rs detaches in
/// one of those, and only a thread that is attached after it is in the wrong.
fn watch_end_of_thread() {
    static KEY: LazyLock<libc::pthread_key_t> = LazyLock::new(|| {
        let mut key = 0;
        // SAFETY: the function is there as long as the process.
        unsafe { libc::pthread_key_create(&raw mut key, Some(at_end)) };
        key
    });
    extern "C" fn at_end(round: *mut c_void) {
        if round.addr() < ROUNDS {
            set(round.addr() + 1);
        } else if state().detach(this_thread()) {
            let name = std::fs::read_to_string("/proc/thread-self/comm").unwrap_or_default();
            fault(format!("the thread {} ended attached", name.trim()));
        }
    }
    fn set(round: usize) {
        // SAFETY: the value is a number, which nothing follows.
        unsafe { libc::pthread_setspecific(*KEY, std::ptr::without_provenance(round)) };
    }
    set(1);
}

/// An error that would crash a real machine.
pub(super) fn fault(what: String) {
    let mut state = state();
    // One of each kind is enough.
    if state.faults.len() < 32 && !state.faults.contains(&what) {
        state.faults.push(what);
    }
}

pub(super) fn attach() {
    let attached = Attached {
        frames: vec![Frame {
            promised: PROMISED,
            ..Frame::default()
        }],
        exception: None,
    };
    state().threads.entry(this_thread()).or_insert(attached);
    watch_end_of_thread();
}

pub(super) fn is_attached() -> bool {
    state().threads.contains_key(&this_thread())
}

pub(super) fn detach() {
    state().detach(this_thread());
}

/// Does something with the calling thread, under the lock; a thread that is not attached is a fault.
fn with_thread<T>(work: impl FnOnce(&mut Attached) -> T) -> Option<T> {
    let done = state().threads.get_mut(&this_thread()).map(work);
    if done.is_none() {
        fault("Java was called from a thread that is not attached".to_owned());
    }
    done
}

fn handle(number: usize) -> jobject {
    std::ptr::without_provenance_mut(number)
}

fn insert(object: Arc<Object>, global: bool) -> usize {
    let mut state = state();
    // Even, as an address would be, and never null.
    state.last += 16;
    let number = state.last;
    state.live.insert(number, Reference { object, global });
    number
}

/// A new local reference of the calling thread; null for no object.
pub(super) fn local(object: Option<Arc<Object>>) -> jobject {
    let Some(object) = object else {
        return std::ptr::null_mut();
    };
    let class = object.class();
    let number = insert(object, false);
    let too_many = with_thread(|thread| {
        let frame = thread.frames.last_mut()?;
        frame.references.push(number);
        let too_many = frame.references.len() > frame.promised && !frame.is_reported;
        frame.is_reported |= too_many;
        too_many.then_some(frame.promised)
    });
    if let Some(Some(promised)) = too_many {
        fault(format!(
            "more than {promised} local references in a frame (the last one of {class})"
        ));
    }
    handle(number)
}

pub(super) fn global(object: Arc<Object>) -> jobject {
    handle(insert(object, true))
}

/// The object behind a reference; nothing for null, and for a deleted one, which is a fault.
pub(super) fn get(reference: jobject) -> Option<Arc<Object>> {
    if reference.is_null() {
        return None;
    }
    let found = state()
        .live
        .get(&reference.addr())
        .map(|it| Arc::clone(&it.object));
    if found.is_none() {
        fault("a reference was used that was deleted before".to_owned());
    }
    found
}

pub(super) fn kind(reference: jobject) -> jobjectRefType {
    match state().live.get(&reference.addr()) {
        None => jobjectRefType::JNIInvalidRefType,
        Some(reference) if reference.global => jobjectRefType::JNIGlobalRefType,
        Some(_) => jobjectRefType::JNILocalRefType,
    }
}

fn delete(reference: jobject, global: bool) {
    if reference.is_null() {
        return;
    }
    let removed = state().live.remove(&reference.addr());
    match removed {
        Some(removed) if removed.global == global => {}
        _ => fault("a reference was deleted twice, or as one of the other kind".to_owned()),
    }
}

pub(super) fn delete_global(reference: jobject) {
    delete(reference, true);
}

pub(super) fn delete_local(reference: jobject) {
    delete(reference, false);
    with_thread(|thread| {
        for frame in &mut thread.frames {
            frame.references.retain(|one| *one != reference.addr());
        }
    });
}

pub(super) fn push_frame(promised: usize) {
    with_thread(|thread| {
        thread.frames.push(Frame {
            promised: promised.max(PROMISED),
            ..Frame::default()
        });
    });
}

/// Ends the newest frame. `result` lives on in the one before, by another reference.
pub(super) fn pop_frame(result: jobject) -> jobject {
    let kept = get(result);
    let frame = with_thread(|thread| {
        (thread.frames.len() > 1)
            .then(|| thread.frames.pop())
            .flatten()
    });
    match frame.flatten() {
        Some(frame) => {
            let mut state = state();
            for reference in frame.references {
                state.live.remove(&reference);
            }
        }
        None => fault("a frame of local references was ended that was not begun".to_owned()),
    }
    local(kept)
}

pub(super) fn promise_more(promised: usize) {
    with_thread(|thread| {
        if let Some(frame) = thread.frames.last_mut() {
            frame.promised = frame.promised.max(frame.references.len() + promised);
        }
    });
}

pub(super) fn throw(message: String) {
    let exception = Arc::new(Object::Exception(message));
    with_thread(|thread| thread.exception = Some(exception));
}

pub(super) fn exception() -> Option<Arc<Object>> {
    with_thread(|thread| thread.exception.clone()).flatten()
}

pub(super) fn clear_exception() {
    with_thread(|thread| thread.exception = None);
}

/// A string's bytes, which stay until [`give_back`].
pub(super) fn borrow(object: Arc<Object>, text: &CString) -> *const c_char {
    let address = text.as_ptr();
    let mut state = state();
    let entry = state.borrowed.entry(address.addr()).or_insert((object, 0));
    entry.1 += 1;
    address
}

pub(super) fn give_back(address: *const c_char) {
    let mut state = state();
    let Some(entry) = state.borrowed.get_mut(&address.addr()) else {
        drop(state);
        fault("a string was released that was not borrowed".to_owned());
        return;
    };
    entry.1 -= 1;
    if entry.1 == 0 {
        state.borrowed.remove(&address.addr());
    }
}

pub(super) fn census() -> JavaCensus {
    let state = state();
    JavaCensus {
        global_references: state.live.values().filter(|one| one.global).count(),
        attached_threads: state.threads.len(),
        borrowed_strings: state.borrowed.len(),
        finishes: Vec::new(),
        faults: state.faults.clone(),
    }
}
