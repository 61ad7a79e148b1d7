//! A small capture of the demo person, whose raw material `MON3TR_MAKEHUMAN` names, read back.

#![expect(
    clippy::cast_possible_truncation,
    reason = "pixels and metres of small scenes"
)]

use capture::Capture;
use capture_synthesis::noise::Noise;
use capture_synthesis::performance;
use capture_synthesis::ring::Ring;
use capture_synthesis::synthesise::{Progress, SynthesisOptions, synthesise};
use glam::Vec3;
use reconstruct::Person;
use serde_json::Value;
use spmm3::{Joint, MotionClip};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use synthetic_person::real_files::makehuman;

/// The demo person, built once.
fn person() -> Option<&'static Person> {
    static PERSON: OnceLock<Option<Person>> = OnceLock::new();
    PERSON
        .get_or_init(|| {
            makehuman().map(|path| Person::demo(&path, |_| ()).expect("the package is whole"))
        })
        .as_ref()
}

/// Says nothing.
struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _: &'static str, _: usize) {}
    fn advance(&self) {}
}

fn options(noise: Noise) -> SynthesisOptions {
    SynthesisOptions {
        ring: Ring {
            cameras: 3,
            size: [96, 112],
            radius: 3.0,
        },
        frames: 2,
        held_out_frames: 1,
        held_out_cameras: 1,
        turn: false,
        background: [92, 98, 104],
        noise,
    }
}

fn make(folder: &Path, person: &Person, noise: Noise) -> Capture {
    let clips: Vec<MotionClip> = performance::built_in(person)
        .expect("built-in motions")
        .into_iter()
        .take(2)
        .collect();
    synthesise(folder, person, &clips, &options(noise), &Quiet).expect("a capture");
    Capture::open(folder).expect("a capture that can be read")
}

fn truth(folder: &Path) -> Value {
    let text = std::fs::read(folder.join("truth.json")).expect("the truth");
    serde_json::from_slice(&text).expect("JSON")
}

fn vector(value: &Value) -> Vec3 {
    let at = |k: usize| value[k].as_f64().expect("a number") as f32;
    Vec3::new(at(0), at(1), at(2))
}

/// Every file below a folder, by its name.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let bytes = std::fs::read(&path).expect("a file");
                let name = path.strip_prefix(folder).expect("below it").to_owned();
                found.push((name, bytes));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn a_capture_shows_the_person_where_its_calibration_and_motion_say() {
    let Some(person) = person() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let capture = make(folder.path(), person, Noise::default());
    assert_eq!(capture.cameras().len(), 3, "cameras");
    assert_eq!(
        capture.frames(),
        3,
        "two frames of one motion, one of the other"
    );
    assert_eq!(
        capture.held_out().frames,
        [2],
        "the last motion is held out"
    );
    assert_eq!(
        capture.held_out().cameras.len(),
        1,
        "one camera is held out"
    );
    let truth = truth(folder.path());
    let poses = capture.poses().expect("its motion is known");
    for (frame, pose) in poses.iter().enumerate() {
        let motion = pose.on(person.skeleton());
        let joints = person.skeleton().pose(&motion);
        for (joint, wanted) in Joint::ALL
            .iter()
            .zip(truth["frames"][frame]["joints"].as_array().expect("joints"))
        {
            let place = joints.position(*joint) + motion.root_translation;
            let off = place.distance(vector(wanted));
            assert!(off < 1e-4, "{joint:?} is {off} m off in frame {frame}");
        }
        // Without cloth that hangs: skin, which the simulation leaves where the skinning puts it.
        let posed = person.posed(&motion);
        for (number, camera) in capture.cameras().iter().enumerate() {
            let photograph = capture.photograph(number, frame).expect("a picture");
            let mask = photograph.mask.as_ref().expect("a mask");
            let covered = |vertex: Vec3| {
                let world = (vertex + motion.root_translation).as_dvec3();
                let at = camera.project(world).expect("in front of the camera");
                let (x, y) = (at.x as usize, at.y as usize);
                // A vertex on the outline may be in a pixel that it covers too little to count.
                (y.saturating_sub(1)..=(y + 1).min(111))
                    .any(|y| (x.saturating_sub(1)..=(x + 1).min(95)).any(|x| mask[y * 96 + x] > 0))
            };
            let seen = posed.iter().filter(|vertex| covered(**vertex)).count();
            let share = seen as f64 / posed.len() as f64;
            assert!(share > 0.995, "{share} of the vertices are in the mask");
            let shown = mask.iter().filter(|value| **value == 255).count() as f64;
            assert!(
                shown > 0.08 * 96.0 * 112.0,
                "only {shown} pixels show the person"
            );
        }
    }
}

#[test]
fn the_same_options_give_the_same_bytes_on_any_number_of_threads() {
    let Some(person) = person() else {
        return;
    };
    let made = |threads: usize| {
        let folder = tempfile::tempdir().expect("a folder");
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| make(folder.path(), person, Noise::default()));
        files(folder.path())
    };
    let (one, three) = (made(1), made(3));
    assert_eq!(one.len(), three.len(), "another number of files");
    for ((name, a), (other, b)) in one.iter().zip(&three) {
        assert_eq!(name, other, "another file");
        assert!(a == b, "{} differs", name.display());
    }
}

#[test]
fn errors_are_in_what_is_written_and_not_in_pictures_or_truth() {
    let Some(person) = person() else {
        return;
    };
    let noise = Noise {
        calibration_mm: 4.0,
        pose_degrees: 1.5,
        seed: 7,
    };
    let (exact, noisy) = (
        tempfile::tempdir().expect("a folder"),
        tempfile::tempdir().expect("a folder"),
    );
    let a = make(exact.path(), person, Noise::default());
    let b = make(noisy.path(), person, noise);
    assert_eq!(
        a.photograph(1, 1).expect("a picture"),
        b.photograph(1, 1).expect("a picture"),
        "the pictures stay true"
    );
    assert_eq!(truth(exact.path()), truth(noisy.path()), "the truth stays");
    let eye = |capture: &Capture| {
        let pose = capture.cameras()[1].camera_from_world;
        -(pose.matrix3.transpose() * pose.translation)
    };
    let off = eye(&a).distance(eye(&b));
    assert!(off > 1e-4 && off < 0.03, "the camera is {off} m off");
    let elbow = |capture: &Capture| {
        let poses = capture.poses().expect("its motion");
        poses[1].parameters.rotation(Joint::LeftElbow)
    };
    let turned = elbow(&a).angle_between(elbow(&b)).to_degrees();
    assert!(
        turned > 0.05 && turned < 12.0,
        "the elbow is {turned} degrees off"
    );
}

#[test]
fn impossible_options_are_refused_before_any_work() {
    let Some(person) = person() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let clips = performance::built_in(person).expect("built-in motions");
    let good = options(Noise::default());
    let bad = [
        SynthesisOptions { frames: 0, ..good },
        SynthesisOptions {
            frames: 1 << 40,
            ..good
        },
        SynthesisOptions {
            held_out_cameras: 3,
            ..good
        },
        SynthesisOptions {
            ring: Ring {
                cameras: 0,
                ..good.ring
            },
            ..good
        },
        SynthesisOptions {
            ring: Ring {
                radius: f64::NAN,
                ..good.ring
            },
            ..good
        },
    ];
    for options in bad {
        let result = synthesise(folder.path(), person, &clips, &options, &Quiet);
        assert!(result.is_err(), "{options:?}");
    }
    let none = synthesise(folder.path(), person, &[], &good, &Quiet);
    assert!(none.is_err(), "no motion");
    assert!(
        std::fs::read_dir(folder.path())
            .expect("a folder")
            .next()
            .is_none(),
        "something was written"
    );
}
