//! Each network, converted and run by ONNX Runtime, against what LiteRT, Google's own runtime, computed from the same picture; the
//! references are written by `reference.py`.

use crate::files::{network, reference, skip};
use npu_runtime::{Outputs, Provider, Runtime, Session, TensorSpec};
use tflite_to_onnx::{Options, Port, convert};

/// Largest error of an output, by its range.
const TOLERANCE: f32 = 1e-3;

/// Smooth noise as `reference.py` makes it: bytes on a grid of 9 x 9, by a linear congruential generator, and between them bilinear, in
/// integers. Rows, columns, channels.
fn picture(side: usize) -> Vec<u8> {
    let mut state = 1_u32;
    let grid: Vec<usize> = (0..9 * 9 * 3)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            usize::from(state.to_be_bytes()[0])
        })
        .collect();
    let mut bytes = Vec::with_capacity(side * side * 3);
    for (y, x) in (0..side * side).map(|k| (k / side * 2048 / side, k % side * 2048 / side)) {
        for channel in 0..3 {
            let at = |row: usize, column: usize| grid[(row * 9 + column) * 3 + channel];
            let column = |column: usize| {
                at(y / 256, column) * (256 - y % 256) + at(y / 256 + 1, column) * (y % 256)
            };
            let value = column(x / 256) * (256 - x % 256) + column(x / 256 + 1) * (x % 256);
            bytes.push(u8::try_from(value / 65536).unwrap());
        }
    }
    bytes
}

/// What LiteRT gave of one output.
struct Reference {
    length: usize,
    step: usize,
    range: f32,
    samples: Vec<f32>,
}

fn references(name: &str) -> Vec<Reference> {
    let bytes = reference(&format!("{name}.bin"));
    let mut words = bytes
        .chunks_exact(4)
        .map(|word| <[u8; 4]>::try_from(word).unwrap());
    let mut word = || words.next().unwrap();
    let outputs = u32::from_le_bytes(word());
    let references = (0..outputs)
        .map(|_| {
            let [length, step] =
                [word(), word()].map(|w| usize::try_from(u32::from_le_bytes(w)).unwrap());
            let [low, high] = [word(), word()].map(f32::from_le_bytes);
            let samples = (0..length.div_ceil(step)).map(|_| f32::from_le_bytes(word()));
            Reference {
                length,
                step,
                // A single value has no extent: its size stands for it.
                range: (high - low).max(high.abs()),
                samples: samples.collect(),
            }
        })
        .collect();
    assert_eq!(words.next(), None, "{name}: the reference goes on");
    references
}

fn specs(ports: &[Port]) -> Vec<TensorSpec> {
    ports
        .iter()
        .map(|port| TensorSpec::new(&port.name, &port.shape))
        .collect()
}

/// Converts network `name`, keeping `kept` or all, and runs it on the picture, whose values are -1 to 1 if `signed`, else 0 to 1.
fn run(name: &str, signed: bool, kept: Option<&[usize]>) -> Option<(Vec<Port>, Outputs)> {
    let tflite = network(name)?;
    let runtime = match Runtime::open(None) {
        Ok(runtime) => runtime,
        Err(why) => {
            skip(&format!("no ONNX Runtime: {why}"));
            return None;
        }
    };
    let options = Options {
        outputs: kept.map(<[usize]>::to_vec),
    };
    let converted = convert(&tflite, &options).unwrap();
    let mut session = Session::new(
        &runtime,
        &converted.onnx,
        Provider::Cpu { threads: 1 },
        &specs(&converted.inputs),
        &specs(&converted.outputs),
    )
    .unwrap();
    let [input] = &converted.inputs[..] else {
        panic!("{name}: {:?}", converted.inputs);
    };
    let [1, 3, side, width] = input.shape[..] else {
        panic!("{name}: {input:?}");
    };
    assert_eq!(side, width, "{name}: the picture's sides");
    let bytes = picture(side);
    let pixels = session.input_mut(0);
    for (k, byte) in bytes.into_iter().enumerate() {
        let value = f32::from(byte);
        pixels[k % 3 * side * side + k / 3] = if signed {
            value / 127.5 - 1.0
        } else {
            value / 255.0
        };
    }
    let mut outputs = session.outputs().unwrap();
    session.run(&mut outputs).unwrap();
    Some((converted.outputs, outputs))
}

/// Compares outputs `kept`, or all.
fn agrees(name: &str, signed: bool, kept: Option<&[usize]>) {
    let Some((ports, outputs)) = run(name, signed, kept) else {
        return;
    };
    let references = references(name);
    let all: Vec<usize> = (0..references.len()).collect();
    let kept = kept.unwrap_or(&all);
    assert_eq!(ports.len(), kept.len(), "{name}: the number of outputs");
    for (place, k) in kept.iter().enumerate() {
        assert_eq!(ports[place].name, format!("out{k}"), "{name}");
        let (values, reference) = (outputs.get(place), &references[*k]);
        assert_eq!(values.len(), reference.length, "{name}: output {k}");
        let sampled = values.iter().step_by(reference.step);
        let mut worst = 0.0_f32;
        for (a, b) in sampled.zip(&reference.samples) {
            assert!(a.is_finite(), "{name}: output {k} has {a}");
            worst = worst.max((a - b).abs());
        }
        println!(
            "{name} output {k}: largest error {worst:e} of {}, {:e} of it",
            reference.range,
            worst / reference.range
        );
        assert!(
            worst <= TOLERANCE * reference.range,
            "{name}: output {k} is wrong by {worst}, its range is {}",
            reference.range
        );
    }
}

/// A network made for this test, by `operators.py`.
#[test]
fn each_operator_computes_what_litert_s_does() {
    agrees("operators", false, None);
}

#[test]
fn the_detector_of_people_computes_what_litert_does() {
    agrees("pose_detection", true, None);
}

#[test]
fn the_landmarks_of_a_body_are_litert_s() {
    agrees("pose_landmark_full", false, None);
}

#[test]
fn the_landmarks_of_a_body_by_the_larger_network_are_litert_s() {
    agrees("pose_landmark_heavy", false, Some(&[0, 1, 3, 4]));
}

#[test]
fn outputs_that_are_left_out_change_nothing_in_the_others() {
    agrees("pose_landmark_full", false, Some(&[0, 1, 4]));
}

#[test]
fn the_region_of_a_hand_is_litert_s() {
    agrees("hand_recrop", false, None);
}

#[test]
fn the_landmarks_of_a_hand_are_litert_s() {
    agrees("hand_landmark_full", false, None);
    agrees("hand_landmark_lite", false, None);
}

#[test]
fn the_detector_of_palms_computes_what_litert_does() {
    agrees("palm_detection_full", false, None);
}

#[test]
fn the_detector_of_faces_computes_what_litert_does() {
    agrees("face_detection_short_range", true, None);
}

/// Its custom operators are MediaPipe's, and so is the reference.
#[test]
fn the_landmarks_of_a_face_are_mediapipe_s() {
    agrees("face_landmark_with_attention", false, None);
}
