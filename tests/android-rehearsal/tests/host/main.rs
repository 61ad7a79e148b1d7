//! The host process by itself, with an app in C (`app.c`) that is compiled with the NDK's headers alone.

// The shims pass functions on to glibc by jumps of this processor's.
#![cfg(target_arch = "x86_64")]

use android_rehearsal::protocol::{Answer, Callback, Intent, Reply, Request};
use android_rehearsal::shims;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{ChildStdin, Command, Stdio};
use std::sync::mpsc::channel;
use test_support::service::LONGEST_WAIT;

/// In an order that Android calls them.
const CALLBACKS: [Callback; 15] = [
    Callback::Start,
    Callback::Resume,
    Callback::InputQueueCreated,
    Callback::NativeWindowCreated,
    Callback::FocusGained,
    Callback::ConfigurationChanged,
    Callback::LowMemory,
    Callback::NativeWindowResized,
    Callback::Pause,
    Callback::FocusLost,
    Callback::SaveInstanceState,
    Callback::NativeWindowDestroyed,
    Callback::Stop,
    Callback::InputQueueDestroyed,
    Callback::Destroy,
];

fn host(library: &Path, folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_android-host"));
    command
        .arg(library)
        .arg(folder)
        .arg("/where/libraries/are")
        .env("LD_LIBRARY_PATH", folder)
        .env("REHEARSAL_LOGCAT", folder.join("logcat"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

fn compile_app(folder: &Path) {
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/host/app.c");
    let output = Command::new("cc")
        .args(["-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(folder.join("app.so"))
        .arg(source)
        .args(["liblog.so", "libandroid.so"].map(|shim| folder.join(shim)))
        .output()
        .expect("cc can be started");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn an_app_in_c_gets_callbacks_as_androids_headers_define_them() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    shims::build(folder).expect("shims");
    compile_app(folder);
    let mut child = host(&folder.join("app.so"), folder)
        .spawn()
        .expect("the host starts");
    let mut requests = child.stdin.take().expect("piped");
    let stdout = BufReader::new(child.stdout.take().expect("piped"));
    let (sender, replies) = channel();
    std::thread::spawn(move || {
        for line in stdout.lines().map_while(Result::ok) {
            let _ = sender.send(line);
        }
    });
    let ask = |requests: &mut ChildStdin, request: &Request| -> Answer {
        let line = serde_json::to_string(request).expect("JSON");
        writeln!(requests, "{line}").expect("it listens");
        let reply = replies.recv_timeout(LONGEST_WAIT).expect("an answer");
        serde_json::from_str::<Reply>(&reply).expect("JSON").answer
    };
    // A character that Java's modified UTF-8 writes in six bytes, where UTF-8 has four.
    let link = "mon3tr://room/\u{1f600}";
    let created = ask(&mut requests, &Request::Create(Intent::view(link)));
    assert!(matches!(created, Answer::Created(0)), "{created:?}");
    for callback in CALLBACKS {
        let answer = ask(&mut requests, &Request::Callback(0, callback));
        assert!(matches!(answer, Answer::Done), "{callback}: {answer:?}");
    }
    let Answer::Census(census) = ask(&mut requests, &Request::Census) else {
        panic!("no census");
    };
    ask_to_quit(&mut requests);
    assert!(child.wait().expect("it ends").success(), "in good order");

    let logcat = std::fs::read(folder.join("logcat")).expect("a log");
    let lines: Vec<String> = (logcat.split(|byte| *byte == b'\n'))
        .filter_map(|line| cesu8::from_java_cesu8(line).ok())
        .filter_map(|line| Some(line.split_once("I app     : ")?.1.to_owned()))
        .collect();
    let create = format!(
        "onCreate: API level 32, state nothing of 0, {0}/internal, {0}/external, /obb",
        folder.display()
    );
    let expected = [
        create.as_str(),
        "JNI 10006",
        "link mon3tr://room/\u{1f600}",
        "no such method: not found, exception 1",
        "onStart",
        "onResume",
        "onInputQueueCreated something",
        "onNativeWindowCreated something",
        "onNativeWindowResized something",
        "onContentRectChanged 1024 640",
        "onNativeWindowRedrawNeeded something",
        "onWindowFocusChanged 1",
        "onConfigurationChanged",
        "onLowMemory",
        "onNativeWindowResized something",
        "onPause",
        "onWindowFocusChanged 0",
        "onSaveInstanceState",
        "onNativeWindowDestroyed something",
        "onStop",
        "onInputQueueDestroyed something",
        "onDestroy",
    ];
    assert_eq!(lines, expected, "the callbacks of the app");
    assert_eq!(census.java.finishes, [[0, 1]], "finished natively, once");
    assert_eq!(
        census.java.faults,
        ["Android has no android/content/Intent.getDataString()I"],
        "what the app did wrong"
    );
    assert_eq!(census.java.borrowed_strings, 0, "the string was given back");
    assert_eq!(census.java.global_references, 0, "the activity is gone");
}

fn ask_to_quit(requests: &mut ChildStdin) {
    let line = serde_json::to_string(&Request::Quit).expect("JSON");
    writeln!(requests, "{line}").expect("it listens");
}

#[test]
fn a_library_that_is_no_app_is_refused_by_its_name() {
    let place = tempfile::tempdir().expect("a folder");
    shims::build(place.path()).expect("shims");
    let library = place.path().join("liblog.so");
    let output = host(&library, place.path())
        .output()
        .expect("the host starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "it has no entry point");
    assert!(
        said.contains("the library has no ANativeActivity_onCreate"),
        "{said}"
    );
}
