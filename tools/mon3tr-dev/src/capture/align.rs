//! `mon3tr-dev capture align`: a capture whose cameras and poses meet the outlines of its masks.

use ::capture::Capture;
use anyhow::Context;
use glam::DQuat;
use mon3tr::device_options::makehuman;
use person_template::{TemplateOptions, align};
use std::path::PathBuf;

/// Options of `capture align`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// The capture's folder, in our own layout; its calibration and motion are written anew
    #[arg(value_name = "CAPTURE")]
    capture: PathBuf,
}

pub(super) fn run(options: &Options) -> anyhow::Result<()> {
    let mut capture = Capture::open(&options.capture)?;
    let aligned = align(
        &capture,
        &makehuman()?,
        &TemplateOptions::default(),
        &|step| eprintln!("{step} ..."),
    )
    .context("cannot align the capture")?;
    for (index, pose) in aligned.camera_from_world.iter().enumerate() {
        let camera = &capture.cameras()[index];
        let turn = pose.matrix3 * camera.camera_from_world.matrix3.transpose();
        let axis = DQuat::from_mat3(&turn).to_scaled_axis();
        println!(
            "{}: turned by {:.2} degrees, which moves its picture by {:.1}, {:.1} pixels",
            camera.name,
            axis.length().to_degrees(),
            axis.y * camera.focal[0],
            -axis.x * camera.focal[1],
        );
        capture.place(index, *pose)?;
    }
    capture.rewrite(aligned.poses)?;
    println!(
        "{}: a dressed body overlaps the masks by {:.3} (intersection over union), by {:.3} before",
        options.capture.display(),
        aligned.overlap,
        aligned.overlap_before
    );
    Ok(())
}
