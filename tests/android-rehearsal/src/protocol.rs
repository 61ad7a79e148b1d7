//! The protocol of driver and host process: one JSON value a line, one answer a request.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Which activity of the process, in the order in which they were created.
pub type ActivityIndex = usize;

/// The intent that starts an activity.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Intent {
    /// Its data: a link that was opened.
    pub data: Option<String>,
    /// Its extras, by name.
    pub extras: Vec<(String, Extra)>,
    /// Whether unpacking the extras throws, as it does for one of a class that the process lacks.
    pub unparcelable: bool,
}

/// An extra of an intent.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Extra {
    /// A `java.lang.String`.
    Text(String),
    /// A `java.lang.Integer`.
    Integer(i32),
    /// A `java.lang.Boolean`.
    Boolean(bool),
}

impl Intent {
    /// One with this link as its data.
    #[must_use]
    pub fn view(link: &str) -> Self {
        Self {
            data: Some(link.to_owned()),
            ..Self::default()
        }
    }

    /// The same with another extra that is a text.
    #[must_use]
    pub fn with(mut self, name: &str, value: &str) -> Self {
        let value = Extra::Text(value.to_owned());
        self.extras.push((name.to_owned(), value));
        self
    }
}

/// A callback of `ANativeActivityCallbacks`, as Android calls it on the process's main thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "named as android/native_activity.h names them")]
pub enum Callback {
    Start,
    Resume,
    Pause,
    Stop,
    Destroy,
    SaveInstanceState,
    FocusGained,
    FocusLost,
    NativeWindowCreated,
    NativeWindowResized,
    NativeWindowDestroyed,
    InputQueueCreated,
    InputQueueDestroyed,
    ConfigurationChanged,
    LowMemory,
}

impl fmt::Display for Callback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "on{self:?}")
    }
}

/// A request of the driver.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Request {
    /// Create an activity, as a launch does: `ANativeActivity_onCreate`.
    Create(Intent),
    /// Call an activity back.
    Callback(ActivityIndex, Callback),
    /// Put events into the activity's input queue, and return their state a moment later.
    Input(ActivityIndex, u32),
    /// The census of the process.
    Census,
    /// End the process in good order.
    Quit,
}

/// An answer of the host.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Reply {
    /// For how long the main thread was in the app's code, milliseconds.
    pub blocked_ms: f64,
    /// The rest, by request.
    pub answer: Answer,
}

/// The part of an answer that depends on the request.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Answer {
    /// It was done.
    Done,
    /// The activity that was created.
    Created(ActivityIndex),
    /// The state of the input events so far.
    Input(InputFigures),
    /// The census of the process.
    Census(Box<Census>),
}

/// The state of an input queue's events.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(C)]
pub struct InputFigures {
    /// Taken out of the queue by the app.
    pub taken: i32,
    /// Given back by it as done.
    pub finished: i32,
    /// Of those, how many it used itself.
    pub handled: i32,
}

/// The census of the process at a moment.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Census {
    /// Names of its threads, sorted.
    pub threads: Vec<String>,
    /// What its open descriptors are, sorted.
    pub descriptors: Vec<String>,
    /// Memory that is resident, bytes.
    pub resident: u64,
    /// Libraries that are mapped, by their files' names, sorted.
    pub libraries: Vec<String>,
    /// Frames handed to OpenXR's compositor so far.
    pub frames: FrameFigures,
    /// References to windows that the app holds, over all windows.
    pub window_references: i32,
    /// Of heat and performance hints.
    pub power: PowerFigures,
    /// Of the Java machine.
    pub java: JavaCensus,
}

/// What the app did with Android's thermal functions and performance hints so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(C)]
pub struct PowerFigures {
    /// Thermal managers that it holds.
    pub thermal_managers: i32,
    /// Listeners for the thermal status that are registered.
    pub listeners: i32,
    /// Questions for the headroom, and those that came too soon after another and were not answered.
    pub headrooms: i32,
    /// See [`Self::headrooms`].
    pub hasty_headrooms: i32,
    /// Sessions of hints that were made.
    pub sessions: i32,
    /// Those that were not closed.
    pub open_sessions: i32,
    /// Threads that they are for, all together.
    pub threads: i32,
    /// Of those, how many were no threads of the process.
    pub strangers: i32,
    /// Durations that were reported.
    pub reports: i32,
    /// Calls with an object that is none.
    pub wrong: i32,
}

/// Frames that were handed to OpenXR's compositor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(C)]
pub struct FrameFigures {
    /// Those with pictures of people: a projection layer.
    pub people: i32,
    /// The others: with a notice, or nothing.
    pub others: i32,
}

/// The Java references that native code holds, and its errors that would crash a real machine.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct JavaCensus {
    /// Live global references.
    pub global_references: usize,
    /// Threads that are attached.
    pub attached_threads: usize,
    /// Strings that were borrowed and not released.
    pub borrowed_strings: usize,
    /// For each activity, how often it was asked to finish: by Java's `finish`, and by `ANativeActivity_finish`.
    pub finishes: Vec<[u32; 2]>,
    /// Names and signatures that Android does not have, frames with more local references than they promised, references used after
    /// they were deleted, threads that ended attached.
    pub faults: Vec<String>,
}
