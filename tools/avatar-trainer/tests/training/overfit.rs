//! The whole chain learns.

use crate::studio::{capture, motions, poses, puppet, stranger};
use avatar_trainer::{Options, Trainer};
use capture::HeldOut;

#[test]
fn two_hundred_gaussians_learn_two_cameras_to_35_db() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let capture = capture(folder.path(), &truth, 2, &motions(2), &HeldOut::default());
    let first = stranger(&truth);
    let frames = poses(&capture, &first);
    let options = Options {
        gaussians: 200,
        densify: false,
        ..Options::default()
    };
    let mut trainer = Trainer::new(&capture, first, frames, options).expect("a training");
    let before = trainer.validate().expect("drawn").psnr;
    let steps: u16 = 1600;
    for step in 0..steps {
        let progress = f32::from(step) / f32::from(steps);
        trainer.step(progress).expect("a step");
    }
    let after = trainer.validate().expect("drawn");
    println!("{before:.1} dB before, {:.1} dB learnt", after.psnr);
    assert!(
        !after.held_back,
        "four pictures are too few to hold any back"
    );
    assert!(after.psnr >= 35.0, "{:.1} dB, from {before:.1}", after.psnr);
}
