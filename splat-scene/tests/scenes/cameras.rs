//! `cameras.json` as 3DGS writes it.

use glam::{DMat3, DVec3, Vec3};
use splat_scene::SceneError;
use splat_scene::cameras::Cameras;

/// Two cameras as the trainer's `camera_to_JSON` writes them, with rotations about y and about x.
pub(crate) const EXAMPLE: &str = r#"[
 {"id": 3, "img_name": "00001", "width": 1959, "height": 1090, "position": [-3.0, -0.5, -3.75],
  "rotation": [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]], "fy": 1164.66, "fx": 1159.58},
 {"id": 5, "img_name": "00009", "width": 640, "height": 480, "position": [1.0, 2.0, 3.0],
  "rotation": [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]], "fy": 500, "fx": 510, "more": true}
]"#;

#[test]
fn a_camera_sees_each_point_where_colmap_says() {
    let cameras = Cameras::parse(EXAMPLE.as_bytes(), "cameras.json").unwrap();
    assert_eq!(cameras.all().len(), 2, "both cameras");
    let camera = cameras.get(3).unwrap();
    assert_eq!((camera.width, camera.height), (1959, 1090), "pixels");
    assert_eq!((camera.fx, camera.fy), (1159.58, 1164.66), "focal lengths");
    assert_eq!(camera.name, "00001", "photograph");
    let rotations = [
        [
            DVec3::new(0.8, 0.0, 0.6),
            DVec3::Y,
            DVec3::new(-0.6, 0.0, 0.8),
        ],
        [
            DVec3::X,
            DVec3::new(0.0, 0.6, -0.8),
            DVec3::new(0.0, 0.8, 0.6),
        ],
    ];
    let positions = [DVec3::new(-3.0, -0.5, -3.75), DVec3::new(1.0, 2.0, 3.0)];
    let house = DVec3::new(1.0, -1.0, -1.0);
    for ((camera, rows), position) in cameras.all().iter().zip(rotations).zip(positions) {
        let world_from_camera =
            DMat3::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose();
        for point in [
            DVec3::Z,
            DVec3::new(0.3, -0.2, 5.0),
            DVec3::new(-1.0, 2.0, 2.0),
        ] {
            // In COLMAP's axes the point lies before the camera at +z and its y goes down the picture.
            let world = world_from_camera * point + position;
            // In OpenXR's it is before the camera at -z and its y goes up.
            let seen = camera.world_from_camera * (point * house).as_vec3()
                + Vec3::from_array(camera.position);
            let off = (seen.as_dvec3() - world * house).length();
            assert!(off < 1e-5, "{point} is {off} from its place");
        }
    }
}

#[test]
fn a_camera_that_is_not_there_is_refused_with_the_ids_that_are() {
    let text = Cameras::parse(EXAMPLE.as_bytes(), "c.json")
        .unwrap()
        .get(4)
        .unwrap_err()
        .to_string();
    assert_eq!(
        text, "c.json has no camera 4; its cameras are 3, 5",
        "by their ids"
    );
    let many: Vec<String> = (0..300)
        .filter(|id| *id < 7 || id % 2 == 0)
        .map(|id| {
            format!(
                r#"{{"id":{id},"width":4,"height":3,"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"fx":1,"fy":1}}"#
            )
        })
        .collect();
    let file = format!("[{}]", many.join(","));
    let text = Cameras::parse(file.as_bytes(), "c.json")
        .unwrap()
        .get(-1)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("its cameras are 0 to 6, 8, 10, 12,"),
        "neighbours are drawn together: {text}"
    );
    assert!(
        text.ends_with("and more, 153 in all"),
        "and the list ends: {text}"
    );
    let text = Cameras::parse(b"[]", "c.json")
        .unwrap()
        .get(0)
        .unwrap_err()
        .to_string();
    assert!(text.ends_with("its cameras are none"), "{text}");
}

#[test]
fn cameras_that_cannot_be_are_named() {
    for (old, new, why) in [
        ("1959", "0", "0 x 1090 pixels"),
        ("1164.66", "-1", "focal lengths"),
        ("-3.0", "1e300", "its position is [1e300, -0.5, -3.75]"),
        ("0.8, 0.0, 0.6", "0.8, 0.0, 0.7", "not one of a rotation"),
        (
            "[0.0, 1.0, 0.0]",
            "[0.0, -1.0, 0.0]",
            "not one of a rotation",
        ),
    ] {
        let file = EXAMPLE.replacen(old, new, 1);
        let text = Cameras::parse(file.as_bytes(), "c.json")
            .unwrap_err()
            .to_string();
        assert!(text.contains("camera 3") && text.contains(why), "{text}");
    }
    let error = Cameras::parse(b"{\"frames\": []}", "transforms.json").unwrap_err();
    assert!(matches!(error, SceneError::CameraList { .. }), "{error}");
    let text = Cameras::load("nowhere/cameras.json")
        .unwrap_err()
        .to_string();
    assert!(text.contains("nowhere/cameras.json"), "{text}");
}
