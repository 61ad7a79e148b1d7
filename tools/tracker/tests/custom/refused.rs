//! What is refused, and where options put what is not.

use super::*;

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
fn shapes_whose_product_is_beyond_all_memory_are_refused() {
    let Some(runtime) = runtime() else { return };
    for shape in [
        &[1, 1 << 25][..],
        // In 64 bits 0 would be left of them, 136 and no number that fits.
        &[1 << 32, 1 << 32],
        &[1, (1 << 62) + 17, 4, 2],
        &[i64::MAX, i64::MAX, i64::MAX],
    ] {
        let outputs = [constant("points", shape, &[0.0; 34])];
        let why = body(&runtime, &outputs, &landmarks("coco-17", ""))
            .unwrap_err()
            .to_string();
        let words = ["points", "more than 16777216 numbers"];
        assert!(words.iter().all(|word| why.contains(word)), "{why}");
    }
}

#[test]
fn outputs_that_contradict_each_other_are_refused() {
    let Some(runtime) = runtime() else { return };
    let bins = |name| constant(name, &[1, 26, 16], &[0.0; 416]);
    let one = |name| constant(name, &[1, 1], &[1.0]);
    let output = |name: &str, meaning: &str, more: &str| {
        format!("[[output]]\nname = \"{name}\"\nmeaning = \"{meaning}\"\n{more}\n")
    };
    let halpe = "order = \"halpe-26\"";
    let coco = constant("a", &[1, 17, 16], &[0.0; 272]);
    for (outputs, toml, words) in [
        (
            vec![coco, bins("b")],
            output("a", "simcc_x", "order = \"coco-17\"") + &output("b", "simcc_y", halpe),
            ["simcc", "different orders"],
        ),
        (
            vec![bins("a"), bins("b"), bins("c")],
            output("a", "simcc_x", halpe)
                + &output("b", "simcc_y", halpe)
                + &output("c", "simcc_y", halpe),
            ["b and c", "both simcc_y"],
        ),
        (
            vec![bins("a")],
            output("a", "simcc_x", halpe),
            ["simcc_x and simcc_y", "go together"],
        ),
        (
            vec![bins("a")],
            output("a", "simcc_y", halpe),
            ["simcc_x and simcc_y", "go together"],
        ),
        (
            vec![one("a"), one("b")],
            output("a", "confidence", "") + &output("b", "confidence", ""),
            ["a and b", "both a confidence"],
        ),
    ] {
        let why = body(&runtime, &outputs, &toml).unwrap_err().to_string();
        assert!(words.iter().all(|word| why.contains(word)), "{why}");
    }
    let lids = |name| constant(name, &[1, 2], &[0.5; 2]);
    let outputs = [lids("a"), lids("b")];
    let toml = PLAIN.to_owned() + &output("a", "eyelids", "") + &output("b", "eyelids", "");
    let why = face(&runtime, INPUT, &outputs, &toml)
        .unwrap_err()
        .to_string();
    assert!(why.contains("both eyelids"), "{why}");
}

#[test]
fn files_that_are_missing_damaged_or_others_are_refused() {
    let Some(runtime) = runtime() else { return };
    let outputs = [constant("points", &[1, 17, 2], &[0.0; 34])];
    let good = network(INPUT, &outputs);
    let toml = format!("{PLAIN}{}", landmarks("coco-17", ""));
    let open = |onnx: &[u8], toml: &str| {
        let files = files(onnx, toml);
        custom::body(&files.onnx, Box::new(Finder), &runtime, ONE_THREAD)
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
    let why = custom::body(&none, Box::new(Finder), &runtime, ONE_THREAD)
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
