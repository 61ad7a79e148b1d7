//! `mon3tr-dev eval rig`: avatars of synthetic scans against the truth, and of real scans against themselves.

mod novel;
mod pictures;

use anyhow::Context;
use glam::DVec3;
use mon3tr::device_options::{DeviceOptions, make_folder, makehuman, networks};
use mon3tr::film::write_png;
use mon3tr::report::{check_writable, write_json};
use pictures::beside;
use reconstruct::BareBody;
use scan_rig::RigError;
use scan_rig::figures::coverage::Coverage;
use scan_rig::figures::likeness::six_views;
use scan_rig::finish::{FinishOptions, Poser};
use scan_rig::pinhole::Pinhole;
use scan_rig::pipeline::{self, Fitted, RigOptions, RigReport, Rigged};
use scan_rig::prepare::{self, Networks, Similarity};
use scan_rig::scan::Scan;
use scan_rig::shell::Hands;
use scan_rig::sight::Sight;
use scan_rig::synthetic::{PEOPLE, ScanOptions, Surroundings, SyntheticPerson, SyntheticScan};
use serde::Serialize;
use splat_scene::Scene;
use spmm3::{Joint, LoadOptions, MotionClip, MotionParams, Playback};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Options of `eval rig`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// How many synthetic people; there are eight
    #[arg(long, value_name = "COUNT", default_value_t = PEOPLE)]
    bodies: usize,
    /// About how many Gaussians each has
    #[arg(long, value_name = "COUNT", default_value_t = 60_000)]
    gaussians: usize,
    /// With a floor, furniture and floaters around each
    #[arg(long)]
    surroundings: bool,
    /// A real scan; may be given several times. With it, synthetic people are measured only where --bodies says so
    #[arg(long, value_name = "FILE")]
    scan: Vec<PathBuf>,
    /// The height of the people in real scans, metres
    #[arg(long, value_name = "METRES", requires = "scan")]
    height: Option<f64>,
    /// Motions that avatars of real scans are tried in, in eight moments each; may be given several times
    #[arg(long, value_name = "FILE", requires = "scan")]
    motion: Vec<PathBuf>,
    /// Write the synthetic scans into this folder, as .ply, and the truth about them as .json; then nothing is measured
    #[arg(long, value_name = "FOLDER", conflicts_with = "scan")]
    write_scans: Option<PathBuf>,
    /// Leave pictures in this folder, each of the truth, the avatar and four times the difference: synthetic people in novel poses, real
    /// scans in their own
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// How well one synthetic scan was rigged.
#[derive(Debug, Serialize)]
struct Row {
    body: usize,
    joints_mean_mm: f64,
    joints_max_mm: f64,
    /// Each joint of the body, in SMPL-X's order.
    joints_mm: Vec<f64>,
    worst_joint: &'static str,
    fingers_mean_mm: f64,
    yaw_degrees: f64,
    /// How much too large the avatar is, percent.
    scale_percent: f64,
    /// How sure the joint was that is wrong most, 0..=1.
    worst_confidence: f64,
    /// How far up is from the true up, degrees.
    tilt_degrees: f64,
    /// Novel poses against the true person, each the mean of six views, dB.
    novel_db: Vec<f64>,
    /// The same of an avatar that was given the true body, in its true pose: what binding and skinning leave.
    novel_db_of_true_body: Vec<f64>,
    /// Seconds of the avatar, without those of measuring it.
    seconds: f64,
    report: RigReport,
}

/// How one real scan was rigged.
#[derive(Debug, Serialize)]
struct RealRow {
    scan: PathBuf,
    seconds: f64,
    report: RigReport,
    motions: Vec<MotionRow>,
}

/// How an avatar covers its body in a motion.
#[derive(Debug, Serialize)]
struct MotionRow {
    motion: PathBuf,
    coverage: Coverage,
}

/// Moments of a motion in which an avatar is measured, spread over all of it.
const MOMENTS: usize = 8;

/// A body that could not be rigged, and why.
#[derive(Debug, Serialize)]
struct Failure {
    what: String,
    why: String,
}

/// Everything.
#[derive(Debug, Default, Serialize)]
struct Figures {
    synthetic: Vec<Row>,
    real: Vec<RealRow>,
    failures: Vec<Failure>,
}

/// What looks at scans.
struct Tools {
    makehuman: PathBuf,
    sight: Sight,
    networks: Networks,
}

/// Runs `eval rig`.
pub(super) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    if let Some(folder) = &options.write_scans {
        return write_scans(options, folder);
    }
    if let Some(folder) = &options.pictures {
        make_folder(folder)?;
    }
    let mut tools = Tools {
        makehuman: makehuman()?,
        sight: Sight::on(device.gpu()?),
        networks: Networks::open(Some(&networks()?))?,
    };
    let mut figures = Figures::default();
    for file in &options.scan {
        match real(file, options, &mut tools) {
            Ok(row) => {
                row.print();
                figures.real.push(row);
            }
            Err(error) => figures.failed(file.display().to_string(), &error),
        }
    }
    if options.scan.is_empty() {
        let mut body = BareBody::open(&tools.makehuman)?;
        for number in 0..options.bodies {
            let person = SyntheticPerson::new(&mut body, &tools.makehuman, number)?;
            match synthetic(number, &person, options, &mut tools) {
                Ok(row) => {
                    row.print();
                    figures.synthetic.push(row);
                }
                Err(error) => figures.failed(format!("body {number}"), &error),
            }
        }
        summarise(&figures.synthetic);
    }
    write_json(options.json.as_deref(), &figures)
}

impl Figures {
    fn failed(&mut self, what: String, error: &anyhow::Error) {
        println!("{what}: no avatar: {error:#}");
        self.failures.push(Failure {
            what,
            why: format!("{error:#}"),
        });
    }
}

impl Options {
    fn scan_options(&self) -> ScanOptions {
        ScanOptions {
            gaussians: self.gaussians,
            surroundings: if self.surroundings {
                Surroundings::Room
            } else {
                Surroundings::None
            },
            // No trainer knows metres.
            unit: 2.3,
            ..ScanOptions::default()
        }
    }
}

impl Tools {
    fn options(&self, height: Option<f64>, name: &str) -> RigOptions {
        RigOptions {
            makehuman: self.makehuman.clone(),
            person: prepare::Options {
                height,
                ..prepare::Options::default()
            },
            accessories: true,
            hands: [Hands::AsSeen; 2],
            finish: FinishOptions {
                name: name.to_owned(),
                ..FinishOptions::default()
            },
        }
    }

    fn fitted(&mut self, scene: &Scene, options: &RigOptions) -> Result<Fitted, RigError> {
        pipeline::fitted(scene, options, &mut self.sight, &mut self.networks, &told)
    }
}

fn told(step: &'static str) {
    log::info!("{step}");
}

fn measured(fitted: Fitted, options: &RigOptions) -> Result<Rigged, RigError> {
    let mut rigged = pipeline::rigged(fitted, options, &told)?;
    rigged.report.quality = Some(pipeline::measure(&rigged)?);
    Ok(rigged)
}

fn real(file: &Path, options: &Options, tools: &mut Tools) -> anyhow::Result<RealRow> {
    let scene = Scene::load(file).with_context(|| format!("cannot use {}", file.display()))?;
    let choices = tools.options(options.height, "scan");
    let rigged = measured(tools.fitted(&scene, &choices)?, &choices)?;
    if let Some(folder) = &options.pictures {
        let again = Poser::new(&rigged.avatar)?.scan(&rigged.scan_motion)?;
        for (number, view) in six_views(rigged.height).iter().enumerate() {
            let file = folder.join(format!("scan-view{number}.png"));
            write_png(&file, &beside(&rigged.scan, &again, view)?)?;
        }
    }
    let mut motions = Vec::new();
    for file in &options.motion {
        let clip = MotionClip::load(file, &rigged.avatar.skeleton, &LoadOptions::default())
            .with_context(|| format!("cannot use the motion {}", file.display()))?;
        let moments: Vec<MotionParams> = (0..MOMENTS)
            .map(|at| {
                let moment = clip.frame_seconds * clip.frames.len() as f64 * (at as f64 + 0.5)
                    / MOMENTS as f64;
                clip.sample(moment, Playback::Clamp)
            })
            .collect();
        motions.push(MotionRow {
            motion: file.clone(),
            coverage: pipeline::measure_motion(&rigged, &moments)?,
        });
    }
    Ok(RealRow {
        motions,
        scan: file.to_path_buf(),
        seconds: seconds(&rigged.report),
        report: rigged.report,
    })
}

/// What the steps of an avatar took, without the measuring of it.
fn seconds(report: &RigReport) -> f64 {
    report.steps.iter().map(|step| step.seconds).sum()
}

fn synthetic(
    number: usize,
    person: &SyntheticPerson,
    options: &Options,
    tools: &mut Tools,
) -> anyhow::Result<Row> {
    let scan_options = options.scan_options();
    let truth = person.scan(&scan_options);
    let scene = truth.scan.to_scene()?;
    let choices = tools.options(Some(truth.height), &format!("body {number}"));
    let fitted = tools.fitted(&scene, &choices)?;
    let mut perfect = fitted.clone();
    let rigged = measured(fitted, &choices)?;
    let seconds = seconds(&rigged.report);
    let placed = perfect.prepared.person_from_scene;
    let person_from_stance = Similarity {
        scale: placed.scale * f64::from(scan_options.unit),
        ..placed
    };
    (perfect.model, perfect.registered) = person.registered(&perfect.model, &person_from_stance);
    let perfect = pipeline::rigged(perfect, &choices, &told)?;
    let unseen = |_, _: &Scan, _: &Scan, _: &Pinhole| Ok(());
    let errors = joint_errors(&rigged, &truth);
    let body = errors.get(..Joint::Jaw.index()).unwrap_or_default();
    let fingers = errors.get(Joint::LeftIndex1.index()..).unwrap_or_default();
    let worst = (0..body.len())
        .max_by(|a, b| body[*a].total_cmp(&body[*b]))
        .unwrap_or(0);
    Ok(Row {
        body: number,
        joints_mean_mm: mean(body) * 1e3,
        joints_mm: body.iter().map(|error| error * 1e3).collect(),
        joints_max_mm: body.iter().copied().fold(0.0, f64::max) * 1e3,
        worst_joint: Joint::ALL[worst].name(),
        fingers_mean_mm: mean(fingers) * 1e3,
        yaw_degrees: yaw_error(&rigged, &truth).to_degrees(),
        tilt_degrees: (placed.rotation * DVec3::Y)
            .angle_between(DVec3::Y)
            .to_degrees(),
        scale_percent: (rigged.person_from_scene.scale * f64::from(scan_options.unit) - 1.0)
            * 100.0,
        worst_confidence: rigged
            .report
            .joints
            .get(worst)
            .map_or(0.0, |j| j.confidence),
        novel_db: novel::compare(
            person,
            &rigged,
            &scan_options,
            |pose, truth, posed, view| {
                let Some(folder) = &options.pictures else {
                    return Ok(());
                };
                let file = folder.join(format!("body{number}-pose{pose}.png"));
                write_png(&file, &beside(truth, posed, view)?)
            },
        )?,
        novel_db_of_true_body: novel::compare(person, &perfect, &scan_options, unseen)?,
        seconds,
        report: rigged.report,
    })
}

/// How far each joint is from its true place, metres.
fn joint_errors(rigged: &Rigged, truth: &SyntheticScan) -> Vec<f64> {
    (rigged.joints.iter().zip(&truth.joints))
        .map(|(found, joint)| found.distance(rigged.person_from_scene.point(*joint)))
        .collect()
}

/// How far the person, as it was placed, is turned away from +z, radians; by shoulders and hips.
fn yaw_error(rigged: &Rigged, truth: &SyntheticScan) -> f64 {
    let at = |joint: Joint| truth.joints[joint.index()];
    let left = at(Joint::LeftShoulder) - at(Joint::RightShoulder) + at(Joint::LeftHip)
        - at(Joint::RightHip);
    let forward = rigged.person_from_scene.rotation * left.cross(DVec3::Y);
    forward.x.atan2(forward.z)
}

/// Writes the synthetic scans and the truth about them.
fn write_scans(options: &Options, folder: &Path) -> anyhow::Result<()> {
    make_folder(folder)?;
    let makehuman = makehuman()?;
    let mut body = BareBody::open(&makehuman)?;
    for number in 0..options.bodies {
        let person = SyntheticPerson::new(&mut body, &makehuman, number)?;
        let scan = person.scan(&options.scan_options());
        let file = folder.join(format!("body{number}.ply"));
        let scene = scan.scan.to_scene()?;
        File::create(&file)
            .and_then(|out| scene.write_ply(&mut BufWriter::new(out)))
            .with_context(|| format!("cannot write {}", file.display()))?;
        let unit = f64::from(options.scan_options().unit);
        // In the file's axes: y down, z forward.
        let joints: serde_json::Map<String, serde_json::Value> = (Joint::ALL.iter())
            .zip(&scan.joints)
            .map(|(joint, at)| {
                (
                    joint.name().to_owned(),
                    serde_json::json!([at.x, -at.y, -at.z]),
                )
            })
            .collect();
        write_json(
            Some(&file.with_extension("json")),
            &serde_json::json!({
                "height": scan.height,
                "metre": unit,
                "yaw_degrees": scan.yaw.to_degrees(),
                "joints": joints,
            }),
        )?;
        println!(
            "{}: {} Gaussians, {:.2} m tall",
            file.display(),
            scan.scan.len(),
            scan.height
        );
    }
    Ok(())
}

impl Row {
    fn print(&self) {
        let decibels = |values: &[f64]| {
            let values: Vec<String> = values.iter().map(|db| format!("{db:.1}")).collect();
            values.join(" ")
        };
        println!(
            "body {}: joints {:.0} mm mean, {:.0} max ({}, sure to {:.0} %), fingers {:.0}; yaw {:+.1} degrees, tilt {:.1}, size {:+.1} %; \
             novel poses {} dB (with the true body {}); {:.0} s",
            self.body,
            self.joints_mean_mm,
            self.joints_max_mm,
            self.worst_joint,
            self.worst_confidence * 100.0,
            self.fingers_mean_mm,
            self.yaw_degrees,
            self.tilt_degrees,
            self.scale_percent,
            decibels(&self.novel_db),
            decibels(&self.novel_db_of_true_body),
            self.seconds
        );
        print_report(&self.report);
    }
}

impl RealRow {
    fn print(&self) {
        println!("{}: {:.0} s", self.scan.display(), self.seconds);
        print_report(&self.report);
        for MotionRow { motion, coverage } in &self.motions {
            println!(
                "  in {MOMENTS} moments of {}: spill {:.2} %, holes {:.2} %",
                motion.display(),
                coverage.spill * 100.0,
                coverage.holes * 100.0
            );
        }
    }
}

fn print_report(report: &RigReport) {
    let steps: Vec<String> = (report.steps.iter())
        .map(|step| format!("{} {:.1}", step.step, step.seconds))
        .collect();
    println!("  seconds: {}", steps.join(", "));
    println!(
        "  {} of {} Gaussians; fit: surface {:.1} mm, key points of the body {:.1}, displaced {:.1}; longest axis {:.0} mm",
        report.gaussians,
        report.scene_gaussians,
        report.fit.surface * 1e3,
        report.fit.key_points * 1e3,
        report.fit.displaced * 1e3,
        report.bind.longest_axis * 1e3
    );
    if let Some(quality) = &report.quality {
        println!("  {quality}");
    }
    for warning in &report.warnings {
        println!("  note: {warning}");
    }
}

fn summarise(rows: &[Row]) {
    if rows.is_empty() {
        return;
    }
    let of = |figure: fn(&Row) -> f64| mean(&rows.iter().map(figure).collect::<Vec<f64>>());
    let worst = rows.iter().map(|row| row.joints_max_mm).fold(0.0, f64::max);
    let yaw = rows
        .iter()
        .map(|row| row.yaw_degrees.abs())
        .fold(0.0, f64::max);
    println!(
        "\n{} bodies: joints {:.1} mm mean, {worst:.0} max; yaw {yaw:.1} degrees at most; novel poses {:.1} dB mean, {:.1} with the true body; {:.0} s each",
        rows.len(),
        of(|row| row.joints_mean_mm),
        of(|row| mean(&row.novel_db)),
        of(|row| mean(&row.novel_db_of_true_body)),
        of(|row| row.seconds)
    );
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
