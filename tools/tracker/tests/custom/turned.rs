//! Networks that give rotations and expressions, and how their input is laid out.

use super::*;

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
    let mut model = custom::body(&files.onnx, Box::new(Finder), &runtime, ONE_THREAD).unwrap();
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
