//! `mon3tr-dev reconstruct`: an avatar from a capture, trained through the splatter.

mod begin;
mod length;
mod progress_line;

use anyhow::{Context, bail, ensure};
use avatar_trainer::{Options as Training, Trainer, Validation};
use begin::{First, begin};
use capture::Capture;
use image::RgbImage;
use length::{Clock, Length, Note};
use mon3tr::device_options::{DeviceOptions, describe, make_folder};
use mon3tr::film::write_png;
use mon3tr::keys;
use mon3tr::network::Network;
use perceptual_loss::Lpips;
use progress_line::ProgressLine;
use splat_gradient::error::GradientError;
use splat_gradient::loss::PerceptualLoss;
use splat_gradient_vulkan::VulkanSplatter;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;

/// Options of `reconstruct`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The capture's folder: calibrated cameras, pictures, masks and motion
    #[arg(value_name = "CAPTURE")]
    capture: PathBuf,
    /// The package to write; whenever the training is ended, the best one so far is there
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// How long to train in all, what was done before --resume included; the first avatar is made besides [default: 60, or as long as the
    /// training that is resumed was to be]
    #[arg(long, value_name = "MINUTES", value_parser = length::parse_minutes)]
    minutes: Option<f64>,
    /// Train so many steps instead, however long they take: the same ones give the same bytes
    #[arg(long, value_name = "COUNT", conflicts_with = "minutes", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// The most Gaussians, e.g. 40000
    #[arg(long, value_name = "COUNT", default_value = "40000")]
    gaussians: usize,
    /// A first avatar of the person to begin with [default: made of the capture]
    #[arg(long, value_name = "PACKAGE")]
    template: Option<PathBuf>,
    /// Go on with the training that was ended or interrupted, with the options it was begun with
    #[arg(long, conflicts_with_all = ["template", "gaussians", "seed", "colour_correction", "without"])]
    resume: bool,
    /// What draws the pictures and takes their derivatives: the Vulkan device is the one that --gpu names; where there is none that can be used, the CPU does
    #[arg(long, value_name = "DEVICE", default_value = "cpu")]
    device: Device,
    /// Correct each camera's colours: for real cameras, whose exposures differ
    #[arg(long)]
    colour_correction: bool,
    /// Learn from LPIPS as well: a network as ONNX, the same file that eval avatar takes; with --resume, the one that the training was begun with
    #[arg(long, value_name = "FILE.onnx")]
    lpips: Option<PathBuf>,
    /// Leave a part out, to see what it is worth; may be given several times
    #[arg(long, value_name = "PART")]
    without: Vec<Part>,
    /// Orders the pictures and scatters new Gaussians
    #[arg(long, value_name = "NUMBER", default_value = "1")]
    seed: u64,
    /// Folder of the checkpoint and of the preview pictures; made if missing
    #[arg(long, value_name = "FOLDER", default_value = "out/reconstruct")]
    work: PathBuf,
}

/// What a training draws with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Device {
    /// The processor: the same steps give the same bytes, on any number of threads
    Cpu,
    /// A Vulkan device
    Gpu,
}

/// A part of the training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// F_mesh, which moves vertices by the pose
    Mesh,
    /// F_attr, which changes Gaussians by the pose
    Attributes,
    /// The refinement of the capture's poses
    Poses,
    /// The growth of the body model to the person's outlines: Gaussians are bound to a bare body
    Clothes,
}

impl Options {
    fn learns(&self, part: Part) -> bool {
        !self.without.contains(&part)
    }

    fn training(&self) -> Training {
        let learns = |part| self.learns(part);
        Training {
            seed: self.seed,
            gaussians: self.gaussians,
            colour_correction: self.colour_correction,
            learn_mesh: learns(Part::Mesh),
            learn_attributes: learns(Part::Attributes),
            refine_poses: learns(Part::Poses),
            ..Training::default()
        }
    }

    /// How long to train, where that is said.
    fn length(&self) -> Option<Length> {
        let minutes = self.minutes.map(Length::Minutes);
        self.steps.map(Length::Steps).or(minutes)
    }
}

/// The network that judges pictures as well, where there is one.
fn perceptual(
    options: &Options,
    device: &DeviceOptions,
) -> anyhow::Result<Option<Box<dyn PerceptualLoss>>> {
    let Some(path) = &options.lpips else {
        return Ok(None);
    };
    let network = Lpips::open(path, &device.runtime()?, DeviceOptions::threads())?;
    Ok(Some(Box::new(network)))
}

/// Of a training whose length nobody says, minutes.
const DEFAULT_MINUTES: f64 = 60.0;

/// Refuses options that would be of no effect.
fn check(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    ensure!(
        options.device == Device::Gpu || !device.names_gpu(),
        "--gpu names a Vulkan device, but the CPU draws: add --device gpu, or leave --gpu out"
    );
    Ok(())
}

/// Runs `reconstruct`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    check(options, device)?;
    let capture = Capture::open(&options.capture)?;
    for note in capture.notes() {
        eprintln!("{note}");
    }
    make_folder(&options.work)?;
    if let Some(folder) = options.out.parent().filter(|p| !p.as_os_str().is_empty()) {
        make_folder(folder)?;
    }
    // Before the first avatar, which takes minutes.
    let perceptual = perceptual(options, device)?;
    let checkpoint = options.work.join("checkpoint.safetensors");
    let (mut trainer, before) = if options.resume {
        let (trainer, note) = Trainer::resume::<Note>(&capture, &checkpoint, perceptual)?;
        ensure!(
            note.length.is_possible(),
            "{} is damaged: its training was to be {:?} long",
            checkpoint.display(),
            note.length
        );
        (trainer, Some(note))
    } else {
        ensure!(
            !checkpoint.exists(),
            "there is a training in {} already, which this one would write over: go on with it (--resume, which keeps its options), name another folder (--work), or delete {}",
            options.work.display(),
            checkpoint.display()
        );
        let clothes = options.learns(Part::Clothes);
        let first = match &options.template {
            Some(_) if !clothes => {
                bail!("--without clothes is of the first avatar that is made: leave --template out")
            }
            Some(path) => First::Package(path),
            None => First::Made {
                clothes,
                poses: options.learns(Part::Poses),
            },
        };
        let mut trainer = begin(&capture, first, options.training())?;
        if let Some(perceptual) = perceptual {
            trainer.judge_with(perceptual)?;
        }
        (trainer, None)
    };
    let drawn_on = match options.device {
        Device::Cpu => CPU.to_owned(),
        Device::Gpu => draw_on_gpu(&mut trainer, device),
    };
    let length = (options.length())
        .or(before.map(|note| note.length))
        .unwrap_or(Length::Minutes(DEFAULT_MINUTES));
    let mut clock = Clock::new(length, before.map_or(0.0, |note| note.seconds));
    let files = Files {
        checkpoint: &checkpoint,
        package: &options.out,
        work: &options.work,
    };
    let outcome = train(&mut trainer, &mut clock, &files);
    // Whatever ended it, all that was learnt is kept.
    let saved = trainer.save(&checkpoint, &clock.note());
    let outcome = match &saved {
        Ok(()) => outcome.map_err(go_on_elsewhere),
        Err(_) => outcome,
    };
    let validation = both(outcome, saved.map_err(Into::into))?;
    println!(
        "{}: {:.2} dB PSNR within the masks of {} pictures that were {}, {} Gaussians, {} steps, {:.1} minutes, drawn on {drawn_on}",
        options.out.display(),
        trainer.best().unwrap_or(validation.psnr),
        validation.pictures,
        if validation.held_back {
            "held back"
        } else {
            "learnt from"
        },
        trainer.gaussians(),
        trainer.steps(),
        clock.used() / 60.0
    );
    Ok(())
}

/// What draws where nothing else does, in words.
const CPU: &str = "the CPU";

/// Draws on the Vulkan device that `--gpu` names, if it can be used, else on the CPU; says why. Returns which.
fn draw_on_gpu(trainer: &mut Trainer<'_>, device: &DeviceOptions) -> String {
    let opened = device.gpu().and_then(|gpu| {
        let splatter = VulkanSplatter::new(&gpu)?;
        if gpu.info().is_cpu {
            eprintln!(
                "{} is software, and slower than --device cpu",
                describe(&gpu)
            );
        }
        Ok((splatter, describe(&gpu)))
    });
    match opened {
        Ok((splatter, name)) => {
            trainer.draw_with(Box::new(splatter));
            name
        }
        Err(why) => {
            eprintln!("{why:#}; {CPU} draws instead");
            CPU.to_owned()
        }
    }
}

/// Says how to go on where a device ended a training whose state is kept: it may have too little memory, which the CPU has.
fn go_on_elsewhere(error: anyhow::Error) -> anyhow::Error {
    let of_device = |cause: &(dyn Error + 'static)| {
        matches!(cause.downcast_ref(), Some(GradientError::Device(_)))
    };
    if error.chain().any(of_device) {
        return error.context(
            "the Vulkan device ended the training; all that was learnt is kept, and --resume --device cpu goes on with it",
        );
    }
    error
}

/// What came of the training, if its state could be kept as well. Where both failed, the first failure is what to mend.
fn both<T>(outcome: anyhow::Result<T>, saved: anyhow::Result<()>) -> anyhow::Result<T> {
    match (outcome, saved) {
        (outcome, Ok(())) => outcome,
        (Ok(_), Err(unsaved)) => Err(unsaved),
        (Err(error), Err(unsaved)) => Err(error.context(format!(
            "the training ended, and its state could not be kept either ({unsaved:#})"
        ))),
    }
}

/// Where a training leaves what.
struct Files<'a> {
    checkpoint: &'a Path,
    package: &'a Path,
    work: &'a Path,
}

/// Trains until the clock or the user ends it; returns the last look at the pictures.
fn train(
    trainer: &mut Trainer<'_>,
    clock: &mut Clock,
    files: &Files<'_>,
) -> anyhow::Result<Validation> {
    let network = Network::start()?;
    let stop = network.stop_on_signal();
    let mut line = ProgressLine::new();
    let mut next = clock.first_look(trainer.steps());
    let mut last = None;
    loop {
        let progress = clock.progress(trainer.steps());
        let ends = progress >= 1.0 || stop.load(Relaxed);
        if ends || progress >= next {
            let validation = trainer.validate()?;
            let decides =
                progress >= next || clock.decides_between_marks() || !files.package.exists();
            if decides {
                trainer.keep_best(&validation, files.package)?;
            }
            let hundredths = (progress.clamp(0.0, 1.0) * 100.0).round();
            show(
                &validation,
                &files.work.join(format!("preview-{hundredths:03}.png")),
            )?;
            line.validated(validation.psnr, trainer.best());
            next = clock.next_mark(trainer.steps());
            last = Some(validation);
            if !ends {
                trainer.save(files.checkpoint, &clock.note())?;
            }
        }
        if ends {
            break;
        }
        let report = trainer.step(clock.progress(trainer.steps()))?;
        line.stepped(&report, clock, trainer.steps());
    }
    line.finish();
    keys::sign(files.package)?;
    if stop.load(Relaxed) {
        eprintln!(
            "Ended: the package and all that was learnt are written. To go on: --resume, with the same CAPTURE, -o and --work, and without --gaussians, --template, \
             --colour-correction and --without, which the training keeps"
        );
    }
    last.context("no picture was looked at")
}

fn show(validation: &Validation, path: &Path) -> anyhow::Result<()> {
    let [width, height] = validation.preview.size;
    let Some(picture) = RgbImage::from_raw(width, height, validation.preview.rgb.clone()) else {
        bail!("a preview of {width} x {height} pixels has another number of bytes");
    };
    write_png(path, &picture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::anyhow;
    use avatar_trainer::TrainError;
    use clap::Parser;

    /// The options of `reconstruct`, as a command line has them.
    #[derive(Debug, Parser)]
    struct CommandLine {
        #[command(flatten)]
        options: Options,
        #[command(flatten)]
        device: DeviceOptions,
    }

    #[test]
    fn a_vulkan_device_that_would_draw_nothing_is_refused() {
        let checked = |more: &[&str]| {
            let line = ["reconstruct", "capture", "-o", "me.m3a"]
                .iter()
                .chain(more);
            let line = CommandLine::parse_from(line);
            check(&line.options, &line.device)
        };
        let said = checked(&["--gpu", "lavapipe"]).expect_err("the CPU draws");
        assert!(said.to_string().contains("add --device gpu"), "{said}");
        assert!(checked(&[]).is_ok(), "the CPU draws");
        let named = checked(&["--gpu", "lavapipe", "--device", "gpu"]);
        assert!(named.is_ok(), "it draws");
    }

    #[test]
    fn a_training_that_its_device_ended_says_how_to_go_on_and_others_do_not() {
        let ended = |error: GradientError| {
            let error = anyhow!(TrainError::from(error));
            format!("{:#}", go_on_elsewhere(error))
        };
        let said = ended(GradientError::Device("out of memory".into()));
        assert!(
            said.contains("--resume --device cpu") && said.contains("out of memory"),
            "{said}"
        );
        let said = ended(GradientError::View("a camera"));
        assert!(!said.contains("--resume"), "{said}");
    }

    #[test]
    fn what_ended_a_training_is_said_although_its_state_could_not_be_kept() {
        let ended = both::<()>(Err(anyhow!("a picture")), Err(anyhow!("a full disk")));
        let said = format!("{:#}", ended.expect_err("both failed"));
        assert!(
            said.contains("a picture") && said.contains("a full disk"),
            "{said}"
        );
        assert!(
            both(Ok(()), Err(anyhow!("a full disk"))).is_err(),
            "not kept"
        );
        assert_eq!(both(Ok(3), Ok(())).ok(), Some(3), "all is well");
    }
}
