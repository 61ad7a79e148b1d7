//! A Java machine of a table of functions: what the app, android-activity and jni-rs ask of Java, answered by a few objects. No JVM has
//! to be fetched, and it is stricter than one: it counts references, and knows only names and signatures that Android 10 has.

mod objects;
mod references;
mod table;

use android_rehearsal::protocol::{ActivityIndex, Intent, JavaCensus};
use jni_sys::{JNIEnv, JavaVM, jobject};
use objects::Object;
use std::sync::Arc;

/// The machine.
#[derive(Debug)]
pub(crate) struct Machine;

impl Machine {
    /// Starts it on the calling thread, which is attached from now on. `libraries` is the folder of the app's libraries.
    pub(crate) fn start(libraries: &str) -> Self {
        objects::set_library_folder(libraries);
        references::attach();
        Self
    }

    pub(crate) fn vm(&self) -> *mut JavaVM {
        table::vm()
    }

    pub(crate) fn env(&self) -> *mut JNIEnv {
        table::env()
    }

    /// A global reference to a new `NativeActivity`.
    pub(crate) fn new_activity(&self, index: ActivityIndex, intent: Intent) -> jobject {
        objects::note_activity(index);
        references::global(Arc::new(Object::activity(index, intent)))
    }

    /// Deletes the framework's own reference to an activity.
    pub(crate) fn forget_activity(&self, activity: jobject) {
        references::delete_global(activity);
    }

    /// Notes that an activity was asked to finish by `ANativeActivity_finish`.
    pub(crate) fn finished_natively(&self, activity: jobject) {
        if let Some(Object::Activity(activity)) = references::get(activity).as_deref() {
            objects::note_finish(activity.index, objects::Finish::Native);
        }
    }

    pub(crate) fn census(&self) -> JavaCensus {
        JavaCensus {
            finishes: objects::finishes(),
            ..references::census()
        }
    }
}
