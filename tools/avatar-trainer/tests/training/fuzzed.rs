//! Checkpoints that somebody else wrote.

use crate::studio::{capture, motions, poses, puppet, stranger};
use avatar_trainer::{Options, TrainError, Trainer};
use capture::{Capture, HeldOut};
use proptest::prelude::*;
use proptest::sample::Index;
use serde_json::Value;
use std::path::Path;
use std::sync::OnceLock;

/// A capture and the bytes of a checkpoint of a training of it.
fn good() -> &'static (Capture, Vec<u8>) {
    static GOOD: OnceLock<(Capture, Vec<u8>)> = OnceLock::new();
    GOOD.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder").keep();
        let truth = puppet();
        let capture = capture(&folder, &truth, 2, &motions(2), &HeldOut::default());
        let first = stranger(&truth);
        let frames = poses(&capture, &first);
        let mut trainer =
            Trainer::new(&capture, first, frames, Options::default()).expect("a training");
        for _ in 0..3 {
            trainer.step(0.3).expect("a step");
        }
        let path = folder.join("checkpoint.safetensors");
        trainer.save(&path, &1.5).expect("written");
        drop(trainer);
        let bytes = std::fs::read(&path).expect("read");
        // What was opened needs its pictures as long as the test runs.
        (capture, bytes)
    })
}

/// Resumes from these bytes and makes a step.
fn resumed(bytes: &[u8]) -> Result<(), TrainError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    std::fs::write(&path, bytes).expect("written");
    let (mut trainer, note) = Trainer::resume::<f64>(&good().0, &path, None)?;
    assert!(note.is_finite(), "JSON has no other numbers");
    trainer.step(0.31).map(|_| ())
}

/// The JSON at the file's beginning, the training's text in it, and what follows.
fn parts(bytes: &[u8]) -> (Value, Value, &[u8]) {
    let (length, rest) = bytes.split_first_chunk::<8>().expect("a length");
    let length = usize::try_from(u64::from_le_bytes(*length)).expect("small");
    let header: Value = serde_json::from_slice(&rest[..length]).expect("a header");
    let text = header["__metadata__"]["mon3tr-training"]
        .as_str()
        .expect("a text");
    let text = serde_json::from_str(text).expect("JSON");
    (header, text, &rest[length..])
}

fn joined(mut header: Value, text: &Value, rest: &[u8]) -> Vec<u8> {
    header["__metadata__"]["mon3tr-training"] = text.to_string().into();
    let header = header.to_string();
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.as_bytes());
    bytes.extend(rest);
    bytes
}

/// All numbers of a JSON text.
fn numbers(value: &mut Value) -> Vec<&mut Value> {
    match value {
        Value::Number(_) => vec![value],
        Value::Array(items) => items.iter_mut().flat_map(numbers).collect(),
        Value::Object(members) => members.values_mut().flat_map(numbers).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn sizes_that_no_tensor_has_are_refused_before_memory_is_taken_for_them() {
    let (header, text, rest) = parts(&good().1);
    assert!(
        resumed(&joined(header.clone(), &text, rest)).is_ok(),
        "unchanged"
    );
    for field in ["gaussians", "controller_hidden", "bases", "rank"] {
        let mut text = text.clone();
        text[field] = 4096.into();
        let said = resumed(&joined(header.clone(), &text, rest)).expect_err(field);
        assert!(
            matches!(said, TrainError::Checkpoint { .. }),
            "{field}: {said}"
        );
    }
    let mut text = text;
    text["gaussians"] = 1_000_000.into();
    text["bases"] = 4096.into();
    // 229 TB of bases.
    let said = resumed(&joined(header, &text, rest)).expect_err("refused");
    assert!(matches!(said, TrainError::Checkpoint { .. }), "{said}");
}

#[test]
fn a_checkpoint_of_before_there_was_a_perceptual_loss_is_taken_up_and_one_of_another_version_is_not()
 {
    let (header, mut text, rest) = parts(&good().1);
    assert_eq!(text["version"], 5, "as it is written now");
    let photo = text["options"]["weights"].as_object_mut().expect("shares");
    photo.remove("lpips").expect("it is written now");
    let all = text.as_object_mut().expect("an object");
    all.remove("perceptual").expect("it is written now");
    for (version, sound) in [(3, false), (4, true), (6, false)] {
        text["version"] = version.into();
        let taken = resumed(&joined(header.clone(), &text, rest));
        assert_eq!(taken.is_ok(), sound, "version {version}: {taken:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_number_of_the_text_may_be_any_other(
        which in any::<Index>(),
        number in prop_oneof![
            Just(0u64), Just(1), Just(4096), Just(1_000_000), Just(u64::from(u32::MAX)), Just(u64::MAX), any::<u64>(),
        ],
    ) {
        let (header, mut text, rest) = parts(&good().1);
        let mut all = numbers(&mut text);
        let at = which.index(all.len());
        *all[at] = number.into();
        // An error or a training; neither a panic nor memory without end.
        let _ = resumed(&joined(header, &text, rest));
    }

    #[test]
    fn any_bytes_may_be_damaged(
        places in prop::collection::vec((any::<Index>(), any::<u8>()), 1..4),
        cut in prop::option::of(any::<Index>()),
    ) {
        let mut bytes = good().1.clone();
        for (place, value) in places {
            let at = place.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let _ = resumed(&bytes);
    }
}

#[test]
fn a_checkpoint_that_is_none_is_an_error() {
    assert!(resumed(b"").is_err(), "nothing");
    let missing = Trainer::resume::<f64>(&good().0, Path::new("/nowhere/checkpoint"), None);
    assert!(missing.is_err(), "no file");
}
