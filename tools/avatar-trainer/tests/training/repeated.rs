//! The same training: alone, on several threads, and interrupted.

use crate::studio::{capture, motions, poses, puppet, stranger};
use avatar_trainer::{Options, Trainer};
use capture::{Capture, HeldOut};
use rayon::ThreadPoolBuilder;
use spmm3::Avatar;
use std::path::Path;

const STEPS: u16 = 400;
const INTERRUPTED: [u16; 4] = [37, 95, 121, 257];

fn begun<'a>(capture: &'a Capture, first: &Avatar) -> Trainer<'a> {
    let options = Options {
        gaussians: 230,
        colour_correction: true,
        ..Options::default()
    };
    let frames = poses(capture, first);
    Trainer::new(capture, first.clone(), frames, options).expect("a training")
}

fn train(trainer: &mut Trainer<'_>, steps: std::ops::Range<u16>) {
    for step in steps {
        let progress = f32::from(step) / f32::from(STEPS);
        trainer.step(progress).expect("a step");
    }
}

/// The checkpoint's and the package's bytes.
fn bytes(trainer: &Trainer<'_>, folder: &Path) -> [Vec<u8>; 2] {
    let path = folder.join("checkpoint.safetensors");
    trainer.save(&path, &0.5).expect("written");
    let package = trainer.avatar().expect("an avatar").to_bytes();
    [
        std::fs::read(path).expect("read"),
        package.expect("a package"),
    ]
}

#[test]
fn any_number_of_threads_and_an_interruption_give_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let pictures = folder.path().join("capture");
    let capture = capture(&pictures, &truth, 3, &motions(4), &HeldOut::default());
    let first = stranger(&truth);
    let on = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| {
            let mut trainer = begun(&capture, &first);
            train(&mut trainer, 0..STEPS);
            bytes(&trainer, folder.path())
        })
    };
    let alone = on(1);
    assert!(on(3) == alone, "three threads");

    // Populations change after every 60 steps at the earliest: between two changes, beside one, and late.
    let path = folder.path().join("interrupted.safetensors");
    let mut trainer = begun(&capture, &first);
    let (mut done, mut populations) = (0, Vec::new());
    for interrupted in INTERRUPTED {
        train(&mut trainer, done..interrupted);
        populations.push(trainer.gaussians());
        trainer.save(&path, &17.25).expect("written");
        drop(trainer);
        let note: f64;
        (trainer, note) = Trainer::resume(&capture, &path, None).expect("taken up");
        assert!((note - 17.25).abs() < 1e-12, "the note is kept");
        assert_eq!(trainer.steps(), u64::from(interrupted), "where it was");
        done = interrupted;
    }
    populations.push(trainer.gaussians());
    train(&mut trainer, done..STEPS);
    populations.push(trainer.gaussians());
    println!("Gaussians at each interruption and at the end: {populations:?}");
    assert!(
        populations
            .windows(2)
            .filter(|pair| pair[0] < pair[1])
            .count()
            >= 2,
        "the population grows before and after an interruption: {populations:?}"
    );
    assert!(
        populations.iter().all(|count| *count <= 230),
        "within the budget"
    );
    let resumed = bytes(&trainer, folder.path());
    assert!(resumed[1] == alone[1], "the package of a resumed training");
    assert!(resumed[0] == alone[0], "the state of a resumed training");
}
