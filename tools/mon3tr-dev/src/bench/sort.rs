//! `mon3tr-dev bench sort`: the depth sort by itself against the standard library's stable sort on one core of the CPU.

use super::figure;
use super::measure::{median, print_table, short_count};
use anyhow::{Context, bail};
use glam::Vec3;
use mon3tr::device_options::describe;
use mon3tr::report::{check_writable, write_json};
use renderer_splat::sort::Sorter;
use renderer_vulkan::gpu::Gpu;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Numbers of keys.
const COUNTS: [usize; 7] = [
    20_000, 60_000, 150_000, 400_000, 1_000_000, 2_000_000, 4_000_000,
];

/// Options of `bench sort`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Sorts to take the median of
    #[arg(long, value_name = "K", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Write every sample as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// How the depths lie.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "lowercase")]
enum Depths {
    /// Evenly from 0.3 to 30 m, in any order.
    Spread,
    /// A person's, 2.6 m away.
    Clustered,
    /// All 2.6 m.
    Equal,
}

#[derive(Debug, Serialize)]
struct Row {
    keys: usize,
    depths: Depths,
    /// The device's clock, all passes.
    sort_ms: Vec<f64>,
    median_ms: f64,
    /// `sort_by_key` of the standard library, stable, on one core.
    std_ms: f64,
}

#[derive(Debug, Serialize)]
struct Measured {
    device: String,
    rows: Vec<Row>,
}

/// Runs `bench sort`.
pub(crate) fn run(options: &Options, gpu: &Arc<Gpu>) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    if !gpu.has_clock() {
        bail!(
            "{} has no clock, so the sort cannot be timed: choose another with --gpu",
            gpu.info().name
        );
    }
    let mut measured = Measured {
        device: describe(gpu),
        rows: Vec::new(),
    };
    for keys in COUNTS {
        let capacity = u32::try_from(keys).context("too many keys")?;
        let mut sorter = Sorter::new(gpu, capacity).context("cannot prepare the sort")?;
        for depths in [Depths::Spread, Depths::Clustered, Depths::Equal] {
            measured
                .rows
                .push(measure(&mut sorter, keys, depths, options.frames)?);
        }
    }
    measured.print(options.frames);
    write_json(options.json.as_deref(), &measured)
}

fn measure(sorter: &mut Sorter, keys: usize, depths: Depths, frames: u32) -> anyhow::Result<Row> {
    let metres = depths.metres(keys);
    let (expected, std_ms) = sorted_by_std(&metres);
    // Not counted: warms up, and shows that what is timed is a sort.
    if sorter.sort_depths(&metres)? != expected {
        bail!("the device sorted {keys} depths wrongly: update its driver or try --gpu lavapipe");
    }
    let mut sort_ms = Vec::new();
    for _ in 0..frames {
        sorter.sort_depths(&metres)?;
        sort_ms.push(sorter.milliseconds());
    }
    Ok(Row {
        keys,
        depths,
        median_ms: median(&sort_ms),
        sort_ms,
        std_ms,
    })
}

/// The order by the standard library's stable sort, and the median of a few runs of it in milliseconds.
fn sorted_by_std(metres: &[f32]) -> (Vec<u32>, f64) {
    // Positive floats lie in the order of their bits.
    let keyed: Vec<(u32, u32)> = metres
        .iter()
        .map(|depth| depth.to_bits())
        .zip(0..)
        .collect();
    let mut sorted = Vec::new();
    let times = [(); 3].map(|()| {
        sorted.clone_from(&keyed);
        let start = Instant::now();
        sorted.sort_by_key(|(depth, _)| *depth);
        start.elapsed().as_secs_f64() * 1e3
    });
    let order = sorted.into_iter().map(|(_, item)| item).collect();
    (order, median(&times))
}

impl Depths {
    fn metres(self, count: usize) -> Vec<f32> {
        let mut random = fastrand::Rng::with_seed(0x3D65);
        match self {
            Self::Spread => (0..count).map(|_| 0.3 + 29.7 * random.f32()).collect(),
            Self::Equal => vec![2.6; count],
            Self::Clustered => {
                let camera = figure::camera(0.0, 1, 1);
                let (eye, forward) = (camera.position(), camera.forward());
                figure::standing_figure(count)
                    .iter()
                    .map(|gaussian| forward.dot(Vec3::from_array(gaussian.position()) - eye))
                    .collect()
            }
        }
    }
}

impl Measured {
    fn print(&self, frames: u32) {
        println!(
            "{}, median of {frames} sorts, all passes; std: `sort_by_key` on one core\n",
            self.device
        );
        let rows: Vec<Vec<String>> = self
            .rows
            .chunk_by(|a, b| a.keys == b.keys)
            .map(|of_count| {
                let keys = of_count.first().map_or(0, |row| row.keys);
                let times = of_count
                    .iter()
                    .flat_map(|row| [row.median_ms, row.std_ms])
                    .map(|ms| format!("{ms:.2}"));
                std::iter::once(short_count(keys)).chain(times).collect()
            })
            .collect();
        let headings = [
            "keys",
            "spread ms",
            "std ms",
            "clustered ms",
            "std ms",
            "all equal ms",
            "std ms",
        ];
        print_table(&headings, &rows);
    }
}
