//! Our own layout broken in many ways: each message names the file and the field.

mod support;

use std::fs;
use std::path::Path;
use support::{cut, edit, npz, png, said};

/// A capture of two cameras and three frames, written by hand: the layout's documentation as a test.
fn write(folder: &Path) {
    for camera in ["front", "side"] {
        for frame in 0..3 {
            png(
                &folder.join(format!("frames/{camera}/{frame:06}.png")),
                [8, 6],
                frame,
            );
            png(
                &folder.join(format!("masks/{camera}/{frame:06}.png")),
                [8, 6],
                frame,
            );
        }
    }
    fs::write(
        folder.join("capture.json"),
        r#"{
  "format": "mon3tr-capture",
  "version": 1,
  "frame_rate": 30.0,
  "frames": 3,
  "held_out": { "cameras": ["side"], "frames": [[1, 2]] },
  "cameras": [
    { "name": "front", "size": [8, 6], "focal": [9.5, 9.6], "centre": [4.1, 2.9], "distortion": [0, 0, 0, 0, 0],
      "camera_from_world": [[1, 0, 0, 0.5], [0, -1, 0, 1.2], [0, 0, -1, 3]] },
    { "name": "side", "size": [8, 6], "focal": [9.7, 9.8], "centre": [4.2, 2.8], "distortion": [-0.1, 0.01, 0, 0, 0],
      "camera_from_world": [[0, 0, 1, 0.4], [0, -1, 0, 1.1], [1, 0, 0, 3]] }
  ]
}
"#,
    )
    .expect("written");
    npz(
        &folder.join("motion.npz"),
        &[
            ("poses", &[3, 165], vec![0.1; 495]),
            ("expression", &[3, 50], vec![0.0; 150]),
            ("pelvis", &[3, 3], vec![0.9; 9]),
        ],
    );
}

#[test]
fn the_folder_that_is_broken_below_is_good() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path());
    let capture = capture::Capture::open(folder.path()).expect("a capture");
    assert_eq!(capture.held_out().cameras, [1], "the side");
    assert_eq!(capture.held_out().frames, [1], "the middle");
    assert_eq!(capture.cameras()[1].distortion[0], -0.1, "distorted");
    let photograph = capture.photograph(1, 2).expect("a photograph");
    assert!(photograph.mask.is_some(), "with its mask");
}

#[test]
fn every_way_to_break_a_capture_is_named_by_file_and_field() {
    type Break = fn(&Path);
    let ways: [(&str, Break, &[&str]); 27] = [
        (
            "no camera's frames",
            |f| fs::remove_dir_all(f.join("frames/side")).expect("gone"),
            &["frames/side"],
        ),
        (
            "a missing frame",
            |f| fs::remove_file(f.join("frames/front/000001.png")).expect("gone"),
            &["front/000001.png", "missing"],
        ),
        (
            "a missing mask",
            |f| fs::remove_file(f.join("masks/side/000002.png")).expect("gone"),
            &["masks/side/000002.png", "missing"],
        ),
        (
            "another size",
            |f| png(&f.join("frames/front/000002.png"), [8, 7], 0),
            &["front/000002.png", "8 x 7"],
        ),
        (
            "a mask of another size",
            |f| png(&f.join("masks/front/000000.png"), [4, 3], 0),
            &["masks/front/000000.png", "4 x 3"],
        ),
        (
            "a picture cut short",
            |f| cut(&f.join("frames/side/000000.png"), 60),
            &["side/000000.png"],
        ),
        (
            "a JPEG cut short",
            |f| {
                fs::write(f.join("frames/side/000000.png"), b"\xff\xd8\xff\xe0 no end")
                    .expect("written");
            },
            &["side/000000.png", "cut short"],
        ),
        (
            "mixed names",
            |f| {
                fs::rename(
                    f.join("frames/side/000001.png"),
                    f.join("frames/side/1.png"),
                )
                .expect("moved");
            },
            &["frames/side"],
        ),
        (
            "mixed endings",
            |f| {
                fs::rename(
                    f.join("frames/side/000001.png"),
                    f.join("frames/side/000001.jpg"),
                )
                .expect("moved");
            },
            &["000001.jpg", "rename"],
        ),
        (
            "no JSON",
            |f| cut(&f.join("capture.json"), 50),
            &["capture.json", "line"],
        ),
        (
            "NaN",
            |f| edit(&f.join("capture.json"), "9.5,", "NaN,"),
            &["capture.json", "line 8"],
        ),
        (
            "a text for a number",
            |f| edit(&f.join("capture.json"), "9.7", "\"9.7\""),
            &["capture.json", "cameras[1].focal[0]"],
        ),
        (
            "no focal length",
            |f| edit(&f.join("capture.json"), "9.5, 9.6", "0, 9.6"),
            &["cameras[0].focal"],
        ),
        (
            "a missing field",
            |f| edit(&f.join("capture.json"), "\"centre\"", "\"center\""),
            &["cameras[0].centre", "missing"],
        ),
        (
            "too few numbers",
            |f| {
                edit(
                    &f.join("capture.json"),
                    "[-0.1, 0.01, 0, 0, 0]",
                    "[-0.1, 0.01]",
                );
            },
            &["cameras[1].distortion", "5"],
        ),
        (
            "no rotation",
            |f| edit(&f.join("capture.json"), "[1, 0, 0, 0.5]", "[2, 0, 0, 0.5]"),
            &["cameras[0].camera_from_world", "rotation"],
        ),
        (
            "a mirror",
            |f| edit(&f.join("capture.json"), "[1, 0, 0, 0.5]", "[-1, 0, 0, 0.5]"),
            &["cameras[0].camera_from_world"],
        ),
        (
            "a size of a fraction",
            |f| edit(&f.join("capture.json"), "[8, 6]", "[8.5, 6]"),
            &["cameras[0].size[0]"],
        ),
        (
            "a giant",
            |f| edit(&f.join("capture.json"), "[8, 6]", "[80000, 6]"),
            &["cameras[0].size[0]", "8192"],
        ),
        (
            "a name that leads elsewhere",
            |f| edit(&f.join("capture.json"), "\"front\"", "\"../front\""),
            &["cameras[0].name"],
        ),
        (
            "one name twice",
            |f| {
                edit(
                    &f.join("capture.json"),
                    "\"name\": \"side\"",
                    "\"name\": \"front\"",
                );
            },
            &["cameras"],
        ),
        (
            "another format",
            |f| edit(&f.join("capture.json"), "mon3tr-capture", "other"),
            &["format"],
        ),
        (
            "another version",
            |f| edit(&f.join("capture.json"), "\"version\": 1", "\"version\": 2"),
            &["version"],
        ),
        (
            "more frames than there are",
            |f| edit(&f.join("capture.json"), "\"frames\": 3", "\"frames\": 4"),
            &["000003.png", "missing"],
        ),
        (
            "held out beyond the end",
            |f| edit(&f.join("capture.json"), "[[1, 2]]", "[[1, 9]]"),
            &["held_out.frames[0]"],
        ),
        (
            "held out in disorder",
            |f| edit(&f.join("capture.json"), "[[1, 2]]", "[[2, 3], [0, 1]]"),
            &["held_out.frames[1]"],
        ),
        (
            "held out unknown",
            |f| edit(&f.join("capture.json"), "[\"side\"]", "[\"back\"]"),
            &["held_out.cameras[0]"],
        ),
    ];
    for (what, broken, words) in ways {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path());
        broken(folder.path());
        let said = said(folder.path());
        for word in words {
            assert!(said.contains(word), "{what}: {said}");
        }
    }
}

#[test]
fn a_motion_that_does_not_fit_is_named_by_its_array() {
    /// An array of the file: its name, its shape, how many numbers it holds.
    type Array = (&'static str, &'static [usize], usize);
    let cases: [(&str, &[Array]); 4] = [
        (
            "`pelvis`",
            &[("poses", &[3, 165], 495), ("expression", &[3, 50], 150)],
        ),
        (
            "`poses` has 2 frames",
            &[
                ("poses", &[2, 165], 330),
                ("expression", &[3, 50], 150),
                ("pelvis", &[3, 3], 9),
            ],
        ),
        (
            "`poses`",
            &[
                ("poses", &[3, 156], 468),
                ("expression", &[3, 50], 150),
                ("pelvis", &[3, 3], 9),
            ],
        ),
        (
            "`expression`",
            &[
                ("poses", &[3, 165], 495),
                ("expression", &[3, 10], 30),
                ("pelvis", &[3, 3], 9),
            ],
        ),
    ];
    for (word, arrays) in cases {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path());
        let arrays: Vec<(&str, &[usize], Vec<f32>)> = (arrays.iter())
            .map(|(name, shape, count)| (*name, *shape, vec![0.5; *count]))
            .collect();
        npz(&folder.path().join("motion.npz"), &arrays);
        let said = said(folder.path());
        assert!(
            said.contains("motion.npz") && said.contains(word),
            "{word}: {said}"
        );
    }
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path());
    let mut poses = vec![0.1; 495];
    poses[7] = f32::NAN;
    npz(
        &folder.path().join("motion.npz"),
        &[
            ("poses", &[3, 165], poses),
            ("expression", &[3, 50], vec![0.0; 150]),
            ("pelvis", &[3, 3], vec![0.0; 9]),
        ],
    );
    let not_finite = said(folder.path());
    assert!(
        not_finite.contains("`poses`") && not_finite.contains("finite"),
        "{not_finite}"
    );
    cut(&folder.path().join("motion.npz"), 70);
    assert!(said(folder.path()).contains("motion.npz"), "cut short");
}

#[test]
fn a_folder_of_something_else_is_told_what_was_looked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let nothing = said(folder.path());
    for layout in ["capture.json", "AvatarReX", "THuman4.0", "ActorsHQ"] {
        assert!(nothing.contains(layout), "{nothing}");
    }
    assert!(
        said(&folder.path().join("nowhere")).contains("nowhere"),
        "not there"
    );
}
