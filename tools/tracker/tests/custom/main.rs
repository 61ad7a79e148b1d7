//! Networks of the user's: tiny ones that give constants or their own input, on models that find a fixed place.

mod finders;
mod marked;
mod onnx;
mod refused;
mod turned;

use finders::{Finder, HINT, MIDDLE, SIDE, SIZE, picture, view};
use glam::{Mat3, Quat, Vec2, Vec3};
use npu_runtime::{Provider, Runtime};
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

const ONE_THREAD: Provider = Provider::Cpu { threads: 1 };
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
    let mut model = custom::body(&files.onnx, Box::new(Finder), runtime, ONE_THREAD)?;
    model.run(view(&picture()), 0.0)
}

fn face(
    runtime: &Runtime,
    input: (&str, &[i64]),
    outputs: &[Output<'_>],
    toml: &str,
) -> Result<Option<FaceEstimate>, TrackerError> {
    let files = files(&network(input, outputs), toml);
    let mut model = custom::face(&files.onnx, Box::new(Finder), runtime, ONE_THREAD)?;
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
    let HandModels::Each([mut left, mut right]) =
        custom::hands(&files.onnx, finders, runtime, ONE_THREAD)?
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

fn landmarks(order: &str, more: &str) -> String {
    format!(
        "[[output]]\nname = \"points\"\nmeaning = \"landmarks_2d\"\norder = \"{order}\"\n{more}\n"
    )
}
