//! Networks cut short and corrupted: an error or a graph, and never a panic, however often.

use crate::files::network;
use tflite_to_onnx::{ConvertError, Options, convert};

/// Numbers that are the same in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % bound
    }
}

/// The places of `bytes` that are structure rather than weights: those whose corruption changes whether the file can be read. Sought
/// coarsely: tables lie together, so a place beside one that changes something is likely structure too.
fn structure(bytes: &[u8]) -> Vec<usize> {
    let whole = convert(bytes, &Options::default()).unwrap();
    let mut damaged = bytes.to_vec();
    let mut found = Vec::new();
    let block = bytes.len().div_ceil(300);
    for start in (0..bytes.len()).step_by(block) {
        let end = (start + block).min(bytes.len());
        damaged[start..end].fill(0xff);
        match convert(&damaged, &Options::default()) {
            Ok(other) if other.onnx.len() == whole.onnx.len() => {}
            _ => found.extend(start..end),
        }
        damaged[start..end].copy_from_slice(&bytes[start..end]);
    }
    found
}

fn survives_corruption(name: &str, times: usize) {
    let Some(bytes) = network(name) else {
        return;
    };
    let places = structure(&bytes);
    let mut random = Random(1);
    let mut damaged = bytes.clone();
    let (mut refused, mut taken) = (0, 0);
    for _ in 0..times {
        let place = places[random.below(places.len())];
        let width = [1, 1, 2, 4][random.below(4)];
        let end = (place + width).min(bytes.len());
        for byte in &mut damaged[place..end] {
            *byte = match random.below(4) {
                0 => 0xff,
                1 => 0x7f,
                2 => 0,
                _ => u8::try_from(random.below(256)).unwrap(),
            };
        }
        match convert(&damaged, &Options::default()) {
            Ok(_) => taken += 1,
            Err(_) => refused += 1,
        }
        damaged[place..end].copy_from_slice(&bytes[place..end]);
    }
    println!(
        "{name}: {refused} refused and {taken} taken, of {times} corrupted in one of {} bytes of structure",
        places.len()
    );
    assert!(refused > 0, "{name}: no corruption hit the structure");
}

#[test]
fn a_corrupted_network_ends_in_an_error_or_a_graph() {
    survives_corruption("operators", 20_000);
    survives_corruption("hand_recrop", 4000);
}

#[test]
fn a_corrupted_sparse_network_ends_in_an_error_or_a_graph() {
    survives_corruption("pose_detection", 300);
}

#[test]
fn a_corrupted_network_with_custom_operators_ends_in_an_error_or_a_graph() {
    survives_corruption("face_landmark_with_attention", 1000);
}

#[test]
fn a_network_cut_short_is_refused() {
    let Some(bytes) = network("hand_recrop") else {
        return;
    };
    let dense = 0..4096.min(bytes.len());
    for length in dense.chain((0..bytes.len()).step_by(61)) {
        let result = convert(&bytes[..length], &Options::default());
        assert!(
            result.is_err(),
            "{length} of {} bytes were taken",
            bytes.len()
        );
    }
}

#[test]
fn what_is_no_network_is_called_so() {
    for bytes in [
        &b""[..],
        b"TFL3",
        b"PK\x03\x04 a zip of something",
        &[0; 64],
    ] {
        assert_eq!(
            convert(bytes, &Options::default()),
            Err(ConvertError::NotTflite),
            "{bytes:?}"
        );
    }
    // The mark alone, before offsets that lead nowhere.
    let result = convert(b"\xff\xff\xff\x7fTFL3", &Options::default());
    assert!(
        matches!(result, Err(ConvertError::Damaged { .. })),
        "{result:?}"
    );
}

#[test]
fn outputs_that_there_are_not_are_refused() {
    let Some(bytes) = network("hand_recrop") else {
        return;
    };
    for asked in [vec![], vec![1], vec![0, 0]] {
        let options = Options {
            outputs: Some(asked.clone()),
        };
        let refused = ConvertError::Outputs { asked, count: 1 };
        assert_eq!(convert(&bytes, &options), Err(refused), "{options:?}");
    }
}
