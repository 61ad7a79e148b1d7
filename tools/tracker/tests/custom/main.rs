//! Networks of the user's: tiny ones that give constants or their own input, on models that find a fixed place.

mod finders;
mod onnx;

use finders::{Finder, HINT, MIDDLE, SIDE, SIZE, picture, view};
use glam::{Mat3, Quat, Vec2, Vec3};
use npu_runtime::Runtime;
use onnx::{Gives, Output, constant, network};
use std::path::PathBuf;
use tempfile::TempDir;
use tracker::TrackerError;
use tracker::custom;
use tracker::models::{
    BodyEstimate, BodyRotations, FaceEstimate, FaceExpression, HandEstimate, HandModels,
    HandRotations, JointRotation, Side,
};

/// The runtime, or nothing after a line that says why; on CI that is a failure.
fn runtime() -> Option<Runtime> {
    Runtime::open(None)
        .map_err(|why| {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
            println!("skipped: no ONNX Runtime: {why}");
        })
        .ok()
}

/// A network's two files.
struct Files {
    _folder: TempDir,
    onnx: PathBuf,
}

const INPUT: (&str, &[i64]) = ("image", &[0, 3, 8, 8]);
const PLAIN: &str = "[input]\nname = \"image\"\nsize = 8\n[crop]\nscale = 1.0\n";

fn files(onnx: &[u8], toml: &str) -> Files {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.onnx");
    std::fs::write(&path, onnx).unwrap();
    std::fs::write(path.with_extension("toml"), toml).unwrap();
    Files {
        _folder: folder,
        onnx: path,
    }
}

fn body(
    runtime: &Runtime,
    outputs: &[Output<'_>],
    toml: &str,
) -> Result<Option<BodyEstimate>, TrackerError> {
    let files = files(&network(INPUT, outputs), &format!("{PLAIN}{toml}"));
    let mut model = custom::body(&files.onnx, Box::new(Finder), runtime, 1)?;
    model.run(view(&picture()), 0.0)
}

fn face(
    runtime: &Runtime,
    input: (&str, &[i64]),
    outputs: &[Output<'_>],
    toml: &str,
) -> Result<Option<FaceEstimate>, TrackerError> {
    let files = files(&network(input, outputs), toml);
    let mut model = custom::face(&files.onnx, Box::new(Finder), runtime, 1)?;
    model.find(view(&picture()), None, None)
}

/// The left and the right hand.
fn hands(
    runtime: &Runtime,
    outputs: &[Output<'_>],
    toml: &str,
) -> Result<[Option<HandEstimate>; 2], TrackerError> {
    let files = files(&network(INPUT, outputs), toml);
    let finders = HandModels::Each([Box::new(Finder), Box::new(Finder)]);
    let HandModels::Each([mut left, mut right]) = custom::hands(&files.onnx, finders, runtime, 1)?
    else {
        panic!("each hand keeps its own model");
    };
    let picture = picture();
    Ok([
        left.find(view(&picture), Side::Left, &HINT, None)?,
        right.find(view(&picture), Side::Right, &HINT, None)?,
    ])
}

fn body_turned(seen: Option<BodyEstimate>) -> Box<BodyRotations> {
    match seen {
        Some(BodyEstimate::Rotations(turned)) => turned,
        other => panic!("no rotations, but {other:?}"),
    }
}

fn hand_turned(seen: Option<HandEstimate>) -> Box<HandRotations> {
    match seen {
        Some(HandEstimate::Rotations(turned)) => turned,
        other => panic!("no rotations, but {other:?}"),
    }
}

fn expressed(seen: Option<FaceEstimate>) -> Box<FaceExpression> {
    match seen {
        Some(FaceEstimate::Expression(face)) => face,
        other => panic!("no expression, but {other:?}"),
    }
}

#[track_caller]
fn same(got: &JointRotation, expected: Quat, what: &str) {
    let got = got.known().unwrap_or_else(|| panic!("{what} is unknown"));
    let apart = got.angle_between(expected).to_degrees();
    assert!(
        apart < 0.1,
        "{what}: {got} is {apart} degrees from {expected}"
    );
}

/// Row after row.
fn rows(rotation: Quat) -> [f32; 9] {
    Mat3::from_quat(rotation).transpose().to_cols_array()
}

fn some_turn(k: usize) -> Quat {
    Quat::from_scaled_axis(Vec3::new(0.3, -0.2, 0.1) * (1.0 + 0.1 * k as f32))
}

/// The example of the documentation whose first line is `# name`.
fn example(name: &str) -> String {
    let text = include_str!("../../../../docs/models.md");
    let start = format!("```toml\n# {name}\n");
    let from = text
        .find(&start)
        .unwrap_or_else(|| panic!("no example {name}"))
        + 8;
    text[from..].split("```").next().unwrap().to_owned()
}

#[test]
fn a_network_like_smirk_gives_expression_jaw_lids_and_head() {
    let Some(runtime) = runtime() else { return };
    let weights: Vec<f32> = (0..50).map(|k| 0.1 * k as f32 - 2.0).collect();
    let outputs = [
        constant("shape_params", &[0, 300], &[0.0; 300]),
        constant("pose_params", &[0, 3], &[0.0, 0.4, 0.0]),
        constant("expression_params", &[0, 50], &weights),
        constant("jaw_params", &[0, 3], &[0.2, 0.0, 0.01]),
        constant("eyelid_params", &[0, 2], &[0.9, 0.1]),
    ];
    let seen = face(
        &runtime,
        ("image", &[0, 3, 224, 224]),
        &outputs,
        &example("smirk.toml"),
    );
    let seen = expressed(seen.unwrap());
    assert_eq!(seen.basis.as_ref().unwrap().name(), "flame-2020", "basis");
    assert_eq!(seen.weights, weights, "weights");
    assert_eq!(seen.eyelids, Some([0.9, 0.1]), "lids");
    same(
        &seen.jaw,
        Quat::from_scaled_axis(Vec3::new(0.2, 0.0, 0.01)),
        "jaw",
    );
    // A head that is not turned looks towards the camera: half a turn about x in axes with y down. One turned about FLAME's y looks to
    // its own left, which is the picture's right.
    let turn = seen.head.known().unwrap();
    let looks = turn * Vec3::Z;
    assert!(looks.x > 0.38 && looks.z < -0.9, "{looks}");
    assert!((turn * Vec3::Y).y < -0.99, "upright");
    assert!(
        seen.landmarks.is_some(),
        "the finder's landmarks come along"
    );
    assert!(
        seen.sight.unwrap().distance(MIDDLE) < 0.1,
        "{:?}",
        seen.sight
    );
}

#[test]
fn a_network_like_hamer_serves_the_left_hand_mirrored() {
    let Some(runtime) = runtime() else { return };
    let wrist = some_turn(20);
    let fingers: Vec<f32> = (0..15).flat_map(|k| rows(some_turn(k))).collect();
    let outputs = [
        constant("global_orient", &[0, 1, 3, 3], &rows(wrist)),
        constant("hand_pose", &[0, 15, 3, 3], &fingers),
        constant("betas", &[0, 10], &[0.0; 10]),
    ];
    let toml = example("hamer.toml").replace("size = 256", "size = 8");
    let [left, right] = hands(&runtime, &outputs, &toml).unwrap().map(hand_turned);
    same(&right.joints[0], wrist, "right wrist");
    // What a mirror does to a rotation, by matrices.
    let mirror = Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0));
    let mirrored = |q: Quat| Quat::from_mat3(&(mirror * Mat3::from_quat(q) * mirror));
    same(&left.joints[0], mirrored(wrist), "left wrist");
    for k in 0..15 {
        same(&right.joints[k + 1], some_turn(k), "right finger");
        same(&left.joints[k + 1], mirrored(some_turn(k)), "left finger");
    }
}

#[test]
fn the_other_side_is_shown_mirrored_and_its_landmarks_are_mirrored_back() {
    let Some(runtime) = runtime() else { return };
    // The first 42 numbers of the input are red in its first rows: x and y of each landmark in units of the input.
    let outputs = [
        ("points", &[1i64, 21, 2][..], Gives::Input(42)),
        constant(
            "metres",
            &[1, 21, 3],
            &[[0.1, 0.2, 0.3], [0.3, 0.0, 0.3]].concat().repeat(11)[..63],
        ),
    ];
    let toml = format!(
        "side = \"right\"\n{PLAIN}
        [[output]]\nname = \"points\"\nmeaning = \"landmarks_2d\"\norder = \"mediapipe-hand-21\"\nunit = \"0..1\"
        [[output]]\nname = \"metres\"\nmeaning = \"landmarks_3d\"\norder = \"mediapipe-hand-21\"\n"
    );
    let both = hands(&runtime, &outputs, &toml).unwrap();
    let [left, right] = both.map(|hand| match hand {
        Some(HandEstimate::Joints(hand)) => hand,
        other => panic!("no landmarks, but {other:?}"),
    });
    // Where the square begins, and red along a row of eight samples of two pixels each, as the network sees it.
    let begin = MIDDLE - SIZE / 2.0;
    let red = |k: usize| (begin.x + 2.0 * k as f32 + 0.5) * 4.0 / 255.0;
    for landmark in 0..4 {
        let (a, b) = (2 * landmark, 2 * landmark + 1);
        let expected = begin + SIZE * Vec2::new(red(a), red(b));
        let got = right.pixels[landmark];
        assert!(
            got.distance(expected) < 0.05,
            "right {landmark}: {got} {expected}"
        );
        let expected = begin + SIZE * Vec2::new(1.0 - red(7 - a), red(7 - b));
        let got = left.pixels[landmark];
        assert!(
            got.distance(expected) < 0.05,
            "left {landmark}: {got} {expected}"
        );
    }
    let apart = |metres: &[Vec3; 21]| metres[1] - metres[0];
    assert!(
        apart(&right.metres).distance(Vec3::new(0.2, -0.2, 0.0)) < 1e-5,
        "right"
    );
    assert!(
        apart(&left.metres).distance(Vec3::new(-0.2, -0.2, 0.0)) < 1e-5,
        "left"
    );
    let middle = right.metres.iter().sum::<Vec3>();
    assert!(middle.length() < 1e-4, "metres are about the hand's middle");
}

#[test]
fn a_turned_square_turns_what_is_seen_in_it_back() {
    let Some(runtime) = runtime() else { return };
    let turn = some_turn(2);
    let outputs = [
        constant("turn", &[1, 3], &turn.to_scaled_axis().to_array()),
        constant("points", &[1, 21, 2], &[0.5, 0.0].repeat(21)),
        constant(
            "metres",
            &[1, 21, 3],
            &[[0.0, -0.1, 0.0], [0.0; 3], [0.0; 3]].concat().repeat(7),
        ),
    ];
    let toml = format!(
        "side = \"right\"\n{PLAIN}turned = true\naspect = 1
        [[output]]\nname = \"turn\"\nmeaning = \"rotations\"\njoints = [\"right_wrist\"]\nrepresentation = \"axis-angle\"\nframe = \"camera\"
        [[output]]\nname = \"points\"\nmeaning = \"landmarks_2d\"\norder = \"mediapipe-hand-21\"\nunit = \"0..1\"
        [[output]]\nname = \"metres\"\nmeaning = \"landmarks_3d\"\norder = \"mediapipe-hand-21\"\n"
    );
    // The hand that is found points down to the right: what is up in the square is there in the picture.
    let along = Vec2::ONE.normalize();
    let quarters = Quat::from_rotation_z(135.0_f32.to_radians());
    let both = hands(&runtime, &outputs, &toml).unwrap();
    for (side, seen) in both.into_iter().map(hand_turned).enumerate() {
        let mirrored = Quat::from_xyzw(turn.x, -turn.y, -turn.z, turn.w);
        same(&seen.joints[0], quarters * [mirrored, turn][side], "wrist");
        let hand = seen.landmarks.unwrap();
        // Its box is a line as long as the square's diagonal.
        let expected = MIDDLE + along * (SIZE * 2.0_f32.sqrt() / 2.0);
        assert!(
            hand.pixels[0].distance(expected) < 1e-3,
            "{} {expected}",
            hand.pixels[0]
        );
        let apart = (hand.metres[0] - hand.metres[1]).truncate();
        assert!(apart.distance(along * 0.1) < 1e-5, "{apart}");
    }
}

#[test]
fn the_input_is_laid_out_coloured_and_scaled_as_described() {
    let Some(runtime) = runtime() else { return };
    let begin = MIDDLE - SIZE / 2.0;
    let pixel = |x: usize, y: usize| {
        [
            (begin.x + 2.0 * x as f32 + 0.5) * 4.0,
            (begin.y + 2.0 * y as f32 + 0.5) * 4.0,
            100.0,
        ]
    };
    for (layout, shape) in [("nchw", [1i64, 3, 8, 8]), ("nhwc", [1, 8, 8, 3])] {
        for colours in ["rgb", "bgr"] {
            let toml = format!(
                "[input]\nname = \"image\"\nsize = [8, 8]\nlayout = \"{layout}\"\ncolours = \"{colours}\"\nrange = [-1, 1]
                mean = [0.1, 0.2, 0.3]\nstd = [0.5, 0.25, 2.0]\n[crop]\nscale = 1.0
                [[output]]\nname = \"all\"\nmeaning = \"expression\"\nbasis = \"arkit-52\"\n"
            );
            let outputs = [("all", &[1i64, 192][..], Gives::Input(192))];
            let seen = expressed(face(&runtime, ("image", &shape), &outputs, &toml).unwrap());
            for (x, y, channel) in [(0, 0, 0), (5, 2, 1), (7, 7, 2), (3, 6, 0)] {
                let at = match layout {
                    "nchw" => channel * 64 + y * 8 + x,
                    _ => (y * 8 + x) * 3 + channel,
                };
                let colour = if colours == "rgb" {
                    channel
                } else {
                    2 - channel
                };
                let value = pixel(x, y)[colour] / 255.0 * 2.0 - 1.0;
                let expected = (value - [0.1, 0.2, 0.3][channel]) / [0.5, 0.25, 2.0][channel];
                let got = seen.weights[at];
                assert!(
                    (got - expected).abs() < 0.02,
                    "{layout} {colours} {x} {y} {channel}: {got} {expected}"
                );
            }
        }
    }
}

#[test]
fn an_input_that_is_no_square_is_the_middle_of_one() {
    let Some(runtime) = runtime() else { return };
    let toml = "[input]\nname = \"image\"\nsize = [8, 16]\n[crop]\nscale = 1.0\n
        [[output]]\nname = \"points\"\nmeaning = \"landmarks_2d\"\norder = \"coco-17\"\n";
    let outputs = [constant("points", &[1, 17, 2], &[0.0, 16.0].repeat(17))];
    let files = files(&network(("image", &[1, 3, 16, 8]), &outputs), toml);
    let mut model = custom::body(&files.onnx, Box::new(Finder), &runtime, 1).unwrap();
    let seen = model.run(view(&picture()), 0.0).unwrap().unwrap();
    let got = seen.landmarks().unwrap().points[0].pixel;
    // The box is heightened to the input's shape.
    let expected = MIDDLE + Vec2::new(-SIZE / 2.0, SIZE);
    assert!(got.distance(expected) < 1e-3, "{got} {expected}");
}

#[test]
fn every_way_to_write_a_rotation_gives_the_same() {
    let Some(runtime) = runtime() else { return };
    let turn = some_turn(3);
    let [a, d, g, b, e, h, c, f, i] = rows(turn);
    for (way, numbers) in [
        ("axis-angle", turn.to_scaled_axis().to_array().to_vec()),
        ("6d", vec![a, b, c, d, e, f]),
        ("6d-interleaved", vec![a, d, b, e, c, f]),
        ("6d-rows", vec![a, d, g, b, e, h]),
        ("matrix", vec![a, d, g, b, e, h, c, f, i]),
    ] {
        let length = [1, numbers.len() as i64];
        let seen = body(
            &runtime,
            &[constant("turn", &length, &numbers)],
            &format!(
                "[[output]]\nname = \"turn\"\nmeaning = \"rotations\"\njoints = [\"left_knee\"]\nrepresentation = \"{way}\"
                frame = \"parent\"\n"
            ),
        );
        let seen = body_turned(seen.unwrap());
        same(&seen.joints[4], turn, way);
        let known = seen
            .joints
            .iter()
            .filter(|joint| joint.known().is_some())
            .count();
        assert_eq!(known, 1, "{way}: the others are unknown");
    }
}

#[test]
fn joints_in_camera_axes_are_put_into_their_parents_frames() {
    let Some(runtime) = runtime() else { return };
    let (pelvis, hip, knee) = (some_turn(0), some_turn(9), some_turn(4));
    let flip = Quat::from_rotation_x(std::f32::consts::PI);
    for axes in ["y-down", "y-up"] {
        let numbers: Vec<f32> = [pelvis, pelvis * hip]
            .into_iter()
            .flat_map(|q| {
                rows(if axes == "y-up" {
                    flip.inverse() * q
                } else {
                    q
                })
            })
            .collect();
        let seen = body(
            &runtime,
            &[
                constant("all", &[1, 2, 9], &numbers),
                constant("knee", &[1, 9], &rows(knee)),
            ],
            &format!(
                "[[output]]\nname = \"all\"\nmeaning = \"rotations\"\njoints = [\"pelvis\", \"left_hip\"]\nrepresentation = \"matrix\"
                frame = \"camera\"\naxes = \"{axes}\"
                [[output]]\nname = \"knee\"\nmeaning = \"rotations\"\njoints = [\"left_knee\"]\nrepresentation = \"matrix\"
                frame = \"parent\"\n"
            ),
        );
        let seen = body_turned(seen.unwrap());
        same(&seen.joints[0], pelvis, axes);
        same(&seen.joints[1], hip, axes);
        same(&seen.joints[4], knee, axes);
    }
}

fn landmarks(order: &str, more: &str) -> String {
    format!(
        "[[output]]\nname = \"points\"\nmeaning = \"landmarks_2d\"\norder = \"{order}\"\n{more}\n"
    )
}

#[test]
fn landmarks_of_every_order_and_unit_arrive_in_the_picture() {
    let Some(runtime) = runtime() else { return };
    // (order, landmarks, one of them, and where that stands in BlazePose's order)
    for (order, count, from, to) in [
        ("blazepose-33", 33, 12, 12),
        ("coco-17", 17, 10, 16),
        ("halpe-26", 26, 25, 30),
        ("coco-wholebody-133", 133, 117, 20),
    ] {
        for (unit, at) in [
            ("pixels", [6.0, 2.0]),
            ("0..1", [0.75, 0.25]),
            ("-1..1", [0.5, -0.5]),
            ("-0.5..0.5", [0.25, -0.25]),
        ] {
            let mut numbers = [at[0] - 0.125, at[1], 0.5].repeat(count);
            numbers[from * 3] = at[0];
            let shape = [0, count as i64, 3];
            let more = format!("unit = \"{unit}\"\nnumbers = [\"x\", \"y\", \"confidence\"]");
            let toml = landmarks(order, &more);
            let seen = body(&runtime, &[constant("points", &shape, &numbers)], &toml);
            let seen = seen.unwrap().unwrap();
            let seen = seen.landmarks().unwrap();
            let expected = MIDDLE + SIZE * Vec2::new(0.25, -0.25);
            let got = seen.points[to].pixel;
            assert!(
                got.distance(expected) < 1e-3,
                "{order} {unit}: {got} {expected}"
            );
            assert!(
                (seen.points[to].confidence - 0.5).abs() < 1e-6,
                "{order} {unit}"
            );
            let others = finders::body();
            if order == "coco-17" {
                assert_eq!(seen.points[31], others.points[31], "toes stay the finder's");
            }
            assert_eq!(
                seen.points[to].metres, others.points[to].metres,
                "so do metres"
            );
        }
    }
}

#[test]
fn metres_are_counted_from_the_hips_whatever_their_unit_and_axes() {
    let Some(runtime) = runtime() else { return };
    let mut numbers = [100.0, 200.0, 300.0].repeat(17);
    // COCO's left shoulder.
    numbers[15..18].copy_from_slice(&[400.0, 700.0, 100.0]);
    for (axes, expected) in [
        ("y-down", Vec3::new(0.3, 0.5, -0.2)),
        ("y-up", Vec3::new(0.3, -0.5, 0.2)),
    ] {
        let toml = format!(
            "[[output]]\nname = \"points\"\nmeaning = \"landmarks_3d\"\norder = \"coco-17\"\nunit = \"millimetres\"\naxes = \"{axes}\"\n"
        );
        let seen = body(&runtime, &[constant("points", &[1, 51], &numbers)], &toml);
        let seen = seen.unwrap().unwrap();
        let seen = seen.landmarks().unwrap();
        assert!(
            seen.points[11].metres.distance(expected) < 1e-5,
            "{axes}: {}",
            seen.points[11].metres
        );
        assert_eq!(
            seen.points[11].pixel,
            finders::body().points[11].pixel,
            "the finder's"
        );
    }
}

#[test]
fn the_documentations_example_of_rtmpose_is_compared_with_the_network() {
    let Some(runtime) = runtime() else { return };
    let bins = |name| constant(name, &[1, 26, 2], &[0.0; 52]);
    let outputs = [bins("simcc_x"), bins("simcc_y")];
    let files = files(
        &network(("input", &[1, 3, 256, 192]), &outputs),
        &example("rtmpose.toml"),
    );
    let why = custom::body(&files.onnx, Box::new(Finder), &runtime, 1)
        .err()
        .unwrap();
    // Read, and compared with the outputs.
    assert!(
        why.to_string().contains("26 landmarks of 384 bins"),
        "{why}"
    );
}

#[test]
fn simcc_bins_are_landmarks_and_their_heights_probabilities() {
    let Some(runtime) = runtime() else { return };
    let axis = |bin: usize, height: f32| {
        let mut one = [0.0; 16];
        one[bin] = height;
        one.repeat(26)
    };
    let outputs = [
        constant("x", &[0, 26, 16], &axis(12, 0.9)),
        constant("y", &[0, 26, 16], &axis(4, 0.6)),
    ];
    let toml = "[[output]]\nname = \"x\"\nmeaning = \"simcc_x\"\norder = \"halpe-26\"
        [[output]]\nname = \"y\"\nmeaning = \"simcc_y\"\norder = \"halpe-26\"\n";
    let seen = body(&runtime, &outputs, toml).unwrap().unwrap();
    let point = seen.landmarks().unwrap().points[16];
    let expected = MIDDLE + SIZE * Vec2::new(0.25, -0.25);
    assert!(point.pixel.distance(expected) < 1e-3, "{}", point.pixel);
    assert!((point.confidence - 0.6).abs() < 1e-6, "the less sure axis");
}

#[test]
fn what_is_improbable_or_no_number_is_not_seen() {
    let Some(runtime) = runtime() else { return };
    let toml = landmarks("coco-17", "")
        + "[[output]]\nname = \"sure\"\nmeaning = \"confidence\"\nlogit = true
        [[output]]\nname = \"turn\"\nmeaning = \"rotations\"\njoints = [\"left_knee\"]\nrepresentation = \"6d\"\nframe = \"parent\"\n";
    let good = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    for (point, sure, turn, seen, why) in [
        (4.0, 3.0, good, true, "all is well"),
        (4.0, -1.0, good, false, "improbable"),
        (f32::NAN, 3.0, good, false, "a landmark that is none"),
        (1e30, 3.0, good, false, "a landmark beyond all bounds"),
        (4.0, f32::NAN, good, false, "a probability that is none"),
        (4.0, 3.0, [0.0; 6], false, "a rotation that is none"),
        (4.0, 3.0, [f32::INFINITY; 6], false, "an infinite rotation"),
    ] {
        let outputs = [
            constant("points", &[1, 17, 2], &[point; 34]),
            constant("sure", &[1], &[sure]),
            constant("turn", &[1, 6], &turn),
        ];
        let got = body(&runtime, &outputs, &toml).unwrap();
        assert_eq!(got.is_some(), seen, "{why}: {got:?}");
        if let Some(got) = got {
            let confidence = body_turned(Some(got)).joints[4].confidence;
            assert!(
                (confidence - 0.952_574).abs() < 1e-3,
                "the logistic of 3: {confidence}"
            );
        }
    }
    // A matrix that mirrors.
    let mirror = [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let toml = "[[output]]\nname = \"turn\"\nmeaning = \"rotations\"\njoints = [\"head\"]\nrepresentation = \"matrix\"\nframe = \"parent\"\n";
    let got = body(&runtime, &[constant("turn", &[9], &mirror)], toml).unwrap();
    assert!(got.is_none(), "a mirror is no rotation");
}

#[test]
fn what_does_not_fit_is_refused_with_a_reason() {
    let Some(runtime) = runtime() else { return };
    let points = [constant("points", &[1, 17, 2], &[0.0; 34])];
    let turn = |joints: &str, frame: &str| {
        format!(
            "[[output]]\nname = \"points\"\nmeaning = \"rotations\"\njoints = [{joints}]\nrepresentation = \"axis-angle\"\nframe = \"{frame}\"\n"
        )
    };
    let renamed = landmarks("coco-17", "").replace("points", "heat");
    for (toml, words) in [
        (renamed, vec!["no output heat", "points: float[1, 17, 2]"]),
        (
            landmarks("halpe-26", ""),
            vec!["points has 34 numbers", "26 landmarks of 2"],
        ),
        (
            landmarks("coco-18", ""),
            vec!["unknown variant `coco-18`", "`halpe-26`"],
        ),
        (
            landmarks("mediapipe-hand-21", ""),
            vec!["order of a hand", "for a body"],
        ),
        (
            landmarks("coco-17", "numbers = [\"x\", \"x\"]"),
            vec!["points", "once"],
        ),
        (
            landmarks("coco-17", "colour = 1"),
            vec!["unknown field `colour`"],
        ),
        (landmarks("coco-17", "").repeat(2), vec!["points twice"]),
        (turn("\"nose\"", "parent"), vec!["turns nose", "no joint"]),
        (turn("\"left_index1\"", "parent"), vec!["left_index1"]),
        (
            turn("\"head\"", "parent"),
            vec!["points has 34 numbers", "1 joints of 3"],
        ),
        (String::new(), vec!["output"]),
        (
            "[[output]]\nname = \"points\"\nmeaning = \"jaw\"\n".to_owned(),
            vec!["a jaw", "for a body"],
        ),
    ] {
        let why = body(&runtime, &points, &toml).unwrap_err();
        assert!(matches!(why, TrackerError::Description { .. }), "{why:?}");
        let text = why.to_string();
        let all = words.iter().all(|word| text.contains(word));
        assert!(all, "{toml}\n{text}\nlacks one of {words:?}");
        assert!(
            text.contains("network.toml") && text.contains("docs/models.md"),
            "{text}"
        );
    }
    let three = [constant("points", &[1, 3], &[0.0; 3])];
    for (toml, word) in [
        (turn("\"pelvis\"", "parent"), "camera"),
        (turn("\"left_knee\"", "camera"), "root"),
    ] {
        let why = body(&runtime, &three, &toml).unwrap_err().to_string();
        assert!(why.contains(word), "{why}");
    }
}

#[test]
fn files_that_are_missing_damaged_or_others_are_refused() {
    let Some(runtime) = runtime() else { return };
    let outputs = [constant("points", &[1, 17, 2], &[0.0; 34])];
    let good = network(INPUT, &outputs);
    let toml = format!("{PLAIN}{}", landmarks("coco-17", ""));
    let open = |onnx: &[u8], toml: &str| {
        let files = files(onnx, toml);
        custom::body(&files.onnx, Box::new(Finder), &runtime, 1)
            .map(|_| ())
            .map_err(|why| why.to_string())
    };
    assert_eq!(open(&good, &toml), Ok(()), "all is well");
    for end in (0..good.len()).step_by(5) {
        assert!(open(&good[..end], &toml).is_err(), "cut at {end}");
    }
    for at in (0..good.len()).step_by(3) {
        let mut other = good.clone();
        other[at] ^= 0x55;
        // Whatever it says: it must not panic.
        let _ = open(&other, &toml);
    }
    for (from, to, words) in [
        (
            "size = 8",
            "size = 16",
            ["image: float[?, 3, 8, 8]", "[1, 3, 16, 16]"],
        ),
        ("\"image\"", "\"picture\"", ["image", "picture"]),
        (
            "size = 8",
            "size = 8\nlayout = \"nhwc\"",
            ["[?, 3, 8, 8]", "[1, 8, 8, 3]"],
        ),
        ("size = 8", "size = 100000", ["100000", "2048"]),
        ("scale = 1.0", "aspect = 0", ["aspect", "0.1"]),
        ("size = 8", "size = 8\nstd = [1, 0, 1]", ["std", "0"]),
        ("scale = 1.0", "scale = -1.0", ["scale", "-1"]),
        ("[input]", "side = \"left\"\n[input]", ["hand", "side"]),
    ] {
        let why = open(&good, &toml.replace(from, to)).unwrap_err();
        assert!(words.iter().all(|word| why.contains(word)), "{why}");
    }
    let folder = tempfile::tempdir().unwrap();
    let none = folder.path().join("none.onnx");
    let why = custom::body(&none, Box::new(Finder), &runtime, 1)
        .err()
        .unwrap()
        .to_string();
    assert!(
        why.contains("none.toml") && why.contains("cannot read"),
        "{why}"
    );
}

#[test]
fn a_description_names_its_network_and_options_put_all_in_their_places() {
    let Some(runtime) = runtime() else { return };
    let folder = tempfile::tempdir().unwrap();
    let outputs = [constant("points", &[1, 17, 2], &[4.0; 34])];
    std::fs::write(folder.path().join("a.onnx"), network(INPUT, &outputs)).unwrap();
    let toml = format!("network = \"a.onnx\"\n{PLAIN}{}", landmarks("coco-17", ""));
    let path = folder.path().join("b.toml");
    std::fs::write(&path, toml).unwrap();
    let models = || tracker::models::Models {
        body: Box::new(Finder),
        hands: HandModels::None,
        face: None,
    };
    let options = custom::Options {
        body: Some(path.clone()),
        ..custom::Options::default()
    };
    let mut models_with = options.load(models(), &runtime).unwrap();
    let seen = models_with
        .body
        .run(view(&picture()), 0.0)
        .unwrap()
        .unwrap();
    let nose = seen.landmarks().unwrap().points[0].pixel;
    assert!(nose.distance(MIDDLE) < 1e-3, "the network's own: {nose}");
    for options in [
        custom::Options {
            hand: Some(path.clone()),
            ..custom::Options::default()
        },
        custom::Options {
            face: Some(path),
            ..custom::Options::default()
        },
    ] {
        let why = options.load(models(), &runtime).unwrap_err().to_string();
        assert!(why.contains("found by the default networks"), "{why}");
    }
    assert_eq!(SIDE, 64, "the picture's side");
}
