//! The standard table: a made-up person of 30k to 1M Gaussians at the sizes of a desktop window and of a headset's eyes.
//!
//! Machines drift while they are measured: everything is visited in rounds, and medians are taken over all of them.

use super::figure::{camera, standing_figure};
use super::growth;
use super::measure::{Medians, Samples, median, print_table, short_count};
use super::render_options::Options;
use super::row::{Format, Row, title};
use super::traffic;
use anyhow::Context;
use mon3tr::device_options::describe;
use mon3tr::progress;
use mon3tr::report::{check_writable, write_json};
use mon3tr::size::Size;
use mon3tr::viewpoint::EYE_SPACING;
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

const COUNTS: [usize; 5] = [30_000, 60_000, 150_000, 400_000, 1_000_000];

/// Of [`COUNTS`]: the figure that both back ends draw.
const COMPARED: usize = 2;

/// A headset's eye.
const EYE: Size = size(1680, 1760);

const fn size(width: u32, height: u32) -> Size {
    Size { width, height }
}

/// All that was measured.
#[derive(Debug, Serialize)]
struct Measured {
    device: String,
    frames: u32,
    /// Bytes read and written each second by a copy on the device.
    copy_bytes_per_second: Option<f64>,
    /// By tiles and by quads, alternating.
    back_ends: Vec<Row>,
    rows: Vec<Row>,
}

/// Runs the standard table.
pub(crate) fn run(options: &Options, gpu: &Arc<Gpu>) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let formats = match options.size {
        Some(size) => vec![(size, 1), (size, 2)],
        None => vec![
            (size(512, 512), 1),
            (size(1024, 1024), 1),
            (EYE, 1),
            (EYE, 2),
        ],
    };
    let figures = COUNTS.map(standing_figure);
    let compared = *formats
        .get(1)
        .filter(|(_, views)| *views == 1)
        .unwrap_or(&formats[0]);
    let copy = copy_speed(gpu)?;
    let back_ends = compare(gpu, &figures[COMPARED], compared, options.frames)?;
    let fastest = back_ends
        .iter()
        .min_by(|a, b| a.medians.total_ms.total_cmp(&b.medians.total_ms));
    let back_end = options.back_end.map_or_else(
        || match fastest {
            Some(row) if row.back_end == name(BackEnd::Quads) => BackEnd::Quads,
            _ => BackEnd::Tiles,
        },
        Into::into,
    );
    let rows = rounds(gpu, &figures, &formats, back_end, options.frames)?;
    let measured = Measured {
        device: describe(gpu),
        frames: options.frames,
        copy_bytes_per_second: copy,
        back_ends,
        rows,
    };
    measured.print(&formats);
    write_json(options.json.as_deref(), &measured)
}

/// The median of some measurements of the device's copy speed.
fn copy_speed(gpu: &Arc<Gpu>) -> anyhow::Result<Option<f64>> {
    let speeds = (0..5)
        .map(|_| gpu.copy_bandwidth())
        .collect::<Result<Option<Vec<f64>>, _>>()
        .context("cannot measure how fast the device copies")?;
    Ok(speeds.map(|speeds| median(&speeds)))
}

/// Both back ends, frame by frame in turns.
fn compare(
    gpu: &Arc<Gpu>,
    figure: &[PackedGaussian],
    format: Format,
    frames: u32,
) -> anyhow::Result<Vec<Row>> {
    let able = |back_end: &BackEnd| back_end.runs_on(gpu);
    let mut benches = [BackEnd::Tiles, BackEnd::Quads]
        .into_iter()
        .filter(able)
        .map(|back_end| Bench::new(gpu, figure, format, back_end))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let mut samples = vec![Samples::default(); benches.len()];
    for _ in 0..frames {
        for (bench, samples) in benches.iter_mut().zip(&mut samples) {
            bench.frame(figure, Some(samples))?;
        }
    }
    let rows = benches.iter().zip(samples);
    Ok(rows
        .map(|(bench, samples)| bench.row(figure.len(), samples))
        .collect())
}

/// Every figure in every format, in rounds.
fn rounds(
    gpu: &Arc<Gpu>,
    figures: &[Vec<PackedGaussian>],
    formats: &[Format],
    back_end: BackEnd,
    frames: u32,
) -> anyhow::Result<Vec<Row>> {
    const ROUNDS: u32 = 3;
    let rounds = ROUNDS.min(frames);
    let bar = progress::bar("measuring", rounds as usize * figures.len() * formats.len());
    // One figure in all formats, then the next: what is compared most closely lies closest together.
    let cases: Vec<_> = figures
        .iter()
        .flat_map(|figure| formats.iter().map(move |format| (*format, figure)))
        .collect();
    let mut rows: Vec<Option<Row>> = cases.iter().map(|_| None).collect();
    for round in 0..rounds {
        for ((format, figure), row) in cases.iter().zip(&mut rows) {
            // A renderer of its own each time: all of them together would fill a small device.
            let mut bench = Bench::new(gpu, figure, *format, back_end)?;
            let mut samples = row.take().map_or_else(Samples::default, |row| row.samples);
            for _ in frames * round / rounds..frames * (round + 1) / rounds {
                bench.frame(figure, Some(&mut samples))?;
            }
            *row = Some(bench.row(figure.len(), samples));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let mut rows: Vec<Row> = rows.into_iter().flatten().collect();
    rows.sort_by_key(|row| formats.iter().position(|format| row.is_of(*format)));
    Ok(rows)
}

/// A renderer that draws one figure in one format.
struct Bench {
    renderer: SplatRenderer,
    cameras: Vec<Camera>,
    back_end: BackEnd,
}

impl Bench {
    fn new(
        gpu: &Arc<Gpu>,
        figure: &[PackedGaussian],
        (Size { width, height }, views): Format,
        back_end: BackEnd,
    ) -> anyhow::Result<Self> {
        let most = u32::try_from(figure.len()).context("too many Gaussians")?;
        let options = RendererOptions {
            back_end: Some(back_end),
            ..RendererOptions::new(most, width, height, views)
        };
        let renderer =
            SplatRenderer::new(Arc::clone(gpu), &options).context("cannot prepare the renderer")?;
        let cameras = if views == 2 {
            let half = EYE_SPACING / 2.0;
            vec![camera(-half, width, height), camera(half, width, height)]
        } else {
            vec![camera(0.0, width, height)]
        };
        let mut bench = Self {
            renderer,
            cameras,
            back_end,
        };
        // Not counted: finds the size of the tiles' lists.
        bench.frame(figure, None)?;
        Ok(bench)
    }

    /// A frame of a person who moved: everything is uploaded and sorted anew.
    fn frame(
        &mut self,
        figure: &[PackedGaussian],
        samples: Option<&mut Samples>,
    ) -> anyhow::Result<()> {
        self.renderer.forget_order();
        let start = Instant::now();
        self.renderer.set_foreground(figure)?;
        self.renderer.draw(&self.cameras)?;
        let total = start.elapsed();
        if let Some(samples) = samples {
            samples.push(total, &self.renderer.stage_times());
        }
        Ok(())
    }

    fn row(&self, gaussians: usize, samples: Samples) -> Row {
        let &RendererOptions {
            width,
            height,
            views,
            ..
        } = self.renderer.options();
        let tile_pairs = self.renderer.tile_pairs();
        let frame = traffic::Frame {
            gaussians: gaussians as u64,
            pixels: u64::from(width) * u64::from(height),
            views: u64::from(views),
            pairs: u64::from(tile_pairs),
        };
        Row {
            gaussians,
            width,
            height,
            views,
            back_end: name(self.back_end),
            tile_pairs,
            moved_bytes: (self.back_end == BackEnd::Tiles).then(|| traffic::bytes(frame)),
            medians: samples.medians(),
            samples,
        }
    }
}

fn name(back_end: BackEnd) -> &'static str {
    match back_end {
        BackEnd::Tiles => "tiles",
        BackEnd::Quads => "quads",
    }
}

impl Measured {
    fn print(&self, formats: &[Format]) {
        println!("{}, medians of {} frames, ms", self.device, self.frames);
        for &(size, views) in formats {
            let rows: Vec<&Row> = self
                .rows
                .iter()
                .filter(|row| row.is_of((size, views)))
                .collect();
            let back_end = rows.first().map_or("", |row| row.back_end);
            println!(
                "\n{}, by {back_end}\n",
                title(size.width, size.height, views)
            );
            self.print_rows("Gaussians", &rows, |row| short_count(row.gaussians));
        }
        growth::print(&self.rows);
        let compared = self.back_ends.first();
        println!(
            "\nBoth back ends, {} Gaussians, {}\n",
            compared.map_or_else(String::new, |row| short_count(row.gaussians)),
            compared.map_or_else(String::new, |row| title(row.width, row.height, row.views)),
        );
        let rows: Vec<&Row> = self.back_ends.iter().collect();
        self.print_rows("back end", &rows, |row| row.back_end.to_owned());
        if let Some(speed) = self.copy_bytes_per_second {
            println!(
                "\nThe device copies at {:.1} GB/s, read and written.",
                speed / 1e9
            );
        }
    }

    fn print_rows(&self, first: &str, rows: &[&Row], label: impl Fn(&Row) -> String) {
        let mut headings = vec![first];
        headings.extend(Medians::HEADINGS);
        headings.extend(["MB moved", "copied in ms"]);
        let cells = |row: &&Row| {
            let mut cells = vec![label(row)];
            cells.extend(row.medians.row());
            let bytes = row.moved_bytes.map(|bytes| bytes as f64);
            let copied = bytes.zip(self.copy_bytes_per_second);
            let or_none =
                |figure: Option<f64>| figure.map_or("-".to_owned(), |f| format!("{f:.1}"));
            cells.push(or_none(bytes.map(|bytes| bytes / 1e6)));
            cells.push(or_none(copied.map(|(bytes, speed)| bytes / speed * 1e3)));
            cells
        };
        print_table(&headings, &rows.iter().map(cells).collect::<Vec<_>>());
    }
}
