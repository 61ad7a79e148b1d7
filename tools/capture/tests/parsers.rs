//! Whatever stands in the files, reading ends with a capture or an error: no panic, no endless work.

mod support;

use capture::{Capture, read_qualisys};
use proptest::prelude::*;
use std::fs;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_json_of_about_the_right_shape_is_read_or_refused(
        numbers in prop::collection::vec(prop_oneof![any::<f64>().prop_map(|v| v.to_string()), "[\\[\\]{}\",a-z0-9.-]{0,12}"], 12),
        frames in any::<i32>(),
        key in "[a-z_]{1,12}",
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        let list = numbers.join(",");
        let text = format!(
            r#"{{"format":"mon3tr-capture","version":1,"frame_rate":{},"frames":{frames},"{key}":1,
            "cameras":[{{"name":"a","size":[{list}],"focal":[{list}],"centre":[1,2],"distortion":[{list}],"camera_from_world":[{list}]}}]}}"#,
            numbers[0]
        );
        fs::write(folder.path().join("capture.json"), text).expect("written");
        let refused = Capture::open(folder.path());
        prop_assert!(refused.is_err(), "there are no pictures");
    }

    #[test]
    fn any_calibration_of_a_data_set_is_read_or_refused(
        cells in prop::collection::vec("[-0-9.einaf]{0,8}", 13),
        cut in 0_usize..400,
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir_all(folder.path().join("4x")).expect("made");
        let csv = format!("name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n{}\n", cells.join(","));
        fs::write(folder.path().join("4x/calibration.csv"), csv).expect("written");
        prop_assert!(Capture::open(folder.path()).is_err(), "there are no pictures");
        let json = format!(
            r#"{{"c":{{"K":[{}],"R":[1,0,0,0,1,0,0,0,1],"T":[0,0,{}],"imgSize":[8,6]}}}}"#,
            cells[..9].join(","), cells[9]
        );
        fs::write(folder.path().join("calibration_full.json"), &json[..cut.min(json.len())]).expect("written");
        prop_assert!(Capture::open(folder.path()).is_err(), "there are no pictures");
    }

    #[test]
    fn any_damage_to_a_motion_is_an_error_or_no_matter(at in 0_usize..100_000, value in any::<u8>()) {
        let folder = tempfile::tempdir().expect("a folder");
        support::png(&folder.path().join("frames/a/000000.png"), [2, 2], 0);
        fs::write(folder.path().join("capture.json"), r#"{"format":"mon3tr-capture","version":1,"frame_rate":30,"frames":1,
            "cameras":[{"name":"a","size":[2,2],"focal":[9,9],"centre":[1,1],"distortion":[0,0,0,0,0],
            "camera_from_world":[[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]}"#).expect("written");
        let path = folder.path().join("motion.npz");
        support::npz(&path, &[("poses", &[1, 165], vec![0.1; 165]), ("expression", &[1, 50], vec![0.2; 50]), ("pelvis", &[1, 3], vec![0.3; 3])]);
        prop_assert!(Capture::open(folder.path()).is_ok(), "good before");
        let mut bytes = fs::read(&path).expect("read");
        let at = at % bytes.len();
        bytes[at] = value;
        fs::write(&path, bytes).expect("written");
        if let Ok(capture) = Capture::open(folder.path()) {
            let poses = capture.poses().expect("a motion");
            prop_assert!(poses.iter().all(|pose| pose.pelvis.is_finite() && pose.parameters.is_finite()), "checked");
        }
    }

    #[test]
    fn any_xml_is_no_calibration_or_one(text in "[<>/a-z0-9=\"' .-]{0,200}", value in "[-0-9.e]{0,6}") {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.qca.txt");
        fs::write(&path, &text).expect("written");
        prop_assert!(read_qualisys(&path).is_err(), "no camera");
        let near = format!(r#"<calibration><camera serial="a"><fov_video left="0" right="{value}" top="0" bottom="7"/><transform x="{value}"/><intrinsic/></camera></calibration>"#);
        fs::write(&path, near).expect("written");
        prop_assert!(read_qualisys(&path).is_err(), "not all of a camera");
    }
}
