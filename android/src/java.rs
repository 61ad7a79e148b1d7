//! Calls to the activity's Java side: the intent that started it, with its extras and its data, permissions, and to close.
//!
//! A `NativeActivity` gets no later intents: one that comes while it lives makes another activity (`succession.rs`), or is lost.

use crate::settings::Key;
use android_activity::AndroidApp;
use jni::errors::{Error, Result};
use jni::objects::{JObject, JObjectArray, JString, JValue};
use jni::{JNIEnv, JavaVM};
use std::path::PathBuf;

/// Local references that one call here may make. Java guarantees room for 16, and may end the process where there are more.
const OBJECTS: i32 = 16;

/// Names of extras that are read, to log those that are no settings.
const MOST_NAMES: usize = 64;

/// The content of an intent.
#[derive(Debug, Default)]
pub(crate) struct Intent {
    /// Names and values, as texts.
    pub(crate) extras: Vec<(String, String)>,
    /// The link that was opened.
    pub(crate) link: Option<String>,
    /// Why the content may be incomplete.
    pub(crate) trouble: Option<String>,
}

/// Reads the intent that started the activity.
pub(crate) fn intent(app: &AndroidApp) -> Intent {
    let mut intent = Intent::default();
    let read = with(app, |env, activity| read_from(env, activity, &mut intent));
    intent.trouble = read.err().map(|error| error.to_string());
    intent
}

/// Where Android unpacked the package's own libraries.
pub(crate) fn library_folder(app: &AndroidApp) -> Option<PathBuf> {
    let mut folder = None;
    let read = with(app, |env, activity| {
        let info = env
            .call_method(
                activity,
                "getApplicationInfo",
                "()Landroid/content/pm/ApplicationInfo;",
                &[],
            )?
            .l()?;
        let path = env
            .get_field(&info, "nativeLibraryDir", "Ljava/lang/String;")?
            .l()?;
        folder = text(env, path)?.map(PathBuf::from);
        Ok(())
    });
    if let Err(error) = read {
        log::warn!("Android does not say where the app's libraries are: {error}");
    }
    folder
}

/// Closes the activity. Android pauses, stops and destroys it as always.
pub(crate) fn finish(app: &AndroidApp) {
    let asked = with(app, |env, activity| {
        env.call_method(activity, "finish", "()V", &[])?.v()
    });
    if let Err(error) = asked {
        log::error!("the app cannot be closed from within: {error}");
    }
}

/// What the wearer gives who lets the app hear them.
const RECORD_AUDIO: &str = "android.permission.RECORD_AUDIO";
/// What moves the wearer's avatar beside head and hands, and (the eyes) a second screen's camera; a headset without it gives it to nobody, and asks nobody.
const TRACKING: [&str; 3] = [
    "com.oculus.permission.BODY_TRACKING",
    "com.oculus.permission.FACE_TRACKING",
    "com.oculus.permission.EYE_TRACKING",
];
/// `PackageManager.PERMISSION_GRANTED`.
const GRANTED: i32 = 0;
/// Of the request, where an app makes several.
const REQUEST: i32 = 1;

/// Whether the app may record.
pub(crate) fn may_record(app: &AndroidApp) -> bool {
    let mut found = None;
    let asked = with(app, |env, activity| {
        let name = env.new_string(RECORD_AUDIO)?;
        let arguments = [JValue::Object(&name)];
        let answer = env.call_method(
            activity,
            "checkSelfPermission",
            "(Ljava/lang/String;)I",
            &arguments,
        )?;
        found = Some(answer.i()?);
        Ok(())
    });
    if let Err(error) = asked {
        log::debug!("Android does not say whether the app may record: {error}");
    }
    found == Some(GRANTED)
}

/// Has Android ask the wearer, in one go, whether the app may record and watch them; it asks for what they have not answered yet. Their answer about
/// recording is seen by [`may_record`]: it comes to Java's side, which the app has none of. The OpenXR runtime knows the others.
pub(crate) fn ask_to_record_and_watch(app: &AndroidApp) {
    let asked = with(app, |env, activity| {
        let name = env.new_string(RECORD_AUDIO)?;
        let count = 1 + i32::try_from(TRACKING.len()).unwrap_or(0);
        let names = env.new_object_array(count, "java/lang/String", &name)?;
        for (index, name) in (1..).zip(TRACKING) {
            let name = env.new_string(name)?;
            env.set_object_array_element(&names, index, &name)?;
        }
        let arguments = [JValue::Object(&names), JValue::Int(REQUEST)];
        env.call_method(
            activity,
            "requestPermissions",
            "([Ljava/lang/String;I)V",
            &arguments,
        )?
        .v()
    });
    if let Err(error) = asked {
        log::warn!("Android does not ask whether the app may record and watch: {error}");
    }
}

/// Calls the activity.
fn with(
    app: &AndroidApp,
    call: impl FnOnce(&mut JNIEnv<'_>, &JObject<'_>) -> Result<()>,
) -> Result<()> {
    // SAFETY: android-activity gives the process's own Java VM, which outlives this call.
    let vm = unsafe { JavaVM::from_raw(app.vm_as_ptr().cast()) }?;
    let mut env = vm.attach_current_thread()?;
    // SAFETY: a global reference to the activity, which android-activity keeps as long as `app`. A JObject does not free it.
    let activity = unsafe { JObject::from_raw(app.activity_as_ptr().cast()) };
    let outcome = env.with_local_frame(OBJECTS, |env| call(env, &activity));
    if matches!(outcome, Err(Error::JavaException)) {
        // Extras of a class that this process lacks cannot be unpacked, say. With the exception pending no other call may be made.
        env.exception_describe()?;
        env.exception_clear()?;
    }
    outcome
}

fn read_from(env: &mut JNIEnv<'_>, activity: &JObject<'_>, intent: &mut Intent) -> Result<()> {
    let given = env
        .call_method(activity, "getIntent", "()Landroid/content/Intent;", &[])?
        .l()?;
    if given.is_null() {
        return Ok(());
    }
    let link = env
        .call_method(&given, "getDataString", "()Ljava/lang/String;", &[])?
        .l()?;
    intent.link = text(env, link)?;
    let extras = env
        .call_method(&given, "getExtras", "()Landroid/os/Bundle;", &[])?
        .l()?;
    if extras.is_null() {
        return Ok(());
    }
    for key in Key::ALL {
        let value = env.with_local_frame(OBJECTS, |env| extra(env, &extras, key.name()))?;
        if let Some(value) = value {
            intent.extras.push((key.name().to_owned(), value));
        }
    }
    for name in names(env, &extras)? {
        if Key::named(&name).is_none() {
            intent.extras.push((name, String::new()));
        }
    }
    Ok(())
}

/// An extra of any type as a text: `--es`, `--ez` and `--ei` are all understood.
fn extra(env: &mut JNIEnv<'_>, extras: &JObject<'_>, name: &str) -> Result<Option<String>> {
    let name = env.new_string(name)?;
    let value = env
        .call_method(
            extras,
            "get",
            "(Ljava/lang/String;)Ljava/lang/Object;",
            &[JValue::Object(&name)],
        )?
        .l()?;
    if value.is_null() {
        return Ok(None);
    }
    let value = env
        .call_method(&value, "toString", "()Ljava/lang/String;", &[])?
        .l()?;
    text(env, value)
}

fn names(env: &mut JNIEnv<'_>, extras: &JObject<'_>) -> Result<Vec<String>> {
    let set = env
        .call_method(extras, "keySet", "()Ljava/util/Set;", &[])?
        .l()?;
    let array: JObjectArray<'_> = env
        .call_method(&set, "toArray", "()[Ljava/lang/Object;", &[])?
        .l()?
        .into();
    let count = env.get_array_length(&array)?;
    let mut names = Vec::new();
    for index in (0..count).take(MOST_NAMES) {
        let name = env.with_local_frame(OBJECTS, |env| {
            let name = env.get_object_array_element(&array, index)?;
            text(env, name)
        })?;
        names.extend(name);
    }
    Ok(names)
}

/// A Java string; nothing for null.
fn text(env: &mut JNIEnv<'_>, string: JObject<'_>) -> Result<Option<String>> {
    if string.is_null() {
        return Ok(None);
    }
    let string = JString::from(string);
    Ok(Some(env.get_string(&string)?.into()))
}
