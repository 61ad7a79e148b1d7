use super::*;
use glam::{Affine3A, Quat, Vec3};

/// Where the camera stands after the viewer has looked at one place for three seconds, and which way it looks.
fn looked(x: f64, y: f64) -> (Vec3, Vec3) {
    let mut gaze = GazeChoice::Mouse.open(Sight::Window).expect("a window");
    let viewpoint: Viewpoint = "front".parse().expect("a name");
    let zero = Instant::now();
    gaze.pointed([x * 640.0, y * 480.0], (640, 480));
    let camera = (0..180).map(|picture| {
        let now = zero + Duration::from_millis(picture * 1000 / 60);
        gaze.camera(viewpoint, &PEOPLE, SIZE, now)
    });
    let camera = camera.last().expect("pictures");
    (camera.position(), direction(&camera))
}

/// One person at the origin, who faces +z.
const PEOPLE: Standpoint = Standpoint {
    floor: Vec3::ZERO,
    heading: Quat::IDENTITY,
    width: 0.0,
    first: Affine3A::IDENTITY,
};

const SIZE: Size = Size {
    width: 640,
    height: 480,
};

fn direction(camera: &Camera) -> Vec3 {
    let world_from_camera = camera.camera_from_world.inverse();
    -Vec3::from(world_from_camera.matrix3.z_axis)
}

#[test]
fn looking_to_a_side_takes_the_camera_there_and_keeps_the_person_in_the_middle() {
    let target = Vec3::new(0.0, 0.92, 0.0);
    let (front, _) = looked(0.5, 0.5);
    let [left, right, up, down] =
        [(0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0)].map(|(x, y)| looked(x, y));
    // The front camera looks along -z with +x to its right.
    assert!(right.0.x > front.x + 1.0, "right: {} from {front}", right.0);
    assert!(left.0.x < front.x - 1.0, "left: {} from {front}", left.0);
    assert!(up.0.y > front.y + 0.5, "up: {} from {front}", up.0);
    assert!(down.0.y < front.y - 0.5, "down: {} from {front}", down.0);
    for (eye, direction) in [left, right, up, down] {
        let towards = (target - eye).normalize();
        assert!(towards.abs_diff_eq(direction, 1e-4), "from {eye}");
        let distance = eye.distance(target);
        assert!(
            (distance - front.distance(target)).abs() < 1e-3,
            "from {eye}: {distance}"
        );
    }
}

#[test]
fn a_mouse_that_leaves_the_window_is_looked_at_for_a_blink_and_then_forgotten() {
    let mut gaze = GazeChoice::Mouse.open(Sight::Window).expect("a window");
    let viewpoint: Viewpoint = "front".parse().expect("a name");
    let zero = Instant::now();
    let at = |seconds: f64| zero + Duration::from_secs_f64(seconds);
    gaze.pointed([640.0, 240.0], (640, 480));
    let turned = |gaze: &mut Gaze, from: f64, to: f64| {
        let mut angle = 0.0;
        for step in 0..=60 {
            let time = from + (to - from) * f64::from(step) / 60.0;
            let seen = direction(&gaze.camera(viewpoint, &PEOPLE, SIZE, at(time)));
            angle = (-seen.x).atan2(-seen.z).to_degrees();
        }
        angle
    };
    let before = turned(&mut gaze, 0.0, 4.0);
    gaze.left(at(4.0));
    let held = turned(&mut gaze, 4.0, 4.39);
    let after = turned(&mut gaze, 4.41, 9.0);
    assert!((before - 25.0).abs() < 0.01, "as far as it goes: {before}");
    assert!((held - before).abs() < 0.01, "held: {held}");
    assert!(after.abs() < 0.01, "back in the middle: {after}");
}

/// The pictures of a gaze from a file with these lines, 60 a second, so many seconds long: each one's camera.
fn followed(lines: &str, people: &Standpoint, seconds: u64) -> (Vec<Camera>, GazeFigures) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("gaze");
    std::fs::write(&file, lines).expect("written");
    let mut gaze = (GazeChoice::File(file).open(Sight::Offscreen)).expect("a gaze");
    let viewpoint: Viewpoint = "front".parse().expect("a name");
    let zero = Instant::now();
    let cameras = (0..60 * seconds)
        .map(|picture| {
            let now = zero + Duration::from_millis(picture * 1000 / 60);
            gaze.camera(viewpoint, people, SIZE, now)
        })
        .collect();
    (cameras, gaze.figures())
}

#[test]
fn a_headsets_wearer_is_where_the_camera_stands_and_then_no_more() {
    // The person has turned to the left by a right angle, 2 m to the right of the middle of all: their +z is the world's +x.
    let people = Standpoint {
        width: 4.0,
        first: Affine3A::from_rotation_translation(
            Quat::from_rotation_y(std::f32::consts::FRAC_PI_2),
            Vec3::new(2.0, 0.0, 0.0),
        ),
        ..PEOPLE
    };
    let lines: String = (0..50)
        .map(|k| {
            let seconds = f64::from(k) * 0.1;
            format!("{{\"seconds\":{seconds},\"eye\":[0.5,1.6,1.6],\"towards\":[0.5,1.2,1.3]}}\n")
        })
        .collect();
    let (cameras, figures) = followed(&lines, &people, 10);
    let there = cameras[60 * 4];
    // 1.6 m before them and 0.5 m to their left, which is away from the world's front.
    let eye = Vec3::new(2.0 + 1.6, 1.6, -0.5);
    assert!(
        there.position().abs_diff_eq(eye, 1e-3),
        "{}",
        there.position()
    );
    let towards = Vec3::new(-0.6, -0.8, 0.0);
    assert!(
        direction(&there).abs_diff_eq(towards, 1e-3),
        "{}",
        direction(&there)
    );
    let fov = 2.0 * (there.cy / there.fy).atan().to_degrees();
    assert!((fov - 50.0).abs() < 0.1, "{fov} degrees");
    // Without anybody else in the picture it was at rest where it had been asked to be.
    let viewpoint: Viewpoint = "front".parse().expect("a name");
    let asked = viewpoint.camera(Vec3::ZERO, Quat::IDENTITY, 640, 480);
    for at in [0, cameras.len() - 1] {
        let off = cameras[at].position().distance(asked.position());
        assert!(off < 1e-2, "{off} m off in picture {at}");
    }
    assert!(
        cameras
            .windows(2)
            .all(|two| two[0].position().distance(two[1].position()) < 0.15),
        "it jumped"
    );
    let told = serde_json::to_value(&figures).expect("figures");
    let view = &told["view"];
    assert!(
        view["pictures"]
            .as_u64()
            .is_some_and(|n| (300..500).contains(&n)),
        "{told}"
    );
    for (axis, expected) in [0.5, 1.6, 1.6].into_iter().enumerate() {
        let metres = view["eye"][axis].as_f64().expect("metres");
        assert!((metres - expected).abs() < 1e-3, "{told}");
    }
}
