//! Captures and checkpoints that are not what they should be.

use crate::studio::{capture, motions, poses, puppet, stranger};
use avatar_trainer::{Options, TrainError, Trainer};
use capture::{Capture, HeldOut};
use std::path::Path;
use test_support::errors::whole_message;

#[test]
fn a_picture_that_breaks_mid_way_is_named_and_the_best_package_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let pictures = folder.path().join("capture");
    let truth = puppet();
    let capture = capture(&pictures, &truth, 2, &motions(3), &HeldOut::default());
    let first = stranger(&truth);
    let package = folder.path().join("me.m3a");
    let options = Options {
        // Nothing is kept decoded: every picture is read again.
        picture_memory: 0,
        ..Options::default()
    };
    let frames = poses(&capture, &first);
    let mut trainer = Trainer::new(&capture, first, frames, options).expect("a training");
    for _ in 0..10 {
        trainer.step(0.0).expect("a step");
    }
    let validation = trainer.validate().expect("drawn");
    assert!(
        trainer.keep_best(&validation, &package).expect("written"),
        "the first is the best"
    );
    assert!(
        !trainer.keep_best(&validation, &package).expect("compared"),
        "no better one"
    );
    let before = std::fs::read(&package).expect("a package");
    let picture = pictures.join("frames").join("cam01").join("000001.png");
    let bytes = std::fs::read(&picture).expect("a picture");
    std::fs::write(&picture, &bytes[..bytes.len() / 2]).expect("cut short");

    let said = (0..12)
        .find_map(|_| trainer.step(0.1).err())
        .expect("the picture is among two rounds of six");
    assert!(matches!(said, TrainError::Capture(_)), "{said:?}");
    let said = whole_message(&said);
    assert!(said.contains("000001.png"), "{said}");
    assert!(
        std::fs::read(&package).expect("a package") == before,
        "the best package is still there"
    );
    let checkpoint = folder.path().join("checkpoint.safetensors");
    trainer
        .save(&checkpoint, &())
        .expect("the state can be kept");
    std::fs::write(&picture, &bytes).expect("mended");
    let (mut trainer, ()) = Trainer::resume(&capture, &checkpoint, None).expect("taken up");
    trainer.step(0.1).expect("it goes on");
}

#[test]
fn a_checkpoint_of_another_capture_or_damaged_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let of = |name: &str, cameras: u32| {
        let folder = folder.path().join(name);
        capture(&folder, &truth, cameras, &motions(2), &HeldOut::default())
    };
    let (one, other) = (of("one", 2), of("other", 3));
    let first = stranger(&truth);
    let frames = poses(&one, &first);
    let trainer = Trainer::new(&one, first, frames, Options::default()).expect("a training");
    let path = folder.path().join("checkpoint.safetensors");
    trainer.save(&path, &()).expect("written");
    let refused = |capture: &Capture, path: &Path| {
        let error = Trainer::resume::<()>(capture, path, None).map(|_| ());
        error.expect_err("refused").to_string()
    };
    let said = refused(&other, &path);
    assert!(said.contains("2 cameras"), "{said}");
    let bytes = std::fs::read(&path).expect("read");
    for length in [0, 7, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).expect("cut short");
        let said = refused(&one, &path);
        assert!(said.contains("checkpoint"), "{length} bytes: {said}");
    }
    std::fs::write(&path, &bytes).expect("mended");
    Trainer::resume::<()>(&one, &path, None).expect("its own capture");

    // The same folder, changed since.
    let manifest = folder.path().join("one").join("capture.json");
    let text = std::fs::read_to_string(&manifest).expect("read");
    let mut changed: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    changed["cameras"][1]["focal"][0] = 140.0.into();
    let edited = |changed: &serde_json::Value| {
        std::fs::write(&manifest, changed.to_string()).expect("written");
        refused(
            &Capture::open(&folder.path().join("one")).expect("a capture"),
            &path,
        )
    };
    let said = edited(&changed);
    assert!(said.contains("lenses"), "another focal length: {said}");
    let mut changed: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    changed["held_out"]["frames"] = serde_json::json!([[1, 2]]);
    let said = edited(&changed);
    assert!(said.contains("held out"), "a frame is held out now: {said}");
    std::fs::write(&manifest, text).expect("mended");
    std::fs::remove_file(folder.path().join("one").join("motion.npz")).expect("gone");
    let poseless = Capture::open(&folder.path().join("one")).expect("a capture");
    let said = refused(&poseless, &path);
    assert!(
        said.contains("poses are others"),
        "no motion any more: {said}"
    );
}

#[test]
fn a_camera_too_large_to_draw_for_is_named_before_anything_is_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    capture(folder.path(), &truth, 2, &motions(2), &HeldOut::default());
    let manifest = folder.path().join("capture.json");
    let text = std::fs::read_to_string(&manifest).expect("read");
    let mut changed: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    changed["cameras"][1]["size"] = serde_json::json!([6000, 4000]);
    std::fs::write(&manifest, changed.to_string()).expect("written");
    let capture = Capture::open(folder.path()).expect("a capture");
    let first = stranger(&truth);
    let frames = poses(&capture, &first);
    let refused = Trainer::new(&capture, first, frames, Options::default()).map(|_| ());
    let said = refused.expect_err("too large").to_string();
    assert!(
        said.contains("cam01") && said.contains("6000 x 4000"),
        "{said}"
    );
}

#[test]
fn a_package_that_is_not_there_is_written_although_a_better_one_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let pictures = folder.path().join("capture");
    let capture = capture(&pictures, &truth, 2, &motions(2), &HeldOut::default());
    let first = stranger(&truth);
    let frames = poses(&capture, &first);
    let mut trainer =
        Trainer::new(&capture, first, frames, Options::default()).expect("a training");
    let mut validation = trainer.validate().expect("drawn");
    let package = folder.path().join("me.m3a");
    assert!(
        trainer.keep_best(&validation, &package).expect("written"),
        "the first is the best"
    );
    let checkpoint = folder.path().join("checkpoint.safetensors");
    trainer.save(&checkpoint, &()).expect("kept");
    let (mut trainer, ()) = Trainer::resume(&capture, &checkpoint, None).expect("taken up");
    validation.psnr -= 1.0;
    let kept = trainer.keep_best(&validation, &package).expect("compared");
    assert!(!kept, "the better one stays");
    let other = folder.path().join("new.m3a");
    assert!(
        trainer.keep_best(&validation, &other).expect("written"),
        "the only one"
    );
    assert!(other.exists(), "it is there");
    assert_eq!(
        trainer.best(),
        Some(validation.psnr),
        "and its figure is told"
    );
}

#[test]
fn what_is_held_out_is_never_looked_at() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let held_out = HeldOut {
        cameras: vec![1],
        frames: vec![2, 3],
    };
    let capture = capture(folder.path(), &truth, 3, &motions(4), &held_out);
    let first = stranger(&truth);
    let frames = poses(&capture, &first);
    let trainer = Trainer::new(&capture, first, frames, Options::default()).expect("a training");
    let split = trainer.split();
    let all = split.training.iter().chain(&split.validation);
    assert_eq!(all.clone().count(), 4, "two cameras, two frames");
    for pair in all {
        assert!(pair.camera != 1 && pair.frame < 2, "{pair:?}");
    }
    let mut trainer = trainer;
    for (camera, of) in capture.cameras().iter().enumerate() {
        for frame in (0..4).filter(|frame| camera == 1 || *frame >= 2) {
            for kind in ["frames", "masks"] {
                let file = format!("{kind}/{}/{frame:06}.png", of.name);
                std::fs::write(folder.path().join(file), "no picture").expect("written");
            }
            assert!(capture.photograph(camera, frame).is_err(), "it is rubbish");
        }
    }
    for step in 0..20u8 {
        trainer
            .step(f32::from(step) / 20.0)
            .expect("a step on the others");
    }
    trainer.validate().expect("drawn beside the others");
}
