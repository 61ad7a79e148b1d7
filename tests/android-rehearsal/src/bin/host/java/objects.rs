//! The objects that the app can meet, and the members it may ask them for.

use android_rehearsal::protocol::{ActivityIndex, Extra, Intent};
use std::ffi::CString;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// A Java object.
#[derive(Debug)]
pub(super) enum Object {
    /// A class, by its name with slashes.
    Class(String),
    /// A `java.lang.String`.
    Text(Text),
    /// A `java.lang.Integer`.
    Integer(i32),
    /// A `java.lang.Boolean`.
    Boolean(bool),
    /// An `Object[]`.
    Array(Mutex<Vec<Arc<Self>>>),
    /// An `android.app.NativeActivity`.
    Activity(ActivityObject),
    /// An `android.content.Intent`.
    Intent(Arc<Intent>),
    /// An `android.os.Bundle`: the intent's extras.
    Bundle(Arc<Intent>),
    /// A `java.util.Set`: the extras' names.
    Names(Arc<Intent>),
    /// An `android.content.pm.ApplicationInfo`.
    ApplicationInfo,
    /// A `java.lang.RuntimeException`, with its message.
    Exception(String),
}

/// An activity.
#[derive(Debug)]
pub(super) struct ActivityObject {
    pub(super) index: ActivityIndex,
    intent: Arc<Intent>,
}

/// A string, as native code borrows it: in Java's modified UTF-8.
#[derive(Debug)]
pub(super) struct Text(pub(super) CString);

impl Text {
    pub(super) fn new(text: &str) -> Self {
        // NUL has two bytes in modified UTF-8, so there is none within.
        Self(CString::new(cesu8::to_java_cesu8(text).into_owned()).unwrap_or_default())
    }

    fn to_text(&self) -> String {
        cesu8::from_java_cesu8(self.0.as_bytes())
            .map_or_else(|_| "\u{fffd}".to_owned(), |text| text.into_owned())
    }
}

impl Object {
    pub(super) fn activity(index: ActivityIndex, intent: Intent) -> Self {
        Self::Activity(ActivityObject {
            index,
            intent: Arc::new(intent),
        })
    }

    pub(super) fn text(text: &str) -> Arc<Self> {
        Arc::new(Self::Text(Text::new(text)))
    }

    /// The name of its class.
    pub(super) fn class(&self) -> &'static str {
        match self {
            Self::Class(_) => "java/lang/Class",
            Self::Text(_) => "java/lang/String",
            Self::Integer(_) => "java/lang/Integer",
            Self::Boolean(_) => "java/lang/Boolean",
            Self::Array(_) => "[Ljava/lang/Object;",
            Self::Activity(_) => "android/app/NativeActivity",
            Self::Intent(_) => "android/content/Intent",
            Self::Bundle(_) => "android/os/Bundle",
            Self::Names(_) => "java/util/Set",
            Self::ApplicationInfo => "android/content/pm/ApplicationInfo",
            Self::Exception(_) => "java/lang/RuntimeException",
        }
    }

    /// Whether one of class `sub` may be used where class `class` is expected.
    pub(super) fn extends(sub: &str, class: &str) -> bool {
        sub == class
            || class == "java/lang/Object"
            || (sub == "android/app/NativeActivity"
                && ["android/app/Activity", "android/content/Context"].contains(&class))
            || (sub == "java/lang/RuntimeException" && class == "java/lang/Throwable")
    }

    fn to_java_string(&self) -> Arc<Self> {
        Self::text(&self.to_java_text())
    }

    fn to_java_text(&self) -> String {
        match self {
            Self::Text(text) => text.to_text(),
            Self::Integer(number) => number.to_string(),
            Self::Boolean(flag) => flag.to_string(),
            other => format!("{}@1", other.class()),
        }
    }
}

/// A member that the app may ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Member {
    GetIntent,
    GetApplicationInfo,
    Finish,
    CheckSelfPermission,
    RequestPermissions,
    GetDataString,
    GetExtras,
    Get,
    KeySet,
    ToArray,
    ToJavaString,
    NativeLibraryDir,
    GetMessage,
    /// One of `KeyCharacterMap` and its kin, which android-activity looks up at its start and asks only for keys.
    OfKeys,
}

/// The members that there are, by class, name and signature, as Android 10's framework has them.
const MEMBERS: [(&str, &str, &str, Member); 19] = {
    use Member::*;
    [
        (
            "android/app/NativeActivity",
            "getIntent",
            "()Landroid/content/Intent;",
            GetIntent,
        ),
        (
            "android/app/NativeActivity",
            "getApplicationInfo",
            "()Landroid/content/pm/ApplicationInfo;",
            GetApplicationInfo,
        ),
        ("android/app/NativeActivity", "finish", "()V", Finish),
        (
            "android/app/NativeActivity",
            "checkSelfPermission",
            "(Ljava/lang/String;)I",
            CheckSelfPermission,
        ),
        (
            "android/app/NativeActivity",
            "requestPermissions",
            "([Ljava/lang/String;I)V",
            RequestPermissions,
        ),
        (
            "android/content/Intent",
            "getDataString",
            "()Ljava/lang/String;",
            GetDataString,
        ),
        (
            "android/content/Intent",
            "getExtras",
            "()Landroid/os/Bundle;",
            GetExtras,
        ),
        (
            "android/os/Bundle",
            "get",
            "(Ljava/lang/String;)Ljava/lang/Object;",
            Get,
        ),
        ("android/os/Bundle", "keySet", "()Ljava/util/Set;", KeySet),
        ("java/util/Set", "toArray", "()[Ljava/lang/Object;", ToArray),
        (
            "java/lang/String",
            "toString",
            "()Ljava/lang/String;",
            ToJavaString,
        ),
        (
            "java/lang/Integer",
            "toString",
            "()Ljava/lang/String;",
            ToJavaString,
        ),
        (
            "java/lang/Boolean",
            "toString",
            "()Ljava/lang/String;",
            ToJavaString,
        ),
        (
            "android/content/pm/ApplicationInfo",
            "nativeLibraryDir",
            "Ljava/lang/String;",
            NativeLibraryDir,
        ),
        (
            "java/lang/RuntimeException",
            "getMessage",
            "()Ljava/lang/String;",
            GetMessage,
        ),
        ("android/view/KeyCharacterMap", "get", "(II)I", OfKeys),
        (
            "android/view/KeyCharacterMap",
            "getDeadChar",
            "(II)I",
            OfKeys,
        ),
        (
            "android/view/KeyCharacterMap",
            "getKeyboardType",
            "()I",
            OfKeys,
        ),
        (
            "android/view/InputDevice",
            "getDevice",
            "(I)Landroid/view/InputDevice;",
            OfKeys,
        ),
    ]
};

/// Whether Android has this class, as far as the app has to do with it.
pub(super) fn has_class(name: &str) -> bool {
    const BASES: [&str; 3] = [
        "android/app/Activity",
        "java/lang/Object",
        "java/lang/Throwable",
    ];
    BASES.contains(&name) || MEMBERS.iter().any(|member| member.0 == name)
}

/// The place of a member in the table, from 1; the identity that native code holds.
pub(super) fn find_member(class: &str, name: &str, signature: &str) -> Option<usize> {
    let found = MEMBERS
        .iter()
        .position(|member| (member.0, member.1, member.2) == (class, name, signature));
    found.map(|at| at + 1)
}

/// The member of that identity.
pub(super) fn member(id: usize) -> Option<Member> {
    MEMBERS.get(id.checked_sub(1)?).map(|member| member.3)
}

/// The result of a member: an object or null, or an exception.
pub(super) fn ask(
    object: &Object,
    member: Member,
    argument: Option<&Object>,
) -> Result<Option<Arc<Object>>, String> {
    let unpacked = |intent: &Intent| {
        if intent.unparcelable {
            return Err("android.os.BadParcelableException: ClassNotFoundException".to_owned());
        }
        Ok(())
    };
    Ok(match (object, member) {
        (Object::Activity(activity), Member::GetIntent) => {
            Some(Arc::new(Object::Intent(Arc::clone(&activity.intent))))
        }
        (Object::Activity(_), Member::GetApplicationInfo) => {
            Some(Arc::new(Object::ApplicationInfo))
        }
        (Object::Activity(activity), Member::Finish) => {
            note_finish(activity.index, Finish::Java);
            None
        }
        (Object::Activity(_), Member::CheckSelfPermission) => {
            let may = argument.is_some_and(is_microphone) && wearer().allows();
            // PackageManager's PERMISSION_GRANTED and PERMISSION_DENIED.
            Some(Arc::new(Object::Integer(if may { 0 } else { -1 })))
        }
        (Object::Activity(_), Member::RequestPermissions) => {
            let Some(Object::Array(names)) = argument else {
                return Err("java.lang.NullPointerException".to_owned());
            };
            let names = names.lock().unwrap_or_else(PoisonError::into_inner);
            let names: Vec<String> = names.iter().map(|name| name.to_java_text()).collect();
            if names != ASKED_FOR {
                return Err(format!("java.lang.IllegalArgumentException: {names:?}"));
            }
            wearer().is_asked.store(true, Relaxed);
            None
        }
        (Object::Intent(intent), Member::GetDataString) => intent.data.as_deref().map(Object::text),
        (Object::Intent(intent), Member::GetExtras) => (intent.unparcelable
            || !intent.extras.is_empty())
        .then(|| Arc::new(Object::Bundle(Arc::clone(intent)))),
        (Object::Bundle(intent), Member::Get) => {
            unpacked(intent)?;
            let Some(Object::Text(name)) = argument else {
                return Ok(None);
            };
            let name = name.to_text();
            let found = intent.extras.iter().find(|(key, _)| *key == name);
            found.map(|(_, extra)| match extra {
                Extra::Text(text) => Object::text(text),
                Extra::Integer(number) => Arc::new(Object::Integer(*number)),
                Extra::Boolean(flag) => Arc::new(Object::Boolean(*flag)),
            })
        }
        (Object::Bundle(intent), Member::KeySet) => {
            unpacked(intent)?;
            Some(Arc::new(Object::Names(Arc::clone(intent))))
        }
        (Object::Names(intent), Member::ToArray) => {
            let names = intent.extras.iter().map(|(name, _)| Object::text(name));
            Some(Arc::new(Object::Array(Mutex::new(names.collect()))))
        }
        (object, Member::ToJavaString) => Some(object.to_java_string()),
        (Object::ApplicationInfo, Member::NativeLibraryDir) => {
            Some(Object::text(LIBRARIES.get().map_or("", String::as_str)))
        }
        (Object::Exception(message), Member::GetMessage) => Some(Object::text(message)),
        (object, member) => {
            return Err(format!("{member:?} was asked of a {}", object.class()));
        }
    })
}

/// The wearer, as REHEARSAL_WEARER says: `allows` the microphone once they are asked, has `allowed` it before, or refuses it.
struct Wearer {
    is_asked: AtomicBool,
    says: String,
}

impl Wearer {
    fn allows(&self) -> bool {
        match self.says.as_str() {
            "allowed" => true,
            "allows" => self.is_asked.load(Relaxed),
            _ => false,
        }
    }
}

fn wearer() -> &'static Wearer {
    static WEARER: OnceLock<Wearer> = OnceLock::new();
    WEARER.get_or_init(|| Wearer {
        is_asked: AtomicBool::new(false),
        says: std::env::var("REHEARSAL_WEARER").unwrap_or_default(),
    })
}

/// What the app asks the wearer for, all at once: of two requests at the same time Android cancels one.
const ASKED_FOR: [&str; 4] = [
    "android.permission.RECORD_AUDIO",
    "com.oculus.permission.BODY_TRACKING",
    "com.oculus.permission.FACE_TRACKING",
    "com.oculus.permission.EYE_TRACKING",
];

fn is_microphone(name: &Object) -> bool {
    matches!(name, Object::Text(text) if text.to_text() == "android.permission.RECORD_AUDIO")
}

static LIBRARIES: OnceLock<String> = OnceLock::new();

/// The folder that `ApplicationInfo.nativeLibraryDir` names.
pub(super) fn set_library_folder(folder: &str) {
    let _ = LIBRARIES.set(folder.to_owned());
}

/// The caller that asked an activity to finish.
#[derive(Debug, Clone, Copy)]
pub(super) enum Finish {
    /// Java's `Activity.finish`, which the app calls.
    Java,
    /// `ANativeActivity_finish`, which android-activity calls when the app's main function returns.
    Native,
}

/// For each activity, how often it was asked to finish, by each caller.
static FINISHES: Mutex<Vec<[u32; 2]>> = Mutex::new(Vec::new());

fn finishes_locked() -> MutexGuard<'static, Vec<[u32; 2]>> {
    FINISHES.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(super) fn note_activity(index: ActivityIndex) {
    let mut finishes = finishes_locked();
    let count = finishes.len().max(index + 1);
    finishes.resize(count, [0; 2]);
}

pub(super) fn note_finish(activity: ActivityIndex, by: Finish) {
    if let Some(counts) = finishes_locked().get_mut(activity) {
        counts[by as usize] += 1;
    }
}

pub(super) fn finishes() -> Vec<[u32; 2]> {
    finishes_locked().clone()
}
