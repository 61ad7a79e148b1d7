//! Networks that give landmarks.

use super::*;

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
    let why = custom::body(&files.onnx, Box::new(Finder), &runtime, ONE_THREAD)
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
