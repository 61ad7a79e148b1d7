//! `mon3tr-dev bench latency-modes`: what `--latency interpolate` and `--latency extrapolate` cost in accuracy on real motion.
//!
//! The truth at any time is the avatar deformed to the motion of that time, sampled from the clip's own, higher rate.
//! The modes see only states at the motion rate. Against the truth of the moment that a picture stands for, their error
//! is the arithmetic's; against the truth of the moment it is shown, it is what a viewer perceives: error and lag together.
//! Network and deform time, which all modes share, are left out. It draws nothing.

use anyhow::{Context, bail};
use app_kernels::state::{GaussianState, plane};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::deform::Deformer;
use app_pipeline::inference::Inference;
use app_pipeline::plan::Plan;
use app_pipeline::profile::Profile;
use glam::{Quat, Vec3};
use mon3tr::device_options::DeviceOptions;
use mon3tr::performance::MotionOptions;
use mon3tr::progress;
use mon3tr::report::{check_writable, write_json};
use mon3tr::stills::load_avatar;
use npu_runtime::Provider;
use serde::Serialize;
use spmm3::networks::GraphParts;
use spmm3::{GaussianSet, MotionClip, Playback};
use std::collections::VecDeque;
use std::path::PathBuf;

/// Options of `bench latency-modes`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Avatar package (.m3a), as `bake` writes it
    #[arg(value_name = "PACKAGE")]
    package: PathBuf,
    #[command(flatten)]
    motion: MotionOptions,
    /// Motion rate, states a second
    #[arg(long, value_name = "HZ", default_value_t = 30, value_parser = clap::value_parser!(u32).range(5..=120))]
    motion_rate: u32,
    /// Display rate, pictures a second
    #[arg(long, value_name = "HZ", default_value_t = 90, value_parser = clap::value_parser!(u32).range(10..=240))]
    display_rate: u32,
    /// Seconds of the motion to measure
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    seconds: f64,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Who deforms does not matter here: what needs no GPU.
const PLAN: Plan = Plan::CpuTail;

/// How a picture's state is made from those at the motion rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Mode {
    /// The newest state as it is: what there is without either mode.
    Newest,
    /// Between the last two states, one motion period late.
    Interpolate,
    /// On from the last two states, at most one motion period.
    Extrapolate,
}

const MODES: [Mode; 3] = [Mode::Newest, Mode::Interpolate, Mode::Extrapolate];

impl Mode {
    fn name(self) -> &'static str {
        match self {
            Self::Newest => "newest state",
            Self::Interpolate => "interpolate",
            Self::Extrapolate => "extrapolate",
        }
    }

    /// For a picture shown `phase` (0..1) of a motion period after the newest state: how far its state lies from the one
    /// before the newest (0) to the newest (1) and beyond.
    fn share(self, phase: f64) -> f64 {
        match self {
            Self::Newest => 1.0,
            Self::Interpolate => phase,
            Self::Extrapolate => 1.0 + phase.min(1.0),
        }
    }
}

/// Distances between two sets of Gaussians.
#[derive(Debug, Clone, Copy, Serialize)]
struct Errors {
    mean_mm: f64,
    p95_mm: f64,
    max_mm: f64,
    mean_degrees: f64,
    p95_degrees: f64,
    max_degrees: f64,
}

#[derive(Debug, Serialize)]
struct Row {
    mode: Mode,
    /// Display time minus the time that the picture stands for, mean over the pictures.
    added_delay_ms: f64,
    /// Against the truth at the time that the picture stands for.
    at_content_time: Errors,
    /// Against the truth at the time that it is shown.
    at_display_time: Errors,
}

#[derive(Debug, Serialize)]
struct Measured {
    avatar: String,
    gaussians: usize,
    motion: String,
    clip_hz: f64,
    motion_hz: u32,
    display_hz: u32,
    pictures: usize,
    /// How fast the Gaussians move in truth, mean over all of them and the whole time.
    mean_speed_mm_per_s: f64,
    modes: Vec<Row>,
}

/// Runs `bench latency-modes`.
pub(super) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    if !(options.seconds > 0.0 && options.seconds <= 600.0) {
        bail!("--seconds {} is not within 0..600", options.seconds);
    }
    let (avatar, _) = load_avatar(&options.package)?;
    let display_rate = f64::from(options.display_rate);
    // The built-in motion is a formula: as fine as the display.
    let clip = options.motion.clip(&avatar, display_rate)?;
    let runtime = device.runtime()?;
    let provider = Provider::Cpu {
        threads: DeviceOptions::threads(),
    };
    let inference = Inference::open(
        &runtime,
        &avatar,
        GraphParts::Skinned,
        &[provider],
        &CompiledSources::default(),
    )?;
    let deformer = Deformer::new(&avatar, inference, PLAN)?;
    let mut measured = Measured {
        avatar: avatar.name.clone(),
        gaussians: avatar.gaussians.len(),
        motion: clip.name.clone(),
        clip_hz: 1.0 / clip.frame_seconds,
        motion_hz: options.motion_rate,
        display_hz: options.display_rate,
        pictures: 0,
        mean_speed_mm_per_s: 0.0,
        modes: Vec::new(),
    };
    measure(options, deformer, clip, &mut measured)?;
    measured.print();
    write_json(options.json.as_deref(), &measured)
}

fn measure(
    options: &Options,
    deformer: Deformer,
    clip: MotionClip,
    measured: &mut Measured,
) -> anyhow::Result<()> {
    let (motion_rate, display_rate) = (
        f64::from(options.motion_rate),
        f64::from(options.display_rate),
    );
    let last = (clip.frames.len().saturating_sub(1)) as f64 * clip.frame_seconds;
    // Both modes need two states before the first picture, and interpolation's truth lies a period back.
    let start = 2.0 / motion_rate;
    let seconds = options.seconds.min(last - start);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most 600 s at 240 Hz; negative becomes 0"
    )]
    let pictures = (seconds * display_rate).floor() as usize;
    if pictures < 10 {
        bail!("the motion {} is too short to measure", clip.name);
    }
    let mut truths = Truths {
        profile: Profile::default(),
        known: VecDeque::new(),
        deformer,
        clip,
    };
    let mut tallies = MODES.map(|_| [Tally::new(), Tally::new()]);
    let mut delays = [0.0; MODES.len()];
    let mut speed = Tally::new();
    let (mut before, mut after) = (GaussianSet::zeroed(0), GaussianSet::zeroed(0));
    let bar = progress::bar("measuring", pictures);
    for n in 0..pictures {
        let shown = start + n as f64 / display_rate;
        // A hair more, so that a picture at a state's own time has that state.
        let newest = (shown * motion_rate + 1e-6).floor();
        let phase = (shown * motion_rate - newest).max(0.0);
        before.clone_from(truths.at((newest - 1.0) / motion_rate)?);
        after.clone_from(truths.at(newest / motion_rate)?);
        for ((mode, tallies), delay) in MODES.iter().zip(&mut tallies).zip(&mut delays) {
            let share = mode.share(phase);
            let content = (newest - 1.0 + share) / motion_rate;
            let state = Between {
                before: &before,
                after: &after,
                share,
            };
            for (tally, time) in tallies.iter_mut().zip([content, shown]) {
                tally.add(&state, truths.at(time)?);
            }
            // Rounding must not make a delay negative.
            *delay += (shown - content).max(0.0) * 1e3 / pictures as f64;
        }
        after.clone_from(truths.at(shown)?);
        let now = Between {
            before: &after,
            after: &after,
            share: 1.0,
        };
        speed.add(&now, truths.at(shown + 1.0 / display_rate)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    measured.pictures = pictures;
    measured.mean_speed_mm_per_s = speed.errors().mean_mm * display_rate;
    let rows = MODES.iter().zip(&tallies).zip(delays);
    measured.modes = rows
        .map(|((mode, [content, display]), added_delay_ms)| Row {
            mode: *mode,
            added_delay_ms,
            at_content_time: content.errors(),
            at_display_time: display.errors(),
        })
        .collect();
    Ok(())
}

/// The avatar deformed to the motion at any time, the last ones kept.
struct Truths {
    deformer: Deformer,
    clip: MotionClip,
    profile: Profile,
    known: VecDeque<(f64, GaussianSet)>,
}

impl Truths {
    fn at(&mut self, seconds: f64) -> anyhow::Result<&GaussianSet> {
        /// The pictures of two motion periods, as a rule.
        const KEPT: usize = 16;
        if let Some(at) = self
            .known
            .iter()
            .position(|(t, _)| (t - seconds).abs() < 1e-7)
        {
            return Ok(&self.known[at].1);
        }
        let motion = self.clip.sample(seconds, Playback::Clamp);
        let state: &GaussianState = self
            .deformer
            .deform(&motion, &mut self.profile)
            .context("cannot deform the avatar")?;
        // The oldest gives its memory.
        let spare = (self.known.len() == KEPT)
            .then(|| self.known.pop_front())
            .flatten();
        let mut kept = spare.map_or_else(|| GaussianSet::zeroed(state.len()), |(_, set)| set);
        let [x, y, z] = [0, 1, 2].map(|axis| state.plane(plane::POSITION.start + axis));
        for (i, position) in kept.positions.iter_mut().enumerate() {
            *position = Vec3::new(x[i], y[i], z[i]);
        }
        let [x, y, z, w] = [0, 1, 2, 3].map(|part| state.plane(plane::ROTATION.start + part));
        for (i, rotation) in kept.rotations.iter_mut().enumerate() {
            *rotation = Quat::from_xyzw(x[i], y[i], z[i], w[i]);
        }
        self.known.push_back((seconds, kept));
        Ok(&self.known[self.known.len() - 1].1)
    }
}

/// A state between two others, or beyond the second.
struct Between<'a> {
    before: &'a GaussianSet,
    after: &'a GaussianSet,
    /// 0: `before`, 1: `after`.
    share: f64,
}

impl Between<'_> {
    /// Centre, metres, and rotation of one Gaussian.
    fn gaussian(&self, i: usize) -> (Vec3, Quat) {
        #[allow(clippy::cast_possible_truncation, reason = "0..=2")]
        let share = self.share as f32;
        let position =
            self.before.positions[i] + (self.after.positions[i] - self.before.positions[i]) * share;
        let (from, mut to) = (self.before.rotations[i], self.after.rotations[i]);
        if from.dot(to) < 0.0 {
            to = -to;
        }
        // The turn from one to the other, taken as far as the share says: Slerp that may go on beyond its end.
        let turn = (to * from.conjugate()).normalize().to_scaled_axis();
        (position, Quat::from_scaled_axis(turn * share) * from)
    }
}

/// Distances counted in fine bins, so that a percentile of millions takes little memory.
struct Tally {
    millimetres: Bins,
    degrees: Bins,
}

struct Bins {
    counts: Vec<u64>,
    sum: f64,
    max: f64,
}

impl Bins {
    /// Bins a unit; the last bin has all beyond 1,000 units.
    const FINENESS: f64 = 100.0;

    fn new() -> Self {
        Self {
            counts: vec![0; 100_000],
            sum: 0.0,
            max: 0.0,
        }
    }

    fn add(&mut self, value: f64) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped by the index below"
        )]
        let bin = (value * Self::FINENESS) as usize;
        let last = self.counts.len() - 1;
        self.counts[bin.min(last)] += 1;
        self.sum += value;
        self.max = self.max.max(value);
    }

    fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Upper edge of the bin of the nearest-rank percentile.
    fn percentile(&self, percent: u64) -> f64 {
        let rank = (self.total() * percent).div_ceil(100);
        let mut below = 0;
        let bin = self.counts.iter().position(|count| {
            below += count;
            below >= rank
        });
        ((bin.unwrap_or(0) + 1) as f64 / Self::FINENESS).min(self.max)
    }
}

impl Tally {
    fn new() -> Self {
        Self {
            millimetres: Bins::new(),
            degrees: Bins::new(),
        }
    }

    fn add(&mut self, state: &Between<'_>, truth: &GaussianSet) {
        for i in 0..truth.len() {
            let (position, rotation) = state.gaussian(i);
            let distance = position.distance(truth.positions[i]);
            self.millimetres.add(f64::from(distance) * 1e3);
            // Half the chord between unit quaternions is the sine of a quarter of the angle: exact where it is small.
            let other = truth.rotations[i];
            let chord = (rotation - other).length().min((rotation + other).length());
            let angle = 4.0 * (f64::from(chord) / 2.0).min(1.0).asin();
            self.degrees.add(angle.to_degrees());
        }
    }

    fn errors(&self) -> Errors {
        let count = self.millimetres.total().max(1) as f64;
        Errors {
            mean_mm: self.millimetres.sum / count,
            p95_mm: self.millimetres.percentile(95),
            max_mm: self.millimetres.max,
            mean_degrees: self.degrees.sum / count,
            p95_degrees: self.degrees.percentile(95),
            max_degrees: self.degrees.max,
        }
    }
}

impl Measured {
    fn print(&self) {
        println!(
            "{}: {} Gaussians; {} at {:.0} Hz, states at {} Hz, {} pictures at {} Hz; mean speed {:.0} mm/s\n",
            self.avatar,
            self.gaussians,
            self.motion,
            self.clip_hz,
            self.motion_hz,
            self.pictures,
            self.display_hz,
            self.mean_speed_mm_per_s
        );
        println!(
            "{:<14} {:>9}   {:<33}   {:<33}",
            "", "added", "error at the content's time", "error at the display's time"
        );
        let head = "  mean     p95     max mm   mean p95";
        println!("{:<14} {:>9} {head} deg {head} deg", "mode", "delay ms");
        for row in &self.modes {
            let errors = |e: &Errors| {
                format!(
                    "{:>6.2} {:>7.2} {:>7.1}    {:>6.2} {:>6.2}",
                    e.mean_mm, e.p95_mm, e.max_mm, e.mean_degrees, e.p95_degrees
                )
            };
            println!(
                "{:<14} {:>9.1} {}  {}",
                row.mode.name(),
                row.added_delay_ms,
                errors(&row.at_content_time),
                errors(&row.at_display_time)
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turning(angle: f32) -> GaussianSet {
        let mut set = GaussianSet::zeroed(1);
        set.positions[0] = Vec3::X * angle;
        // Either sign of a quaternion is the same rotation.
        set.rotations[0] = -Quat::from_rotation_y(angle);
        set
    }

    #[test]
    fn what_moves_evenly_is_met_exactly_before_between_and_beyond_two_states() {
        let (before, mut after) = (turning(0.3), turning(0.5));
        after.rotations[0] = -after.rotations[0];
        for part in [0.0f32, 0.4, 1.0, 1.7, 2.0] {
            let share = f64::from(part);
            let state = Between {
                before: &before,
                after: &after,
                share,
            };
            let mut tally = Tally::new();
            tally.add(&state, &turning(0.3 + 0.2 * part));
            let errors = tally.errors();
            assert!(errors.max_mm < 1e-3, "{share}: {errors:?}");
            assert!(errors.max_degrees < 1e-3, "{share}: {errors:?}");
        }
    }

    #[test]
    fn distances_and_angles_are_told_in_millimetres_and_degrees() {
        let truth = turning(0.0);
        let mut state = truth.clone();
        state.positions[0] += Vec3::new(0.003, 0.0, 0.004);
        state.rotations[0] = Quat::from_rotation_z(30f32.to_radians());
        let between = Between {
            before: &state,
            after: &state,
            share: 1.0,
        };
        let mut tally = Tally::new();
        tally.add(&between, &truth);
        let errors = tally.errors();
        assert!((errors.mean_mm - 5.0).abs() < 1e-3, "{errors:?}");
        assert!((errors.mean_degrees - 30.0).abs() < 1e-3, "{errors:?}");
        assert!((errors.p95_mm - 5.0).abs() < 0.02, "{errors:?}");
    }

    #[test]
    fn percentiles_of_bins_are_nearest_rank() {
        let mut bins = Bins::new();
        (1..=200).rev().for_each(|k| bins.add(f64::from(k) + 0.005));
        assert!(
            (bins.percentile(95) - 190.01).abs() < 0.011,
            "{}",
            bins.percentile(95)
        );
        assert!(
            (bins.percentile(100) - 200.005).abs() < 1e-9,
            "the greatest"
        );
    }

    #[test]
    fn each_mode_takes_its_share_of_the_motion_period() {
        let shares = |phase: f64| MODES.map(|mode| mode.share(phase));
        assert_eq!(shares(0.0), [1.0, 0.0, 1.0], "at a state's own time");
        assert_eq!(shares(0.25), [1.0, 0.25, 1.25], "a quarter later");
    }
}
