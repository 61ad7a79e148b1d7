//! A single video and a folder of videos without what they need.

use capture_completion::{Pictures, Videos};
use std::fs;
use std::path::Path;

/// Grey frames of rising brightness, as y4m.
fn video(path: &Path, frames: u8) {
    let mut bytes = b"YUV4MPEG2 W16 H24 F50:1 Ip A1:1 C420jpeg\n".to_vec();
    for frame in 0..frames {
        bytes.extend(b"FRAME\n");
        bytes.extend([20 * frame; 16 * 24]);
        bytes.extend([128; 2 * 8 * 12]);
    }
    fs::write(path, bytes).expect("written");
}

#[test]
fn every_third_picture_of_a_single_video_becomes_a_frame() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("me.y4m");
    video(&path, 8);
    let mut videos = Videos::single(&path, 60.0).expect("a video").every(3);
    assert_eq!(
        (videos.frames(), videos.posed()),
        (3, false),
        "pictures 0, 3 and 6"
    );
    assert!(
        (videos.frame_rate() - 50.0 / 3.0).abs() < 1e-9,
        "{}",
        videos.frame_rate()
    );
    let camera = &videos.cameras()[0];
    // Half of 24 pixels is seen under half of 60 degrees.
    assert!(
        (camera.focal[1] - 12.0 / 30_f64.to_radians().tan()).abs() < 1e-9,
        "{:?}",
        camera.focal
    );
    let mut seen = Vec::new();
    videos
        .each(0, &mut |frame, photograph| {
            seen.push((frame, photograph.rgb[0]));
            Ok(())
        })
        .expect("all of it");
    // Studio range, BT.601: luma 16 is black, 235 is white.
    for ((frame, grey), luma) in seen.iter().zip([0.0, 60.0, 120.0]) {
        let expected: f64 = (luma - 16.0_f64).max(0.0) * 255.0 / 219.0;
        assert!(
            (f64::from(*grey) - expected).abs() <= 2.0,
            "frame {frame} is {grey} for {expected:.1}"
        );
    }
    assert_eq!(seen.len(), 3, "three frames");
    assert!(Videos::single(&path, 0.0).is_err(), "no field of view");
}

#[test]
fn a_folder_without_calibration_or_video_is_told_what_it_lacks() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = |folder: &Path| Videos::calibrated(folder).expect_err("refused").to_string();
    assert!(
        said(folder.path()).contains("qca.txt"),
        "{}",
        said(folder.path())
    );
    let calibration = r#"<calibration><camera serial="cam01"><fov_video left="0" right="15" top="0" bottom="23"/>
        <transform r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0" x="0" y="0" z="0"/>
        <intrinsic centerPointU="512" centerPointV="768" focalLengthU="640" focalLengthV="640" radialDistortion1="0" radialDistortion2="0" tangentalDistortion1="0" tangentalDistortion2="0"/></camera></calibration>"#;
    fs::write(folder.path().join("a.qca.txt"), calibration).expect("written");
    assert!(
        said(folder.path()).contains("no video of camera `cam01`"),
        "{}",
        said(folder.path())
    );
    video(&folder.path().join("cam01.y4m"), 2);
    let videos = Videos::calibrated(folder.path()).expect("both are there");
    assert_eq!((videos.frames(), videos.posed()), (2, true), "calibrated");
    fs::write(
        folder.path().join("a.qca.txt"),
        calibration.replace("\"15\"", "\"63\""),
    )
    .expect("written");
    assert!(
        said(folder.path()).contains("16 x 24 pixels"),
        "{}",
        said(folder.path())
    );
}

#[test]
fn a_single_video_in_twenty_broken_ways_is_refused_by_its_name() {
    const HEADER: &str = "YUV4MPEG2 W16 H24 F50:1 Ip A1:1 C420jpeg\n";
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("me.y4m");
    let frame = || [b"FRAME\n".to_vec(), vec![90; 16 * 24 + 2 * 8 * 12]].concat();
    let whole = |header: &str| [header.as_bytes().to_vec(), frame()].concat();
    fs::write(&path, whole(HEADER)).expect("written");
    assert!(
        Videos::single(&path, 60.0).is_ok(),
        "good before it is broken"
    );

    let headers = [
        ("no mark", HEADER.replace("YUV4MPEG2", "MPEG"), "YUV4MPEG2"),
        ("no width", HEADER.replace("W16 ", ""), "width"),
        ("no height", HEADER.replace("H24 ", ""), "height"),
        (
            "a width that is none",
            HEADER.replace("W16", "Wide"),
            "width",
        ),
        ("a width of 0", HEADER.replace("W16", "W0"), "0 x 24"),
        ("a height below 0", HEADER.replace("H24", "H-24"), "height"),
        ("a giant", HEADER.replace("W16", "W100000"), "100000"),
        (
            "a giant beyond 32 bits",
            HEADER.replace("W16", "W99999999999"),
            "width",
        ),
        ("unknown chroma", HEADER.replace("C420jpeg", "C411"), "411"),
        (
            "unknown depth",
            HEADER.replace("C420jpeg", "C420p16"),
            "420p16",
        ),
    ];
    let mut ways: Vec<(&str, Vec<u8>, &str)> = headers
        .iter()
        .map(|(what, header, word)| (*what, whole(header), *word))
        .collect();
    ways.extend([
        ("nothing", Vec::new(), "empty"),
        (
            "half a first line",
            HEADER.as_bytes()[..20].to_vec(),
            "first line",
        ),
        ("no picture", HEADER.as_bytes().to_vec(), "picture"),
        ("half a picture", whole(HEADER)[..200].to_vec(), "picture"),
        (
            "a picture without its mark",
            whole(HEADER).split_off(3).to_vec(),
            "YUV4MPEG2",
        ),
        (
            "another mark",
            [HEADER.as_bytes(), b"PICTURE\n", &[90; 576]].concat(),
            "FRAME",
        ),
        (
            "a line without end",
            [HEADER.as_bytes(), &[b'x'; 9000]].concat(),
            "",
        ),
    ]);
    for (what, bytes, word) in &ways {
        fs::write(&path, bytes).expect("written");
        let said = Videos::single(&path, 60.0).expect_err(what).to_string();
        assert!(
            said.contains("me.y4m") && said.contains(word),
            "{what}, {word}: {said}"
        );
    }
    fs::write(&path, whole(HEADER)).expect("written");
    let angles = [0.0, 4.9, 151.0, f64::NAN];
    for view in angles {
        let said = Videos::single(&path, view)
            .expect_err("no angle")
            .to_string();
        assert!(
            said.contains("me.y4m") && said.contains("5 to 150"),
            "{view}: {said}"
        );
    }
    let gone = folder.path().join("gone.y4m");
    let said = Videos::single(&gone, 60.0)
        .expect_err("no file")
        .to_string();
    assert!(said.contains("gone.y4m"), "{said}");
    assert!(ways.len() + angles.len() + 1 >= 20, "as many");
}
