//! `mon3tr render`: an avatar follows a motion; every frame a PNG, and one animation.

use crate::film::{Film, write_png};
use crate::performance::{MOTION_RATE, MotionOptions};
use crate::progress;
use crate::report::{RunReport, check_writable, write_json};
use crate::stage::{Size, Stage, Views, load_avatar};
use crate::surroundings::{Surroundings, make_folder};
use crate::viewpoint::Viewpoint;
use anyhow::Context;
use std::path::PathBuf;

/// Options of `render`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Avatar package (.m3a), as `bake` writes it
    #[arg(value_name = "PACKAGE")]
    package: PathBuf,
    #[command(flatten)]
    motion: MotionOptions,
    /// Folder for the pictures; made if missing
    #[arg(long, value_name = "FOLDER", default_value = "out/render")]
    out: PathBuf,
    /// Size of one picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1024x1024")]
    size: Size,
    /// Draw both eyes (files end in _left and _right)
    #[arg(long)]
    stereo: bool,
    /// front, three-quarter, side, back, waist-up, face, hands, or EYE:TARGET:FOV in metres and degrees relative to
    /// the person, e.g. 0,1.6,2:0,1.4,0:30
    #[arg(long, value_name = "VIEW", default_value = "three-quarter")]
    camera: Viewpoint,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Runs `render`.
pub(crate) fn run(options: &Options, surroundings: &Surroundings) -> anyhow::Result<()> {
    let (avatar, figures) = load_avatar(&options.package)?;
    let performance = options.motion.load(&avatar)?;
    let runtime = surroundings.runtime()?;
    let gpu = surroundings.gpu()?;
    make_folder(&options.out)?;
    options.json.as_deref().map_or(Ok(()), check_writable)?;

    let views = if options.stereo {
        Views::Stereo
    } else {
        Views::Mono
    };
    let mut stage = Stage::new(&gpu, &runtime, &avatar, options.size, views)?;
    let mut film = Film::start(options.out.join("animation.webp"), MOTION_RATE);
    let heading = performance.heading();
    let bar = progress::bar("drawing", performance.frames.len());
    let mut pictures = Vec::new();
    for (k, (motion, floor)) in performance.followed(&avatar).enumerate() {
        let drawn = stage.picture(motion, &options.camera, floor, heading)?;
        let sides: &[&str] = if options.stereo {
            &["_left", "_right"]
        } else {
            &[""]
        };
        for (picture, side) in drawn.iter().zip(sides) {
            let file = options.out.join(format!("frame_{k:05}{side}.png"));
            write_png(&file, picture)?;
            pictures.push(file);
        }
        film.add(
            drawn
                .into_iter()
                .next()
                .context("the renderer returned no picture")?,
        );
        bar.inc(1);
    }
    bar.finish_and_clear();
    pictures.insert(0, film.finish()?);

    let runs = vec![stage.times()];
    let report = RunReport::new(figures, &performance, &gpu, &runtime, runs, pictures);
    report.print();
    options
        .json
        .as_ref()
        .map_or(Ok(()), |file| write_json(file, &report))
}
