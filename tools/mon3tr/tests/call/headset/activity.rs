//! The app's receiver as Android drives it, on Monado: a call through pauses and to the activity's end, and what it does without one.
//!
//! OpenXR's loader finds its runtime by the environment, so the activity has a process of its own: this program again, with the test
//! below that is ignored otherwise, which takes Android's events from its standard input.

use super::viewer::monado;
use crate::house::{House, Program, count, wait_for};
use android_app::launch::Launch;
use android_app::lifecycle::{Driver, Event};
use android_app::receiver::{Device, HeadsetReceiver, WearersLeave};
use android_app::storage::Folders;
use link_protocol::RoomLink;
use renderer_openxr::runtime::Runtime;
use std::io::{BufRead, Write};
use std::path::Path;
use std::process::ChildStdin;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::sleep;
use std::time::{Duration, Instant};
use test_support::monado::Monado;
use test_support::service::attended;

/// The room's link, if there is one.
const ROOM: &str = "MON3TR_TEST_ROOM";
/// Seconds to measure, if that is the task.
const PROFILE: &str = "MON3TR_TEST_PROFILE";
/// The app's folder.
const FOLDER: &str = "MON3TR_TEST_FOLDER";

/// How long Android may wait for the answer to a pause, with room for a machine that does much else: the app waits for the GPU for 80 ms
/// at most.
const PAUSED_WITHIN: Duration = Duration::from_millis(500);
/// And for an activity's end.
const ENDED_WITHIN: Duration = Duration::from_secs(3);

/// An activity in a process of its own.
struct Activity {
    program: Program,
    events: ChildStdin,
    answers: usize,
}

impl Activity {
    fn make(house: &House, monado: &Monado, folder: &Path, task: Option<(&str, &str)>) -> Self {
        if let Some((ROOM, link)) = task {
            // Who wears it has been there: nothing is asked.
            let link: RoomLink = link.parse().expect("a link");
            let known = Folders::new(folder, folder).servers();
            known.add(link.server(), None).expect("it is kept");
        }
        // As it was started: what runs may be a dynamic linker.
        let own = std::env::args_os().next().expect("this program");
        let mut command = monado.client(own);
        command
            .args(["--exact", "headset::activity::an_activity", "--ignored"])
            .args(["--nocapture", "--test-threads", "1"])
            .env(FOLDER, folder)
            .env_remove(ROOM)
            .env_remove(PROFILE)
            .envs(task);
        let (program, events) = Program::start_steered(house, folder, &mut command);
        Self {
            program,
            events,
            answers: 0,
        }
    }

    /// Android says something; returns when the app has answered, with the frames it had shown by then.
    fn says(&mut self, event: &str) -> u64 {
        self.answer(event);
        self.told("frames")
    }

    /// How long Android waits for the answer to what it says.
    fn takes(&mut self, event: &str) -> Duration {
        self.answer(event);
        Duration::from_millis(self.told("milliseconds"))
    }

    fn answer(&mut self, event: &str) {
        writeln!(self.events, "{event}").expect("it listens");
        self.answers += 1;
    }

    /// A figure of the last answer.
    fn told(&mut self, figure: &str) -> u64 {
        let start = format!("answer {} {figure} ", self.answers);
        let word = self.program.word_after(&start);
        word.parse().expect("a number")
    }

    fn frames(&mut self) -> u64 {
        self.says("look")
    }

    /// Until it has shown some more.
    fn shows_more(&mut self) {
        let before = self.frames();
        wait_for("frames of people", || {
            let said = self.program.said();
            assert!(!said.contains("ERROR"), "trouble instead of people");
            (self.frames() >= before + 5).then_some(())
        });
    }
}

impl Drop for Activity {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("the activity said:\n{}", self.program.said());
        }
    }
}

#[test]
fn an_activitys_call_rests_while_it_is_paused_and_ends_with_it() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let house = House::open();
        let sender = house.sender(&[]);
        let folder = tempfile::tempdir().expect("a folder");
        let room = Some((ROOM, sender.viewers.as_str()));
        let mut activity = Activity::make(&house, &monado, folder.path(), room);
        activity.says("start");
        assert_eq!(activity.says("resume"), 0, "not at once");
        activity.shows_more();
        for _ in 0..2 {
            let paused = activity.says("pause");
            sleep(Duration::from_secs(1));
            let later = activity.frames();
            // The last frame before may have been counted as it was being ended.
            assert!(later <= paused + 1, "no frames: {paused}, then {later}");
            activity.says("low memory");
            activity.says("resume");
            activity.shows_more();
        }
        for event in ["pause", "stop", "destroy"] {
            activity.says(event);
        }
        activity.program.says("the activity is over", 1);
        let said = activity.program.said();
        assert!(said.contains("a call of "), "told in the log:\n{said}");
        assert!(!said.contains("ERROR"), "no trouble:\n{said}");
        let sent = sender.program.ends();
        assert_eq!(count(&sent, "joined"), 1, "joined once: {sent:#}");
        let size = std::fs::metadata(&house.avatar).expect("it is there").len();
        let served = house.metric("mon3tr_package_bytes_sent_total");
        assert_eq!(served, size, "fetched once");
    });
}

#[test]
fn an_activity_waits_for_a_sender_and_for_the_next_call() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let house = House::open();
        let sender = house.sender(&[]);
        let (link, own) = (sender.viewers.clone(), sender.own.clone());
        sender.program.ends();
        let folder = tempfile::tempdir().expect("a folder");
        let room = Some((ROOM, link.as_str()));
        let mut activity = Activity::make(&house, &monado, folder.path(), room);
        activity.says("start");
        activity.says("resume");
        activity.program.says("waiting for the sender", 1);
        for calls in 1..=2 {
            let avatar = house.avatar.to_str().expect("UTF-8");
            let sender = house.send(&["--room", &own, "--avatar", avatar]);
            activity.shows_more();
            sender.ends();
            activity.program.says("a call of ", calls);
            activity.program.says("waiting for the sender", 1 + calls);
        }
        // In the middle of waiting.
        for event in ["pause", "stop", "destroy"] {
            activity.says(event);
        }
        activity.program.says("the activity is over", 1);
    });
}

#[test]
fn an_activity_that_gets_ready_pauses_and_ends_at_once() {
    let Some((monado, _head)) = monado() else {
        return;
    };
    let house = House::open();
    let sender = house.sender(&[]);
    let folder = tempfile::tempdir().expect("a folder");
    let room = Some((ROOM, sender.viewers.as_str()));
    let mut while_it_gets_ready = 0;
    for moment in 0..8 {
        let mut activity = Activity::make(&house, &monado, folder.path(), room);
        activity.says("start");
        activity.says("resume");
        // Once to say what is waited for, and once more for the call.
        activity.program.says("headset: ", 2);
        sleep(Duration::from_millis(100) * moment);
        for _ in 0..2 {
            let pause = activity.takes("pause");
            assert!(pause < PAUSED_WITHIN, "moment {moment}: {pause:?}");
            activity.says("resume");
        }
        while_it_gets_ready += usize::from(activity.frames() == 0);
        let events = ["pause", "stop", "destroy"].map(|event| activity.takes(event));
        println!("moment {moment}: {events:?}");
        let [pause, stop, destroy] = events;
        assert!(pause < PAUSED_WITHIN, "moment {moment}: {pause:?}");
        assert!(stop < PAUSED_WITHIN, "moment {moment}: {stop:?}");
        assert!(destroy < ENDED_WITHIN, "moment {moment}: {destroy:?}");
        activity.program.says("the activity is over", 1);
        let said = activity.program.said();
        assert!(!said.contains("ERROR"), "no trouble:\n{said}");
    }
    assert!(while_it_gets_ready > 0, "it was always ready");
}

#[test]
fn an_activity_without_a_room_shows_what_is_missing_until_it_is_closed() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let house = House::open();
        let folder = tempfile::tempdir().expect("a folder");
        let mut activity = Activity::make(&house, &monado, folder.path(), None);
        activity.says("start");
        activity.says("resume");
        activity.program.says("session: visible to focused", 1);
        assert_eq!(activity.says("pause"), 0, "nobody was there");
        activity.says("resume");
        for event in ["pause", "stop", "destroy"] {
            activity.says(event);
        }
        activity.program.says("the activity is over", 1);
    });
}

#[test]
fn an_activity_measures_the_avatar_in_its_folder_and_writes_the_profile() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let house = House::open();
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::copy(&house.avatar, folder.path().join("avatar.m3a")).expect("an avatar");
        let task = Some((PROFILE, "5"));
        let mut activity = Activity::make(&house, &monado, folder.path(), task);
        activity.says("start");
        activity.says("resume");
        let profile = folder.path().join("profile");
        let finished = wait_for("the profile", || {
            std::fs::read_to_string(profile.join("finished")).ok()
        });
        assert_eq!(finished, "ok\n", "{}", activity.program.said());
        let json = std::fs::read(profile.join("profile.json")).expect("figures");
        let json: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
        assert_eq!(json["avatar"]["gaussians"], 2_000, "{json:#}");
        assert!(json["conditions"]["views"] == 2, "{json:#}");
        for name in ["profile.html", "trace.json", "profile.txt"] {
            let size = std::fs::metadata(profile.join(name)).map(|file| file.len());
            assert!(size.is_ok_and(|size| size > 500), "{name}");
        }
        wait_for("the activity's own end", || {
            activity.frames();
            let said = activity.program.said();
            said.contains("the activity has ended by itself")
                .then_some(())
        });
        for event in ["pause", "stop", "destroy"] {
            activity.says(event);
        }
        activity.program.says("the activity is over", 1);
    });
}

/// Not a test: an activity, for the tests above.
#[test]
#[ignore = "run by the tests above, in a process of its own"]
fn an_activity() {
    let Some(folder) = std::env::var_os(FOLDER) else {
        return;
    };
    env_logger::Builder::new()
        .parse_filters("warn,main=info,link=info,app=info,renderer_vulkan=debug,renderer_splat=debug,renderer_openxr=debug")
        .init();
    let variable = |name: &str| std::env::var(name).ok();
    let (room, profile) = (variable(ROOM), variable(PROFILE));
    let extras = [("room", &room), ("profile", &profile)];
    let extras = extras
        .iter()
        .filter_map(|(name, text)| Some((*name, text.as_deref()?)));
    let launch = Launch::new(extras, None, None, Folders::new(&folder, &folder));
    let receiver = HeadsetReceiver::new(Device {
        give_memory_back: || {},
        open_xr: Box::new(Runtime::load),
        onnx_runtime: None,
        leave: Arc::new(Granted),
    });
    let frames = receiver.frames();
    let mut driver = Driver::new(receiver, launch);
    let mut told = false;
    for (number, line) in (1..).zip(std::io::stdin().lock().lines()) {
        let line = line.expect("text");
        let event = Event::ALL
            .into_iter()
            .find(|event| event.to_string() == line);
        let asked = Instant::now();
        if let Some(event) = event {
            driver.on(event);
        }
        println!(
            "answer {number} milliseconds {}",
            asked.elapsed().as_millis()
        );
        println!("answer {number} frames {}", frames.load(Relaxed));
        if driver.has_ended() && !std::mem::replace(&mut told, true) {
            println!("the activity has ended by itself");
        }
        if driver.is_over() {
            println!("the activity is over");
            println!("threads that are left: {:?}", threads());
            return;
        }
    }
}

/// A desktop's microphone needs no permission.
struct Granted;

impl WearersLeave for Granted {
    fn may_record(&self) -> bool {
        true
    }

    fn ask(&self) {}
}

/// The names of this process's threads.
fn threads() -> Vec<String> {
    let tasks = std::fs::read_dir("/proc/self/task").expect("Linux");
    let names = tasks.filter_map(|task| {
        let name = task.expect("a thread").path().join("comm");
        // It may have ended meanwhile.
        std::fs::read_to_string(name).ok()
    });
    names.map(|name| name.trim().to_owned()).collect()
}
