//! What was learnt from a few poses says little about others: an avatar that is driven far beyond its capture keeps together.

use crate::studio::{capture, model, motions, poses, puppet, stranger};
use avatar_gradient::Posed;
use avatar_trainer::{Options, Trainer};
use capture::HeldOut;
use spmm3::{BODY, MotionParams};

#[test]
fn a_pose_far_beyond_the_captures_moves_gaussians_and_vertices_little_more_than_the_captures_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let capture = capture(folder.path(), &truth, 2, &motions(4), &HeldOut::default());
    let first = stranger(&truth);
    let frames = poses(&capture, &first);
    let options = Options {
        gaussians: 200,
        densify: false,
        ..Options::default()
    };
    let mut trainer =
        Trainer::new(&capture, first.clone(), frames.clone(), options).expect("a training");
    for step in 0..200u8 {
        trainer.step(f32::from(step) / 200.0).expect("a step");
    }
    let (networks, trained) = model(&trainer.avatar().expect("an avatar"));
    let parameters = networks.parameters();
    let (networks, untrained) = model(&first);
    let before = networks.parameters();
    let (mut posed, mut first_posed) = (Posed::new(), Posed::new());
    // Root mean squares of F_attr's residuals, and of what F_mesh's fields have learnt.
    let mut moved = |motion: &MotionParams| -> [f32; 2] {
        let now = trained.pose(&parameters, motion, None, &mut posed);
        now.expect("posed");
        let then = untrained.pose(&before, motion, None, &mut first_posed);
        then.expect("posed");
        let rms = |squares: &mut dyn Iterator<Item = f32>| {
            let (sum, count) =
                squares.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
            f32::sqrt(sum / count)
        };
        let vertices = posed.canonical().iter().zip(first_posed.canonical());
        let means = parameters.mesh_mean.iter().zip(&before.mesh_mean);
        let fields = vertices.zip(means);
        let residuals = posed.local().iter().zip(&parameters.gaussians);
        [
            rms(&mut residuals.map(|(local, template)| local - template)),
            rms(&mut fields.map(|((now, then), (mean, before))| (now - mean) - (then - before))),
        ]
    };
    let mut most = [0.0f32; 2];
    for motion in &frames {
        for (most, moved) in most.iter_mut().zip(moved(motion)) {
            *most = most.max(moved);
        }
    }
    assert!(most[0] > 1e-4, "F_attr has learnt nothing");
    for sign in [-1.0, 1.0] {
        let mut far = frames[0].clone();
        for number in &mut far.values_mut()[..BODY] {
            *number += sign * 3.0;
        }
        for (most, moved) in most.iter().zip(moved(&far)) {
            assert!(moved < 3.0 * most, "{moved}, at most {most} in the capture");
        }
    }
}
