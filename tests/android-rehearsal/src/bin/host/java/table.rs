//! The machine's two tables of functions, as native code calls them. What is not in them is null, which jni-rs reports.

use super::objects::{self, Object, Text};
use super::references as held;
use jni_sys::{
    JNI_EDETACHED, JNI_FALSE, JNI_OK, JNI_TRUE, JNI_VERSION_1_6, JNIEnv, JNIInvokeInterface_,
    JNINativeInterface_, JavaVM, jarray, jboolean, jclass, jfieldID, jint, jmethodID, jobject,
    jobjectArray, jobjectRefType, jsize, jstring, jthrowable, jvalue,
};
use std::ffi::{CStr, c_char, c_void};
use std::ptr::null_mut;
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

/// Tables that every thread reads and none writes.
struct Tables {
    native: JNINativeInterface_,
    invoke: JNIInvokeInterface_,
}

/// What the app is given: pointers to pointers to the tables.
struct Pointers {
    env: JNIEnv,
    vm: JavaVM,
}

// SAFETY: constant tables of functions, and pointers to them.
unsafe impl Send for Tables {}
// SAFETY: as above.
unsafe impl Sync for Tables {}
// SAFETY: as above.
unsafe impl Send for Pointers {}
// SAFETY: as above.
unsafe impl Sync for Pointers {}

static TABLES: LazyLock<Tables> = LazyLock::new(|| Tables {
    native: native_table(),
    invoke: invoke_table(),
});

static POINTERS: LazyLock<Pointers> = LazyLock::new(|| Pointers {
    env: &raw const TABLES.native,
    vm: &raw const TABLES.invoke,
});

pub(super) fn env() -> *mut JNIEnv {
    (&raw const POINTERS.env).cast_mut()
}

pub(super) fn vm() -> *mut JavaVM {
    (&raw const POINTERS.vm).cast_mut()
}

fn native_table() -> JNINativeInterface_ {
    // SAFETY: null pointers and functions that are not there.
    let mut table: JNINativeInterface_ = unsafe { std::mem::zeroed() };
    table.GetVersion = Some(get_version);
    table.FindClass = Some(find_class);
    table.GetObjectClass = Some(get_object_class);
    table.IsAssignableFrom = Some(is_assignable_from);
    table.IsInstanceOf = Some(is_instance_of);
    table.IsSameObject = Some(is_same_object);
    table.GetMethodID = Some(get_method_id);
    table.GetStaticMethodID = Some(get_method_id);
    table.GetFieldID = Some(get_field_id);
    table.CallObjectMethodA = Some(call_object_method);
    table.CallIntMethodA = Some(call_int_method);
    table.CallVoidMethodA = Some(call_void_method);
    table.GetObjectField = Some(get_object_field);
    table.NewStringUTF = Some(new_string);
    table.GetStringUTFChars = Some(get_string_chars);
    table.ReleaseStringUTFChars = Some(release_string_chars);
    table.GetStringUTFLength = Some(get_string_length);
    table.NewObjectArray = Some(new_array);
    table.GetArrayLength = Some(get_array_length);
    table.GetObjectArrayElement = Some(get_array_element);
    table.SetObjectArrayElement = Some(set_array_element);
    table.ExceptionCheck = Some(exception_check);
    table.ExceptionOccurred = Some(exception_occurred);
    table.ExceptionDescribe = Some(exception_describe);
    table.ExceptionClear = Some(exception_clear);
    table.PushLocalFrame = Some(push_local_frame);
    table.PopLocalFrame = Some(pop_local_frame);
    table.EnsureLocalCapacity = Some(ensure_local_capacity);
    table.NewGlobalRef = Some(new_global_ref);
    table.DeleteGlobalRef = Some(delete_global_ref);
    table.NewLocalRef = Some(new_local_ref);
    table.DeleteLocalRef = Some(delete_local_ref);
    table.GetObjectRefType = Some(get_object_ref_type);
    table.GetJavaVM = Some(get_java_vm);
    table
}

fn invoke_table() -> JNIInvokeInterface_ {
    JNIInvokeInterface_ {
        reserved0: null_mut(),
        reserved1: null_mut(),
        reserved2: null_mut(),
        DestroyJavaVM: None,
        AttachCurrentThread: Some(attach),
        DetachCurrentThread: Some(detach),
        GetEnv: Some(get_env),
        AttachCurrentThreadAsDaemon: Some(attach),
    }
}

unsafe extern "system" fn attach(
    _: *mut JavaVM,
    env_out: *mut *mut c_void,
    _: *mut c_void,
) -> jint {
    held::attach();
    // SAFETY: the caller's place for it.
    unsafe { *env_out = env().cast() };
    JNI_OK
}

unsafe extern "system" fn detach(_: *mut JavaVM) -> jint {
    held::detach();
    JNI_OK
}

unsafe extern "system" fn get_env(_: *mut JavaVM, env_out: *mut *mut c_void, _: jint) -> jint {
    let (found, answer) = if held::is_attached() {
        (env(), JNI_OK)
    } else {
        (null_mut(), JNI_EDETACHED)
    };
    // SAFETY: the caller's place for it.
    unsafe { *env_out = found.cast() };
    answer
}

unsafe extern "system" fn get_version(_: *mut JNIEnv) -> jint {
    JNI_VERSION_1_6
}

unsafe extern "system" fn get_java_vm(_: *mut JNIEnv, out: *mut *mut JavaVM) -> jint {
    // SAFETY: the caller's place for it.
    unsafe { *out = vm() };
    JNI_OK
}

/// A text that the caller gives, in modified UTF-8.
fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: a string of C's, which lives during the call.
    let bytes = unsafe { CStr::from_ptr(pointer) }.to_bytes();
    cesu8::from_java_cesu8(bytes).map_or_else(
        |_| {
            held::fault("a string of native code is not modified UTF-8".to_owned());
            String::new()
        },
        |text| text.into_owned(),
    )
}

/// Only the functions about exceptions and references may be called while one is pending.
fn no_exception(function: &str) {
    if held::exception().is_some() {
        held::fault(format!("{function} was called with an exception pending"));
    }
}

fn class_of(reference: jclass) -> String {
    match held::get(reference).as_deref() {
        Some(Object::Class(name)) => name.clone(),
        _ => {
            held::fault("no class where one is wanted".to_owned());
            String::new()
        }
    }
}

unsafe extern "system" fn find_class(_: *mut JNIEnv, name: *const c_char) -> jclass {
    no_exception("FindClass");
    let name = text(name);
    if !objects::has_class(&name) {
        held::fault(format!("Android has no class {name}"));
        held::throw(format!("java.lang.NoClassDefFoundError: {name}"));
        return null_mut();
    }
    held::local(Some(Arc::new(Object::Class(name))))
}

unsafe extern "system" fn get_object_class(_: *mut JNIEnv, object: jobject) -> jclass {
    no_exception("GetObjectClass");
    let class = held::get(object).map(|object| Object::Class(object.class().to_owned()));
    held::local(class.map(Arc::new))
}

unsafe extern "system" fn is_assignable_from(
    _: *mut JNIEnv,
    sub: jclass,
    class: jclass,
) -> jboolean {
    jboolean::from(Object::extends(&class_of(sub), &class_of(class)))
}

unsafe extern "system" fn is_instance_of(
    _: *mut JNIEnv,
    object: jobject,
    class: jclass,
) -> jboolean {
    let class = class_of(class);
    // Null is an instance of everything.
    jboolean::from(held::get(object).is_none_or(|object| Object::extends(object.class(), &class)))
}

unsafe extern "system" fn is_same_object(_: *mut JNIEnv, a: jobject, b: jobject) -> jboolean {
    jboolean::from(match (held::get(a), held::get(b)) {
        (Some(a), Some(b)) => match (&*a, &*b) {
            (Object::Class(a), Object::Class(b)) => a == b,
            _ => Arc::ptr_eq(&a, &b),
        },
        (None, None) => true,
        _ => false,
    })
}

fn member_id(class: jclass, name: *const c_char, signature: *const c_char) -> usize {
    no_exception("GetMethodID or GetFieldID");
    let (class, name, signature) = (class_of(class), text(name), text(signature));
    objects::find_member(&class, &name, &signature).unwrap_or_else(|| {
        let what = format!("{class}.{name}{signature}");
        held::fault(format!("Android has no {what}"));
        held::throw(format!("java.lang.NoSuchMethodError: {what}"));
        0
    })
}

unsafe extern "system" fn get_method_id(
    _: *mut JNIEnv,
    class: jclass,
    name: *const c_char,
    signature: *const c_char,
) -> jmethodID {
    std::ptr::without_provenance_mut(member_id(class, name, signature))
}

unsafe extern "system" fn get_field_id(
    _: *mut JNIEnv,
    class: jclass,
    name: *const c_char,
    signature: *const c_char,
) -> jfieldID {
    std::ptr::without_provenance_mut(member_id(class, name, signature))
}

/// The result of an object's member; nothing, with an exception pending, where it throws.
fn ask(object: jobject, id: usize, argument: Option<Arc<Object>>) -> Option<Arc<Object>> {
    no_exception("a call of a method");
    let answer = match (held::get(object), objects::member(id)) {
        (Some(object), Some(member)) => objects::ask(&object, member, argument.as_deref()),
        (None, _) => Err("java.lang.NullPointerException".to_owned()),
        (_, None) => {
            held::fault("no member where one is wanted".to_owned());
            Err("java.lang.NoSuchMethodError".to_owned())
        }
    };
    answer.unwrap_or_else(|exception| {
        held::throw(exception);
        None
    })
}

unsafe extern "system" fn call_object_method(
    _: *mut JNIEnv,
    object: jobject,
    method: jmethodID,
    arguments: *const jvalue,
) -> jobject {
    held::local(ask(object, method.addr(), argument_of(method, arguments)))
}

/// The first argument of a method that takes an object.
fn argument_of(method: jmethodID, arguments: *const jvalue) -> Option<Arc<Object>> {
    use objects::Member::{CheckSelfPermission, Get, RequestPermissions};
    let takes_one = matches!(
        objects::member(method.addr()),
        Some(Get | CheckSelfPermission | RequestPermissions)
    );
    (takes_one && !arguments.is_null())
        // SAFETY: the method's signature says that there is one, and that it is an object.
        .then(|| held::get(unsafe { (*arguments).l }))
        .flatten()
}

unsafe extern "system" fn call_int_method(
    _: *mut JNIEnv,
    object: jobject,
    method: jmethodID,
    arguments: *const jvalue,
) -> jint {
    match ask(object, method.addr(), argument_of(method, arguments)).as_deref() {
        Some(Object::Integer(number)) => *number,
        _ => 0,
    }
}

unsafe extern "system" fn call_void_method(
    _: *mut JNIEnv,
    object: jobject,
    method: jmethodID,
    arguments: *const jvalue,
) {
    ask(object, method.addr(), argument_of(method, arguments));
}

unsafe extern "system" fn get_object_field(
    _: *mut JNIEnv,
    object: jobject,
    field: jfieldID,
) -> jobject {
    held::local(ask(object, field.addr(), None))
}

unsafe extern "system" fn new_string(_: *mut JNIEnv, bytes: *const c_char) -> jstring {
    no_exception("NewStringUTF");
    held::local(Some(Object::text(&text(bytes))))
}

unsafe extern "system" fn get_string_chars(
    _: *mut JNIEnv,
    string: jstring,
    is_copy: *mut jboolean,
) -> *const c_char {
    no_exception("GetStringUTFChars");
    if !is_copy.is_null() {
        // SAFETY: the caller's place for it.
        unsafe { *is_copy = JNI_FALSE };
    }
    let Some(object) = held::get(string) else {
        return std::ptr::null();
    };
    match &*object {
        Object::Text(Text(text)) => held::borrow(Arc::clone(&object), text),
        other => {
            held::fault(format!("a {} was read as a string", other.class()));
            std::ptr::null()
        }
    }
}

unsafe extern "system" fn release_string_chars(_: *mut JNIEnv, _: jstring, chars: *const c_char) {
    held::give_back(chars);
}

unsafe extern "system" fn get_string_length(_: *mut JNIEnv, string: jstring) -> jsize {
    match held::get(string).as_deref() {
        Some(Object::Text(Text(text))) => jsize::try_from(text.as_bytes().len()).unwrap_or(0),
        _ => 0,
    }
}

unsafe extern "system" fn new_array(
    _: *mut JNIEnv,
    length: jsize,
    class: jclass,
    item: jobject,
) -> jobjectArray {
    no_exception("NewObjectArray");
    // Its items are of that class.
    class_of(class);
    let items = held::get(item).map(|item| vec![item; usize::try_from(length).unwrap_or(0)]);
    let items = Mutex::new(items.unwrap_or_default());
    held::local(Some(Arc::new(Object::Array(items))))
}

unsafe extern "system" fn get_array_length(_: *mut JNIEnv, array: jarray) -> jsize {
    match held::get(array).as_deref() {
        Some(Object::Array(items)) => jsize::try_from(locked(items).len()).unwrap_or(0),
        _ => 0,
    }
}

unsafe extern "system" fn get_array_element(
    _: *mut JNIEnv,
    array: jobjectArray,
    at: jsize,
) -> jobject {
    no_exception("GetObjectArrayElement");
    match held::get(array).as_deref() {
        Some(Object::Array(items)) => {
            let item = usize::try_from(at).ok();
            held::local(item.and_then(|at| locked(items).get(at).cloned()))
        }
        _ => null_mut(),
    }
}

unsafe extern "system" fn set_array_element(
    _: *mut JNIEnv,
    array: jobjectArray,
    at: jsize,
    item: jobject,
) {
    no_exception("SetObjectArrayElement");
    let (array, item) = (held::get(array), held::get(item));
    let place = usize::try_from(at).ok();
    if let (Some(Object::Array(items)), Some(item), Some(at)) = (array.as_deref(), item, place)
        && let Some(place) = locked(items).get_mut(at)
    {
        *place = item;
    } else {
        held::throw(format!("java.lang.ArrayIndexOutOfBoundsException: {at}"));
    }
}

fn locked(items: &Mutex<Vec<Arc<Object>>>) -> MutexGuard<'_, Vec<Arc<Object>>> {
    items.lock().unwrap_or_else(PoisonError::into_inner)
}

unsafe extern "system" fn exception_check(_: *mut JNIEnv) -> jboolean {
    if held::exception().is_some() {
        JNI_TRUE
    } else {
        JNI_FALSE
    }
}

unsafe extern "system" fn exception_occurred(_: *mut JNIEnv) -> jthrowable {
    held::local(held::exception())
}

unsafe extern "system" fn exception_describe(_: *mut JNIEnv) {}

unsafe extern "system" fn exception_clear(_: *mut JNIEnv) {
    held::clear_exception();
}

unsafe extern "system" fn push_local_frame(_: *mut JNIEnv, capacity: jint) -> jint {
    held::push_frame(usize::try_from(capacity).unwrap_or(0));
    JNI_OK
}

unsafe extern "system" fn pop_local_frame(_: *mut JNIEnv, result: jobject) -> jobject {
    held::pop_frame(result)
}

unsafe extern "system" fn ensure_local_capacity(_: *mut JNIEnv, capacity: jint) -> jint {
    held::promise_more(usize::try_from(capacity).unwrap_or(0));
    JNI_OK
}

unsafe extern "system" fn new_global_ref(_: *mut JNIEnv, object: jobject) -> jobject {
    held::get(object).map_or(null_mut(), held::global)
}

unsafe extern "system" fn delete_global_ref(_: *mut JNIEnv, object: jobject) {
    held::delete_global(object);
}

unsafe extern "system" fn new_local_ref(_: *mut JNIEnv, object: jobject) -> jobject {
    held::local(held::get(object))
}

unsafe extern "system" fn delete_local_ref(_: *mut JNIEnv, object: jobject) {
    held::delete_local(object);
}

unsafe extern "system" fn get_object_ref_type(_: *mut JNIEnv, object: jobject) -> jobjectRefType {
    held::kind(object)
}
