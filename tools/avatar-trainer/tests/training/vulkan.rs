//! The same training on a Vulkan device.

use crate::studio::{capture, motions, poses, puppet, stranger};
use avatar_trainer::{Options, StepReport, Trainer};
use capture::{Capture, HeldOut};
use splat_gradient_vulkan::VulkanSplatter;
use spmm3::Avatar;
use test_support::vulkan::{assert_silent, gpu};

const STEPS: u16 = 150;

/// Every step's report, and the package's bytes.
fn trained(
    capture: &Capture,
    first: &Avatar,
    device: Option<VulkanSplatter>,
) -> (Vec<StepReport>, Vec<u8>) {
    let options = Options {
        gaussians: 230,
        ..Options::default()
    };
    let frames = poses(capture, first);
    let mut trainer = Trainer::new(capture, first.clone(), frames, options).expect("a training");
    if let Some(device) = device {
        trainer.draw_with(Box::new(device));
    }
    let steps = (0..STEPS).map(|step| {
        let progress = f32::from(step) / f32::from(STEPS);
        trainer.step(progress).expect("a step")
    });
    let steps = steps.collect();
    let package = trainer.avatar().expect("an avatar").to_bytes();
    (steps, package.expect("a package"))
}

#[test]
fn a_training_on_a_vulkan_device_begins_as_the_cpus_and_ends_as_well_with_the_same_bytes_each_time()
{
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let capture = capture(folder.path(), &truth, 3, &motions(4), &HeldOut::default());
    let first = stranger(&truth);
    let device = || Some(VulkanSplatter::new(&gpu).expect("compiled"));
    let (steps, package) = trained(&capture, &first, device());
    let (expected, _) = trained(&capture, &first, None);
    let (loss, expected_loss) = (steps[0].loss, expected[0].loss);
    println!("first step: {loss}, on the CPU {expected_loss}");
    assert!(
        (loss / expected_loss - 1.0).abs() < 1e-5,
        "{loss}, on the CPU {expected_loss}"
    );
    let grown = steps.iter().any(|step| step.gaussians > steps[0].gaussians);
    assert!(grown, "the population changes on the way");
    let late = |steps: &[StepReport]| {
        let last = &steps[steps.len() - 30..];
        last.iter().map(|step| step.psnr).sum::<f64>() / 30.0
    };
    let (found, on_cpu) = (late(&steps), late(&expected));
    println!("last steps: {found:.2} dB, on the CPU {on_cpu:.2} dB");
    assert!(
        (found - on_cpu).abs() < 1.0,
        "{found} dB, on the CPU {on_cpu} dB"
    );
    assert!(
        found > steps[0].psnr + 3.0,
        "{found} dB, {} at first",
        steps[0].psnr
    );
    let (again, package_again) = trained(&capture, &first, device());
    assert!(again == steps, "the same steps");
    assert!(package_again == package, "the same package");
    assert_silent(&gpu);
}
