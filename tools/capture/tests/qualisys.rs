//! A calibration as Qualisys writes it.

use capture::{read_qualisys, upright};
use glam::{DVec2, DVec3};
use std::fs;

const GOOD: &str = r#"<?xml version="1.0"?>
<calibration><cameras><camera active="1" serial="cam01">
<fov_video bottom="1919" left="0" right="1087" top="0"/>
<transform r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0" x="1000" y="-2000" z="1500"/>
<intrinsic centerPointU="34816" centerPointV="61440" focalLengthU="64000" focalLengthV="65280" radialDistortion1="-0.64" radialDistortion2="0" tangentalDistortion1="0" tangentalDistortion2="0"/>
</camera></cameras></calibration>"#;

#[test]
fn a_camera_sees_what_is_before_it_in_a_world_of_z_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("Calib.qca.txt");
    fs::write(&path, GOOD).expect("written");
    let cameras = read_qualisys(&path).expect("a calibration");
    let [camera] = cameras.as_slice() else {
        panic!("one camera, not {}", cameras.len());
    };
    assert_eq!(
        (camera.name.as_str(), camera.size),
        ("cam01", [1088, 1920]),
        "name and size"
    );
    assert!(
        camera.position().distance(DVec3::new(1.0, -2.0, 1.5)) < 1e-9,
        "{}",
        camera.position()
    );
    // Qualisys' cameras look along -z of their own; this one's is the world's +y, its up the world's z.
    let before = camera
        .project(DVec3::new(1.0, 1.0, 1.5))
        .expect("before it");
    assert!(before.distance(DVec2::new(544.0, 960.0)) < 1e-9, "{before}");
    let above = camera
        .project(DVec3::new(1.0, 1.0, 1.6))
        .expect("before it");
    assert!(
        above.y < before.y,
        "what is higher is higher in the picture"
    );
    let turned = &upright(&cameras)[0];
    let same = turned
        .project(DVec3::new(1.0, 1.6, -1.0))
        .expect("before it");
    assert!(same.distance(above) < 1e-9, "the same point with y up");
}

#[test]
fn what_is_missing_or_impossible_is_named_with_its_camera() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("Calib.qca.txt");
    for (from, to, word) in [
        ("r23=\"1\"", "", "r23"),
        (
            "focalLengthU=\"64000\"",
            "focalLengthU=\"-1\"",
            "focalLengthU",
        ),
        (
            "focalLengthV=\"65280\"",
            "focalLengthV=\"nan\"",
            "focalLengthV",
        ),
        ("r11=\"1\"", "r11=\"2\"", "r11 to r33"),
        ("r11=\"1\"", "r11=\"-1\"", "r11 to r33"),
        ("r32=\"-1\"", "r32=\"one\"", "r32"),
        ("x=\"1000\"", "x=\"1e12\"", "x, y, z"),
        ("z=\"1500\"", "", "z is missing"),
        (
            "centerPointU=\"34816\"",
            "centerPointU=\"1e9\"",
            "centerPointU",
        ),
        ("centerPointV=\"61440\"", "", "centerPointV"),
        (
            "radialDistortion1=\"-0.64\"",
            "radialDistortion1=\"inf\"",
            "radialDistortion1",
        ),
        (
            "radialDistortion2=\"0\"",
            "radialDistortion2=\"1e9\"",
            "radialDistortion1 to",
        ),
        ("tangentalDistortion1=\"0\"", "", "tangentalDistortion1"),
        ("left=\"0\"", "left=\"0.5\"", "right"),
        ("top=\"0\"", "", "top"),
        ("bottom=\"1919\"", "bottom=\"-5\"", "bottom"),
        ("<transform ", "<place ", "transform"),
        ("<fov_video ", "<view ", "fov_video"),
        ("right=\"1087\"", "right=\"1e9\"", "right"),
        ("<intrinsic ", "<other ", "intrinsic"),
        ("serial=\"cam01\"", "serial=\"a/b\"", "serial"),
        ("serial=\"cam01\"", "serial=\"\"", "serial"),
    ] {
        fs::write(&path, GOOD.replace(from, to)).expect("written");
        let said = read_qualisys(&path).expect_err("refused").to_string();
        let said = said.replace('`', "");
        assert!(
            said.contains("Calib.qca.txt: camera 1") && said.contains(word),
            "{word}: {said}"
        );
    }
    for (text, word) in [
        ("", "no XML"),
        ("<calibration>", "no XML"),
        ("<calibration/>", "camera"),
    ] {
        fs::write(&path, text).expect("written");
        let said = read_qualisys(&path).expect_err("refused").to_string();
        assert!(
            said.contains("Calib.qca.txt") && said.contains(word),
            "{said}"
        );
    }
}
