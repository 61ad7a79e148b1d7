//! `mon3tr demo` before a camera, or what stands in for one: what becomes of the call where something fails.

use crate::command::Outcome;
use crate::place::{
    Demo, Place, can_draw, fails_naming, kill, wait_for_receiver, wait_until_it_says,
};
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Starts it, with all that it says in a file.
fn start(place: &Place, command: &mut Command) -> (Demo, PathBuf) {
    let said = place.file("said");
    let file = File::create(&said).expect("a file");
    let demo = Demo::start(command.stdout(Stdio::null()).stderr(file));
    (demo, said)
}

#[test]
fn a_demo_without_its_camera_ends_before_the_call() {
    if can_draw().is_none() {
        return;
    }
    let place = Place::make();
    let (mut demo, said) = start(&place, &mut place.demo(&["--camera", "/dev/video99"]));
    let said = fails_naming(&mut demo, &said, &["there is no camera /dev/video99"]);
    assert!(!said.contains("the sender"), "there was no call:\n{said}");
    place.assert_left_clean();
}

#[test]
fn a_demo_whose_sender_dies_says_so_and_ends() {
    if can_draw().is_none() {
        return;
    }
    let place = Place::make();
    let (mut demo, said) = start(&place, &mut place.demo(&[]));
    wait_for_receiver(&mut demo, &said);
    kill(&place, " send ");
    fails_naming(&mut demo, &said, &["`mon3tr send` failed", "signal: 9"]);
    place.assert_left_clean();
}

#[test]
fn a_demo_that_is_asked_to_end_leaves_nothing_running() {
    if can_draw().is_none() {
        return;
    }
    let place = Place::make();
    let (mut demo, said) = start(&place, &mut place.demo(&[]));
    wait_for_receiver(&mut demo, &said);
    demo.ask_to_end();
    fails_naming(&mut demo, &said, &["stopped before the end"]);
    place.assert_left_clean();
}

#[test]
fn ctrl_c_keeps_what_a_demo_has_shown() {
    if can_draw().is_none() {
        return;
    }
    let place = Place::make();
    let mut command = place.demo(&[]);
    // A terminal's Ctrl-C goes to all processes of its group.
    command
        .process_group(0)
        .env("RUST_LOG", "app_session=debug");
    let (mut demo, said) = start(&place, &mut command);
    wait_until_it_says("the first picture", &mut demo, &said);
    demo.press_ctrl_c();
    fails_naming(&mut demo, &said, &["stopped before the end"]);
    let animation = place.file("pictures/animation.webp");
    assert!(has_content(&animation), "nothing of the call is kept");
    place.assert_left_clean();
}

/// A video of a person whose second half is garbage; nothing, after a line that says why, where a component is missing.
fn half_garbage(place: &Place) -> Option<PathBuf> {
    let folder = |variable: &str| std::env::var_os(variable).map(PathBuf::from);
    let found = (
        folder("MON3TR_NETWORKS"),
        folder("MON3TR_FFMPEG"),
        folder("MON3TR_FOOTAGE"),
    );
    let (Some(_), Some(ffmpeg), Some(footage)) = found else {
        let why = "MON3TR_NETWORKS, MON3TR_FFMPEG and MON3TR_FOOTAGE must all be set: ./run env";
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
        println!("skipped: {why}");
        return None;
    };
    let (whole, half) = (place.file("whole.mkv"), place.file("half.mkv"));
    let made = Command::new(ffmpeg)
        .args(["-nostdin", "-v", "error", "-i"])
        .arg(footage.join("carphone/carphone_pristine.mp4"))
        .args(["-c", "copy"])
        .arg(&whole)
        .status();
    assert!(made.expect("ffmpeg starts").success(), "ffmpeg failed");
    let mut bytes = std::fs::read(&whole).expect("the video");
    let middle = bytes.len() / 2;
    let garbage = (0_u32..).map(|k| k.wrapping_mul(2_654_435_761).to_be_bytes()[0]);
    for (byte, garbage) in bytes.iter_mut().skip(middle).zip(garbage) {
        *byte = garbage;
    }
    std::fs::write(&half, bytes).expect("a file");
    Some(half)
}

#[test]
fn a_video_that_ends_in_garbage_is_shown_as_far_as_it_goes() {
    if can_draw().is_none() {
        return;
    }
    let place = Place::make();
    let Some(video) = half_garbage(&place) else {
        return;
    };
    let video = crate::command::text(&video);
    Outcome::of(&mut place.demo(&["--camera", video])).succeeds();
    for name in ["side-by-side.webp", "animation.webp", "face.png"] {
        let picture = place.file("pictures").join(name);
        assert!(has_content(&picture), "{name} is no picture");
    }
    place.assert_left_clean();
}

fn has_content(file: &Path) -> bool {
    std::fs::metadata(file).is_ok_and(|file| file.len() > 1000)
}
