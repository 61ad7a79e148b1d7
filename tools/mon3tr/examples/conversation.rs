//! Two people who talk from home: one behind a symmetric NAT, in a simulated headset that a script moves; one behind a cone NAT, at a window. Both are real
//! `mon3tr call` processes, which leave what they saw and heard in a folder.
//!
//! ```sh
//! eval "$(./run env)"; cargo build -p mon3tr --bin mon3tr --example conversation
//! target/debug/examples/conversation 300 out/talk ada.m3a ada.wav bob.m3a bob.wav bob.bvh
//! ```

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use test_support::internet::{CallWorld, HomeKind, Receiving};
use test_support::monado::{Compositor, Controller, Driver, Monado, Pose, Scripted};
use test_support::program::through_runner;

/// How long it may take until both have ended after their time.
const PATIENCE: Duration = Duration::from_secs(120);

const USAGE: &str =
    "usage: conversation SECONDS FOLDER WEARER.m3a WEARER.wav OTHER.m3a OTHER.wav OTHER.bvh";

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [
        seconds,
        folder,
        wearer,
        wearers_voice,
        other,
        others_voice,
        motion,
    ] = &arguments[..]
    else {
        panic!("{USAGE}")
    };
    let length: f32 = seconds.parse().expect(USAGE);
    let folder = Path::new(folder);
    std::fs::create_dir_all(folder).expect("a folder");
    let mon3tr = mon3tr();
    let mut world = CallWorld::open(&mon3tr).expect("network namespaces");
    let monado = Monado::start(Driver::Remote, Compositor::Null).expect("a Monado");
    let mut head = monado.head();
    head.send(&at(0.0));
    let kinds = [HomeKind::Symmetric, HomeKind::Cone];
    let [here, there] = kinds.map(|kind| world.internet().home(kind));
    let files = ["wearer", "other"].map(|who| {
        [folder.join(who), folder.join(format!("{who}.wav"))].map(|path| path.display().to_string())
    });
    let [
        [wearers_pictures, wearer_heard],
        [others_pictures, other_heard],
    ] = &files;
    // The whole conversation is heard by both: the one who opened the call hangs up first.
    let mut first = world.call(
        &here,
        None,
        &[
            "--name",
            "Wearer",
            "--avatar",
            wearer,
            "--voice",
            wearers_voice,
            "--display",
            "xr",
            "--size",
            "512x512",
            "--out",
            wearers_pictures,
            "--sound",
            wearer_heard,
            "--seconds",
            seconds,
        ],
        &mut monado.client(&mon3tr),
    );
    let link = first.program.word_after("mon3tr call ");
    let mut second = world.call(
        &there,
        Some(&link),
        &[
            "--name",
            "Other",
            "--avatar",
            other,
            "--voice",
            others_voice,
            "--motion",
            motion,
            "--display",
            "offscreen",
            "--view",
            "face",
            "--size",
            "640x480",
            "--out",
            others_pictures,
            "--sound",
            other_heard,
            "--seconds",
            seconds,
        ],
        &mut through_runner(&mon3tr),
    );
    let begun = Instant::now();
    let mut figures = [None, None];
    while figures.contains(&None) {
        head.send(&at(begun.elapsed().as_secs_f32()));
        for (figures, person) in figures.iter_mut().zip([&mut first, &mut second]) {
            if figures.is_none() {
                *figures = ended(person);
            }
        }
        let late = begun.elapsed() > Duration::from_secs_f32(length) + PATIENCE;
        assert!(
            !late,
            "it does not end:\n{}\n{}",
            first.program.said(),
            second.program.said()
        );
    }
    for (who, figures) in ["wearer", "other"]
        .into_iter()
        .zip(figures.into_iter().flatten())
    {
        let file = folder.join(format!("{who}.json"));
        std::fs::write(&file, format!("{figures:#}")).expect("figures can be written");
        let received = &figures["received"]["call"];
        println!(
            "the {who} took {} frames of the other in {} s; mouth to ear {} ms, heard and seen apart {} ms, in the median; by {}",
            received["released"],
            received["live_seconds"],
            received["latency"]["mouth_to_ear"]["p50_ms"],
            received["latency"]["voice_apart"]["p50_ms"],
            received["received"]["path"]["local"]["kind"],
        );
    }
}

/// The figures of someone whose call is over.
fn ended(person: &mut Receiving) -> Option<Value> {
    match person.all_figures(Duration::from_millis(8))? {
        Ok(figures) => Some(figures),
        Err(why) => panic!("{why}"),
    }
}

/// Someone who talks with their hands: the head turns and nods, the hands move before the body, and rest now and then.
fn at(seconds: f32) -> Scripted {
    let wave = |every: f32, phase: f32| (std::f32::consts::TAU * (seconds / every + phase)).sin();
    let head = Pose::at(0.03 * wave(7.0, 0.0), 1.6 + 0.01 * wave(3.1, 0.0), 0.0).turned(
        glam::Quat::from_euler(
            glam::EulerRot::YXZ,
            0.3 * wave(9.0, 0.2),
            0.12 * wave(2.3, 0.0),
            0.0,
        ),
    );
    let talks = (0.5 + wave(13.0, 0.0)).clamp(0.0, 1.0);
    let hand = |side: f32, phase: f32| {
        let x = side * (0.24 + 0.08 * talks * wave(1.9, phase));
        let y = 0.95 + 0.3 * talks + 0.1 * talks * wave(1.3, phase);
        let z = -0.12 - 0.25 * talks + 0.05 * talks * wave(1.7, phase);
        Controller {
            hand_tracking: true,
            curls: [0.3 + 0.3 * wave(4.0, phase); 5],
            ..Controller::at(Pose::at(x, y, z))
        }
    };
    Scripted {
        stage_from_head: head,
        controllers: [hand(-1.0, 0.0), hand(1.0, 0.4)],
        ..Scripted::default()
    }
}

/// The command, built beside this example.
fn mon3tr() -> PathBuf {
    let here = std::env::current_exe().expect("the path of this program");
    let built = here.parent().and_then(|examples| examples.parent());
    let mon3tr = built.expect("a folder of examples").join("mon3tr");
    assert!(mon3tr.exists(), "{} is not built", mon3tr.display());
    mon3tr
}
