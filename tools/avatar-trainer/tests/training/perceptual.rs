//! A training that a network judges as well.

use crate::studio::{capture, motions, poses, puppet, stranger};
use avatar_trainer::{Options, Trainer};
use capture::{Capture, HeldOut};
use npu_runtime::Runtime;
use perceptual_loss::Lpips;
use splat_gradient::error::GradientError;
use splat_gradient::loss::PerceptualLoss;
use spmm3::Avatar;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use test_support::{lpips, onnx};

/// Steps of a training, and the first ones of them whose pictures are not whole yet.
const STEPS: u16 = 800;
const HALVED: u16 = 240;

/// Writes an LPIPS network of few features; more of them are another network.
fn network(folder: &Path, features: i64) -> PathBuf {
    let path = folder.join(format!("lpips-{features}.onnx"));
    let net = lpips::alexnet(17, 64, [features, 8, 8, 6, 6]);
    std::fs::write(&path, net.file()).expect("written");
    path
}

/// A capture of two cameras and two frames, and a first avatar.
fn captured(folder: &Path) -> (Capture, Avatar) {
    let truth = puppet();
    let pictures = folder.join("capture");
    let capture = capture(&pictures, &truth, 2, &motions(2), &HeldOut::default());
    (capture, stranger(&truth))
}

fn open(path: &Path, runtime: &Runtime, threads: usize) -> Box<dyn PerceptualLoss> {
    Box::new(Lpips::open(path, runtime, threads).expect("a network"))
}

fn begun<'a>(capture: &'a Capture, first: &Avatar, share: f32) -> Trainer<'a> {
    let mut options = Options {
        gaussians: 200,
        densify: false,
        ..Options::default()
    };
    options.weights.lpips = share;
    let frames = poses(capture, first);
    Trainer::new(capture, first.clone(), frames, options).expect("a training")
}

fn train(trainer: &mut Trainer<'_>, steps: std::ops::Range<u16>) {
    for step in steps {
        let progress = f32::from(step) / f32::from(STEPS);
        trainer.step(progress).expect("a step");
    }
}

/// Tells what a network finds.
#[derive(Debug)]
struct Overheard {
    network: Box<dyn PerceptualLoss>,
    distances: Arc<Mutex<Vec<f64>>>,
}

impl PerceptualLoss for Overheard {
    fn size(&self) -> [usize; 2] {
        self.network.size()
    }

    fn identity(&self) -> &str {
        self.network.identity()
    }

    fn compare(
        &mut self,
        drawn: &[f32],
        wanted: &[f32],
        by_drawn: &mut [f32],
    ) -> Result<f64, GradientError> {
        let distance = self.network.compare(drawn, wanted, by_drawn)?;
        self.distances.lock().expect("one thread").push(distance);
        Ok(distance)
    }
}

#[test]
fn the_distance_falls_further_where_it_is_learnt_from_and_only_whole_pictures_are_looked_at() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let (capture, first) = captured(folder.path());
    let path = network(folder.path(), 6);
    let learnt = |share: f32| {
        let distances = Arc::new(Mutex::new(Vec::new()));
        let mut trainer = begun(&capture, &first, share);
        let overheard = Overheard {
            network: open(&path, &runtime, 1),
            distances: Arc::clone(&distances),
        };
        trainer
            .judge_with(Box::new(overheard))
            .expect("at the start");
        train(&mut trainer, 0..HALVED);
        assert!(
            distances.lock().expect("free").is_empty(),
            "all were halved"
        );
        train(&mut trainer, HALVED..STEPS);
        let distances = distances.lock().expect("free");
        assert_eq!(
            distances.len(),
            usize::from((STEPS - HALVED).div_ceil(3)),
            "its turns"
        );
        let last = &distances[distances.len() - 20..];
        last.iter().sum::<f64>() / 20.0
    };
    // The same pictures and windows in both; so small a share only looks.
    let (with, without) = (learnt(0.3), learnt(1e-7));
    println!("{with:.4} where it is learnt from, {without:.4} where it is not");
    assert!(with < 0.85 * without, "{with}, without the term {without}");
}

#[test]
fn an_interrupted_training_goes_on_with_the_same_network_alone_and_ends_with_the_same_bytes() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let (capture, first) = captured(folder.path());
    let path = network(folder.path(), 6);
    let other = network(folder.path(), 7);
    let checkpoint = folder.path().join("checkpoint.safetensors");
    let bytes = |trainer: &Trainer<'_>| {
        trainer.save(&checkpoint, &()).expect("written");
        std::fs::read(&checkpoint).expect("read")
    };
    let mut trainer = begun(&capture, &first, 0.1);
    trainer
        .judge_with(open(&path, &runtime, 1))
        .expect("at the start");
    train(&mut trainer, 0..STEPS);
    let whole = bytes(&trainer);

    let mut trainer = begun(&capture, &first, 0.1);
    trainer
        .judge_with(open(&path, &runtime, 3))
        .expect("at the start");
    train(&mut trainer, 0..300);
    let late = trainer.judge_with(open(&path, &runtime, 1));
    let said = late.expect_err("it is too late").to_string();
    assert!(said.contains("after 300 steps"), "{said}");
    bytes(&trainer);
    drop(trainer);
    let refused = |loss: Option<Box<dyn PerceptualLoss>>| {
        let error = Trainer::resume::<()>(&capture, &checkpoint, loss).map(|_| ());
        error.expect_err("refused").to_string()
    };
    let mine = open(&path, &runtime, 1).identity().to_owned();
    let said = refused(None);
    assert!(said.contains(&mine) && said.contains("--lpips"), "{said}");
    let another = open(&other, &runtime, 1);
    let theirs = another.identity().to_owned();
    let said = refused(Some(another));
    assert!(said.contains(&mine) && said.contains(&theirs), "{said}");
    let same = Some(open(&path, &runtime, 3));
    let (mut trainer, ()) = Trainer::resume(&capture, &checkpoint, same).expect("taken up");
    train(&mut trainer, 300..STEPS);
    assert!(bytes(&trainer) == whole, "the state of a resumed training");

    let alone = begun(&capture, &first, 0.1);
    bytes(&alone);
    let said = refused(Some(open(&path, &runtime, 1)));
    assert!(said.contains("without a perceptual loss"), "{said}");
}
