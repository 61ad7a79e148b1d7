//! What a training does when a number goes wrong, and what it keeps in order.

mod differences;
mod exported;
#[path = "../../../tests/training/studio.rs"]
mod studio;

use super::optimiser::FramePose;
use super::{CENTRE_EVERY, Trainer, gauge};
use crate::density::Plan;
use crate::error::TrainError;
use crate::options::Options;
use capture::{Capture, HeldOut};
use glam::Vec3;
use spmm3::attribute;
use std::path::Path;
use studio::{capture, motions, poses, puppet, stranger};

fn begun(capture: &Capture) -> Trainer<'_> {
    let first = stranger(&puppet());
    let frames = poses(capture, &first);
    Trainer::new(capture, first, frames, Options::default()).expect("a training")
}

fn pictures(folder: &Path) -> Capture {
    capture(folder, &puppet(), 2, &motions(3), &HeldOut::default())
}

fn all_are_finite(trainer: &Trainer<'_>) -> bool {
    let adams = trainer
        .optimiser
        .arrays
        .iter()
        .flat_map(|adam| [&adam.first, &adam.second]);
    let arrays = trainer.parameters.arrays();
    let mut all = arrays
        .into_iter()
        .map(|(_, array)| array)
        .chain(adams.map(Vec::as_slice));
    all.all(|array| array.iter().all(|number| number.is_finite()))
}

#[test]
fn a_gaussian_that_is_not_finite_ends_the_step_and_is_not_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = pictures(&folder.path().join("capture"));
    let mut trainer = begun(&capture);
    for _ in 0..3 {
        trainer.step(0.3).expect("a step");
    }
    let path = folder.path().join("checkpoint.safetensors");
    trainer.save(&path, &()).expect("written");
    let good = std::fs::read(&path).expect("read");
    trainer.parameters.gaussians[5] = f32::NAN;
    let ended = trainer
        .step(0.3)
        .expect_err("it would draw, without this Gaussian");
    assert!(
        matches!(ended, TrainError::NotFinite { step: 3, .. }),
        "{ended}"
    );
    assert!(ended.to_string().contains("posed Gaussians"), "{ended}");
    let said = trainer.save(&path, &()).expect_err("refused").to_string();
    assert!(said.contains("parameters.gaussians"), "{said}");
    assert!(
        std::fs::read(&path).expect("read") == good,
        "the good one stays"
    );
}

#[test]
fn a_regularising_term_that_is_not_finite_moves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = pictures(folder.path());
    let mut trainer = begun(&capture);
    // So far away that no picture shows it, and the square of its distance is infinite.
    trainer.parameters.gaussians[7] = 1e25;
    let ended = (0..32).find_map(|_| trainer.step(0.3).err());
    let ended = ended.expect("every Gaussian has its turn");
    assert!(ended.to_string().contains("not finite"), "{ended}");
    assert!(all_are_finite(&trainer), "nothing took it up");
}

#[test]
fn a_population_that_cannot_change_leaves_everything_as_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = pictures(folder.path());
    let mut trainer = begun(&capture);
    trainer.step(0.3).expect("a step");
    let count = trainer.gaussians();
    let every: Vec<u32> = (0..).take(count).collect();
    let plan = Plan {
        kept: every.clone(),
        split: Vec::new(),
        cloned: every[..20].to_vec(),
    };
    // More than a package's bases may be.
    trainer.parameters.bases[3] = 5e3;
    let (parameters, optimiser) = (trainer.parameters.clone(), trainer.optimiser.clone());
    let (bound, controllers) = (trainer.bound.clone(), trainer.controllers.clone());
    trainer.carry_out(&plan, 1).expect_err("no networks");
    assert!(trainer.parameters == parameters, "parameters");
    assert!(trainer.optimiser == optimiser, "moments");
    assert!(trainer.bound == bound, "binding");
    assert!(trainer.controllers == controllers, "controllers");
    trainer.parameters.bases[3] = 0.0;
    trainer.carry_out(&plan, 1).expect("all is well");
    assert_eq!(trainer.gaussians(), count + 20, "and as many more");
    trainer.step(0.31).expect("it goes on");
}

#[test]
fn children_lie_where_their_parents_are_on_the_mesh_as_it_is_learnt() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = pictures(folder.path());
    let mut trainer = begun(&capture);
    let (count, template) = (trainer.gaussians(), trainer.first.template.clone());
    let vertices = template.vertices().len();
    // A wide coat: what is 10 cm in front of the body is 4 cm higher as well.
    for (v, vertex) in template.vertices().iter().enumerate() {
        let out = Vec3::new(
            0.0,
            0.04 * (9.0 * vertex.x).sin(),
            0.1 * (7.0 * vertex.y).cos(),
        );
        for axis in 0..3 {
            trainer.parameters.mesh_mean[axis * vertices + v] = out[axis];
        }
    }
    // Small ones, 5 cm off their triangles: clones lie within a fraction of a millimetre.
    for plane in attribute::LOG_SCALE {
        trainer.parameters.gaussians[plane * count..(plane + 1) * count].fill(1e-4f32.ln());
    }
    let height = attribute::OFFSET.start + 2;
    trainer.parameters.gaussians[height * count..(height + 1) * count].fill(0.05);
    let places = |trainer: &mut Trainer<'_>| -> Vec<Vec3> {
        let motion = trainer.motions[0].clone();
        trainer
            .model
            .pose(
                &trainer.parameters,
                &motion,
                None,
                &mut trainer.memory.posed,
            )
            .expect("posed");
        let planes = [0, 1, 2].map(|axis| trainer.memory.posed.gaussians().plane(axis));
        (0..planes[0].len())
            .map(|i| Vec3::from_array(planes.map(|plane| plane[i])))
            .collect()
    };
    trainer.motions[0] = spmm3::MotionParams::default();
    let before = places(&mut trainer);
    let every: Vec<u32> = (0..).take(count).collect();
    let plan = Plan {
        kept: every.clone(),
        split: Vec::new(),
        cloned: every,
    };
    trainer.carry_out(&plan, 1).expect("changed");
    let after = places(&mut trainer);
    assert_eq!(after.len(), 2 * count, "everyone has a clone");
    let mut furthest = 0.0f32;
    for place in after {
        let nearest = before.iter().map(|old| old.distance(place));
        furthest = furthest.max(nearest.fold(f32::INFINITY, f32::min));
    }
    println!(
        "clones are at most {:.2} mm from their parents",
        1e3 * furthest
    );
    assert!(furthest < 0.5e-3, "{furthest} m");
}

#[test]
fn poses_are_centred_every_few_steps() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = pictures(folder.path());
    let mut trainer = begun(&capture);
    let off_centre = |trainer: &Trainer<'_>| -> f32 {
        let mut centred = trainer.poses.clone();
        gauge::centre(&mut centred, &trainer.motions, &trainer.frames);
        let numbers = |poses: &[FramePose]| -> Vec<f32> {
            poses.iter().flat_map(|pose| pose.correction.0).collect()
        };
        let pairs = numbers(&trainer.poses).into_iter().zip(numbers(&centred));
        pairs.fold(0.0, |most, (now, then)| most.max((now - then).abs()))
    };
    for _ in 1..CENTRE_EVERY {
        trainer.step(0.5).expect("a step");
    }
    let before = off_centre(&trainer);
    assert!(before > 1e-5, "poses have moved: {before}");
    trainer.step(0.5).expect("a step");
    let after = off_centre(&trainer);
    assert!(after < 1e-7, "all in common is gone: {after}");
}

#[test]
fn pictures_are_looked_at_with_the_captures_own_poses() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = pictures(folder.path());
    let mut trainer = begun(&capture);
    let before = trainer.validate().expect("drawn").psnr;
    for pose in &mut trainer.poses {
        pose.correction.0[0] = 0.7;
    }
    let after = trainer.validate().expect("drawn").psnr;
    assert!((after - before).abs() < 1e-9, "{before}, {after}");
}

#[test]
fn an_avatar_that_has_learnt_more_takes_the_place_of_an_early_one_that_looks_better() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = pictures(&folder.path().join("capture"));
    let mut trainer = begun(&capture);
    let package = folder.path().join("me.m3a");
    let mut validation = trainer.validate().expect("drawn");
    let mut better = |trainer: &mut Trainer<'_>, psnr: f64| {
        validation.psnr = psnr;
        trainer.keep_best(&validation, &package).expect("written")
    };
    assert!(better(&mut trainer, 40.0), "the first");
    trainer.step(0.1).expect("a step");
    assert!(better(&mut trainer, 20.0), "it has learnt");
    trainer.step(0.9).expect("a step");
    assert!(!better(&mut trainer, 19.0), "it has become worse");
}
