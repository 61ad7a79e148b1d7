//! The GPU's stages: what each has to do, by the renderer's own division of the work, and how long the chip is at it.

use crate::chip::Chip;
use crate::estimate::Estimate;
use crate::shader_costs::{ShaderCosts, TableError};
use crate::work::Work;
use renderer_splat::limits::{MOST_LISTING_BYTES, MOST_LISTING_LANES};
use renderer_splat::options::BackEnd;
use serde::Serialize;
use shaders_spirv::SORT_CROWDED;

/// How much longer the busiest of the invocations that list tiles is at it than the mean: splats near the eye cover more tiles.
const UNEVEN: Estimate = Estimate::new(1.2, 2.0, 4.0);

/// What sets a stage's time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Instructions.
    Arithmetic,
    /// Bytes that are read and written in streams.
    Memory,
    /// Words at scattered addresses.
    Scattered,
    /// Waiting for memory, with too few waves to do something else meanwhile.
    Latency,
    /// Blending fragments.
    Blending,
    /// Triangles.
    Triangles,
}

impl Limit {
    /// In a table.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Arithmetic => "arithmetic",
            Self::Memory => "memory",
            Self::Scattered => "scattered accesses",
            Self::Latency => "waiting for memory",
            Self::Blending => "blending",
            Self::Triangles => "triangles",
        }
    }
}

/// A stage's time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StageEstimate {
    /// Its name.
    pub stage: &'static str,
    /// Milliseconds a picture.
    pub ms: Estimate,
    /// The longest of what it does at once.
    pub limit: Limit,
}

/// What a stage does at once, and how many dispatches wait for one another.
pub(crate) struct Load<'a> {
    chip: &'a Chip,
    parts: Vec<(Limit, Estimate)>,
    barriers: f64,
}

impl<'a> Load<'a> {
    pub(crate) fn new(chip: &'a Chip, barriers: f64) -> Self {
        Self {
            chip,
            parts: Vec::new(),
            barriers,
        }
    }

    /// Instructions of all waves of 64.
    pub(crate) fn issues(mut self, instructions: Estimate) -> Self {
        let a_ms = product(self.chip.issues, self.chip.gpu_clock);
        self.add(Limit::Arithmetic, instructions / a_ms);
        self
    }

    pub(crate) fn bytes(mut self, bytes: impl Into<Estimate>) -> Self {
        self.add(Limit::Memory, bytes.into() / self.chip.memory);
        self
    }

    fn scattered(self, words: f64) -> Self {
        let rate = self.chip.scattered;
        self.each_cycle(Limit::Scattered, Estimate::exactly(words), rate)
    }

    /// So many accesses of which each waits for the one before.
    pub(crate) fn chain(mut self, accesses: Estimate) -> Self {
        self.add(Limit::Latency, product(accesses, self.chip.latency));
        self
    }

    fn each_cycle(mut self, limit: Limit, count: Estimate, a_cycle: Estimate) -> Self {
        self.add(limit, count / product(a_cycle, self.chip.gpu_clock));
        self
    }

    fn add(&mut self, limit: Limit, ms: Estimate) {
        match self.parts.iter_mut().find(|(other, _)| *other == limit) {
            Some((_, sum)) => *sum = *sum + ms,
            None => self.parts.push((limit, ms)),
        }
    }

    pub(crate) fn end(self, stage: &'static str) -> StageEstimate {
        let longest = (self.parts.iter()).max_by(|a, b| a.1.likely.total_cmp(&b.1.likely));
        let limit = longest.map_or(Limit::Latency, |(limit, _)| *limit);
        // It all happens at once, or at worst what is likely one after the other.
        let at_once = (self.parts.iter()).fold(Estimate::NONE, |all, (_, ms)| all.or_longer(*ms));
        let one_by_one: f64 = self.parts.iter().map(|(_, ms)| ms.likely).sum();
        let waits = self.chip.barrier * self.barriers;
        StageEstimate {
            stage,
            ms: Estimate::new(at_once.least, at_once.likely, at_once.most.max(one_by_one)) + waits,
            limit,
        }
    }
}

fn product(a: Estimate, b: Estimate) -> Estimate {
    Estimate::new(a.least * b.least, a.likely * b.likely, a.most * b.most)
}

/// Waves of 64 for so many invocations.
pub(crate) fn waves(invocations: f64) -> f64 {
    (invocations / 64.0).ceil()
}

/// Copying the people's Gaussians to where the GPU reads them, where the CPU poses them: 32 bytes each, read and written.
#[must_use]
pub fn uploading(work: &Work, chip: &Chip) -> StageEstimate {
    Load::new(chip, 1.0)
        .bytes(64.0 * work.gaussians as f64)
        .end("upload")
}

/// Posing on the GPU: of `vertices` and Gaussians with blocks of 16 bases each, `poses` of them a picture, and what a picture interpolates.
///
/// # Errors
/// A table of other shaders.
pub fn posing(
    work: &Work,
    vertices: u64,
    bases: u64,
    poses: f64,
    costs: &ShaderCosts,
    chip: &Chip,
) -> Result<Vec<StageEstimate>, TableError> {
    let gaussians = work.gaussians as f64;
    let blocks = bases.div_ceil(16) as f64;
    let run = |key: &str, invocations: f64| -> Result<Estimate, TableError> {
        Ok(costs.issued(key, &[("", 1.0)])? * waves(invocations))
    };
    let vertex = run("pose_vertices compute 64", vertices as f64)?;
    // The table is of one block of bases.
    let gaussian = run("pose_gaussians compute 64", gaussians)? * blocks.max(1.0);
    // Bases a byte each; binding, template, scales; the state that is written.
    let bytes = gaussians * (14.0 * 16.0 * blocks + 40.0 + 56.0 + 28.0 + 32.0);
    let between = run("interpolate compute 64", gaussians)?;
    Ok(vec![
        Load::new(chip, 2.0 * poses)
            .issues((vertex + gaussian) * poses)
            .bytes((bytes + 60.0 * vertices as f64) * poses)
            .end("pose"),
        Load::new(chip, 1.0)
            .issues(between)
            .bytes(gaussians * 3.0 * 32.0)
            .end("interpolate"),
    ])
}

/// From Gaussians to the renderer's own picture, by one back end.
///
/// # Errors
/// A table of other shaders.
pub fn drawing(
    work: &Work,
    back_end: BackEnd,
    costs: &ShaderCosts,
    chip: &Chip,
) -> Result<Vec<StageEstimate>, TableError> {
    let mut stages = vec![project(work, costs, chip)?, sort(work, costs, chip)?];
    match back_end {
        BackEnd::Tiles => stages.extend([bin(work, costs, chip)?, raster(work, costs, chip)?]),
        BackEnd::Quads => stages.push(quads(work, costs, chip)?),
    }
    Ok(stages)
}

fn project(work: &Work, costs: &ShaderCosts, chip: &Chip) -> Result<StageEstimate, TableError> {
    let (gaussians, views) = (work.gaussians as f64, work.views.len() as f64);
    // Two loops look rows up that lenses hide in part, of which there are none here (the listing's loops have that inside, and are reckoned with it); three hand what waves found to one counter.
    let loops = [
        ("", 1.0),
        ("1", 0.0),
        ("2", 0.0),
        ("3", 1.0),
        ("4", 1.0),
        ("5", 1.0),
    ];
    let one = costs.issued("project_foreground compute 64", &loops)?;
    // The table's program is for two views.
    let share = (1.0 + views) / 3.0;
    Ok(Load::new(chip, 2.0)
        .issues(one * waves(gaussians) * share)
        .bytes(gaussians * (32.0 + 8.0 + 36.0 * views))
        .scattered(7.0 * waves(gaussians))
        .end("project"))
}

fn sort(work: &Work, costs: &ShaderCosts, chip: &Chip) -> Result<StageEstimate, TableError> {
    let sorted = work.sorted as f64;
    let bins = (sorted / 4.0).clamp(65_536.0, 1_048_576.0);
    // Within a key's bin each is compared with the others: a few, for keys are many.
    let compared = 1.0 + sorted / bins;
    let all = costs.issued("sort_count compute 64", &[("", 1.0)])?
        + costs.issued("sort_scatter compute 64", &[("", 1.0)])?
        + costs.issued("sort_rank compute 64", &[("", 1.0), ("1", compared)])?;
    // Where not every picture sorts, this is its share.
    let sorted = sorted * work.sort_share;
    let bins = bins * work.sort_share;
    // Plan, count, two of the scan, scatter and rank, and those for crowded keys, which find nothing to do.
    let passes = 6.0 + SORT_CROWDED.len() as f64;
    Ok(Load::new(chip, passes * work.sort_share)
        .issues(all * waves(sorted))
        .bytes(sorted * 36.0 + bins * 20.0)
        // Depths by item; two atomic additions; what is placed, and the order.
        .scattered(sorted * (2.0 + 2.0 + 2.0 + 1.0))
        .end("sort"))
}

fn bin(work: &Work, costs: &ShaderCosts, chip: &Chip) -> Result<StageEstimate, TableError> {
    let (views, sorted) = (work.views.len() as f64, work.sorted as f64);
    let lists = work.sum(|view| view.tiles);
    let pairs = work.sum(|view| view.pairs);
    let splats = work.sum(|view| view.splats);
    let mut lanes = f64::from(MOST_LISTING_LANES);
    while lists * lanes * 4.0 > MOST_LISTING_BYTES as f64 {
        lanes /= 2.0;
    }
    // Waves are half full: 32 invocations each. The busiest invocation is what its wave waits for.
    let (a_run, runs) = (sorted / lanes, lanes * views / 32.0);
    let cells = Estimate::exactly(pairs / (lanes * views));
    let busiest = product(cells, UNEVEN);
    let rows = (pairs / splats.max(1.0)).sqrt().max(1.0);
    let walk = |key: &str| -> Result<Estimate, TableError> {
        let runs_of = |cells: f64| {
            [
                ("", 1.0),
                ("1", a_run),
                ("1.1", a_run * rows),
                ("1.1.1", cells),
            ]
        };
        let of = |cells: f64| costs.issued(key, &runs_of(cells));
        let (least, likely, most) = (of(busiest.least)?, of(busiest.likely)?, of(busiest.most)?);
        Ok(Estimate::new(least.least, likely.likely, most.most) * runs)
    };
    let sum = costs.issued("bin_lanes compute 64", &[("", 1.0), ("1", lanes)])? * waves(lists);
    let table = lists * lanes * 4.0;
    Ok(Load::new(chip, 7.0)
        .issues(walk("bin_count compute 64")? + walk("bin_emit compute 64")? + sum)
        // The table: cleared, read and written by the sum. The picture is cleared here, too.
        .bytes(3.0 * table + 2.0 * sorted * 4.0 + 8.0 * work.pixels())
        // A cell is read and written by each of two walks; where the list begins, and its entry. What each splat touches, by its number.
        .scattered(6.0 * pairs + 2.0 * views * sorted)
        .chain(busiest * 2.0)
        .chain(Estimate::exactly(2.0 * a_run))
        .chain(Estimate::exactly(lanes))
        .end("list tiles"))
}

fn raster(work: &Work, costs: &ShaderCosts, chip: &Chip) -> Result<StageEstimate, TableError> {
    let (blocks, blends) = (work.sum(|view| view.blocks), work.sum(|view| view.blends));
    let batches = work.sum(|view| view.batches);
    // The two inner loops take 32 splats of a batch each.
    let runs = [
        ("", blocks),
        ("1", batches),
        ("1.1", 0.5 * blends),
        ("1.2", 0.5 * blends),
    ];
    let longest = work
        .views
        .iter()
        .map(|view| view.most_blends)
        .max()
        .unwrap_or(0) as f64;
    // A splat's 32 bytes and its entry, read by each of a tile's four blocks: from memory once at best, by each of them at worst.
    let read = Estimate::new(0.25, 0.5, 1.0) * (64.0 * batches * 36.0);
    Ok(Load::new(chip, 1.0)
        .issues(costs.issued("raster compute 64", &runs)?)
        .bytes(read + Estimate::exactly(64.0 * blocks * 8.0))
        // The longest block's wave, one instruction after the other.
        .each_cycle(
            Limit::Latency,
            Estimate::exactly(longest * 48.0),
            Estimate::exactly(1.0),
        )
        .end("raster"))
}

fn quads(work: &Work, costs: &ShaderCosts, chip: &Chip) -> Result<StageEstimate, TableError> {
    let views = work.views.len() as f64;
    let fragments = work.sum(|view| view.fragments);
    let quads = work.sorted as f64 * views;
    let vertex = costs.issued("quad vertex 64", &[("", 1.0)])?;
    let vertices = product(vertex * waves(6.0 * quads), chip.vertex_runs);
    // Waves of 128 take two cycles for an instruction. Where two triangles meet, both shade the two-by-twos between them.
    let shaded = Estimate::new(1.0, 1.2, 1.4) * (2.0 * work.sum(|view| view.shaded) / 128.0);
    let fragment = product(
        costs.issued("quad_depth fragment 128", &[("", 1.0)])?,
        shaded,
    );
    let blended = product(Estimate::exactly(fragments), chip.with_depth);
    Ok(Load::new(chip, 1.0)
        .issues(vertices + fragment)
        .bytes(chip.vertex_runs * (quads * 40.0))
        .each_cycle(
            Limit::Triangles,
            Estimate::exactly(2.0 * 4.0 * quads),
            chip.triangles,
        )
        .each_cycle(Limit::Blending, blended, chip.blended)
        .end("quads"))
}

/// From the renderer's picture to the compositor's image: tiles are composed and copied, quads shown in the pass that drew them, with the depth that the
/// compositor's reprojection takes.
///
/// # Errors
/// A table of other shaders.
pub fn showing(
    work: &Work,
    back_end: BackEnd,
    costs: &ShaderCosts,
    chip: &Chip,
) -> Result<StageEstimate, TableError> {
    let pixels = work.pixels();
    let whole = [("", 1.0)];
    let (instructions, bytes, barriers) = match back_end {
        // Half floats read, 8 bits written to a buffer, and copied from there.
        BackEnd::Tiles => {
            let compose = costs.issued("compose_eye compute 64", &whole)?;
            (compose * waves(pixels), 8.0 + 4.0 + 8.0, 2.0)
        }
        // What was drawn is still in tile memory.
        BackEnd::Quads => {
            let show = costs.issued("show_eye_depth fragment 128", &whole)?;
            (show * (2.0 * pixels / 128.0), 4.0 + 4.0, 1.0)
        }
    };
    Ok(Load::new(chip, barriers)
        .issues(instructions)
        .bytes(bytes * pixels)
        .end("show"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::work::ViewWork;

    /// Of round numbers: a thousand cycles a millisecond.
    const CHIP: Chip = Chip {
        name: "made up",
        gpu_clock: Estimate::exactly(1e3),
        issues: Estimate::exactly(10.0),
        memory: Estimate::exactly(1e6),
        scattered: Estimate::exactly(2.0),
        latency: Estimate::exactly(1e-3),
        blended: Estimate::exactly(4.0),
        with_depth: Estimate::exactly(1.5),
        triangles: Estimate::exactly(1.0),
        vertex_runs: Estimate::exactly(2.0),
        barrier: Estimate::NONE,
        compositor: Estimate::NONE,
        cpu_memory: Estimate::exactly(1e6),
        npu_weights: Estimate::exactly(1e6),
        npu_call: Estimate::exactly(1.0),
        sources: &[],
    };

    fn work() -> Work {
        Work {
            gaussians: 6_400,
            sorted: 3_200,
            sort_share: 1.0,
            size: [160, 160],
            views: vec![ViewWork {
                splats: 3_200,
                tiles: 100,
                pairs: 6_400,
                blocks: 100,
                batches: 200,
                blends: 4_000,
                most_blends: 100,
                fragments: 80_000,
                shaded: 100_000,
                ..ViewWork::default()
            }],
        }
    }

    fn stage(chip: &Chip, back_end: BackEnd, name: &str) -> StageEstimate {
        let stages = drawing(&work(), back_end, &ShaderCosts::of_table(), chip);
        let mut stages = stages.expect("the table's shaders").into_iter();
        stages.find(|stage| stage.stage == name).expect("a stage")
    }

    fn assert_is(stage: StageEstimate, limit: Limit, likely: f64) {
        assert_eq!(stage.limit, limit, "{stage:?}");
        assert!(
            (stage.ms.likely - likely).abs() < 1e-9 * likely,
            "{stage:?}"
        );
    }

    #[test]
    fn each_stage_takes_what_its_longest_part_takes() {
        // 64 bytes each at a megabyte a millisecond.
        assert_is(uploading(&work(), &CHIP), Limit::Memory, 0.4096);
        // Seven words each, two a cycle.
        let sort = stage(&CHIP, BackEnd::Tiles, "sort");
        assert_is(sort, Limit::Scattered, 11.2);
        // Six words a pair and two a sorted splat: 44,800.
        let bin = stage(&CHIP, BackEnd::Tiles, "list tiles");
        assert_is(bin, Limit::Scattered, 22.4);
        // With none of those: 1,024 lanes' counts of a tile, each waited for; 6.25 cells a lane on the mean, and twice as many in the
        // busiest, in two walks; 3.125 splats of each walk's order.
        let calm = Chip {
            scattered: Estimate::exactly(1e9),
            memory: Estimate::exactly(1e12),
            issues: Estimate::exactly(1e9),
            ..CHIP
        };
        let bin = stage(&calm, BackEnd::Tiles, "list tiles");
        assert_is(bin, Limit::Latency, 1e-3 * (1024.0 + 25.0 + 6.25));
        // 80,000 fragments, half as long again with depth, four a cycle.
        let quads = stage(&CHIP, BackEnd::Quads, "quads");
        assert_is(quads, Limit::Blending, 30.0);
        // Four triangles for each of 3,200, twice.
        let blends = Chip {
            blended: Estimate::exactly(1e6),
            ..CHIP
        };
        let quads = stage(&blends, BackEnd::Quads, "quads");
        assert_is(quads, Limit::Triangles, 25.6);
    }

    #[test]
    fn instructions_are_those_of_the_waves_that_the_work_has() {
        let costs = ShaderCosts::of_table();
        let runs = [
            ("", 100.0),
            ("1", 200.0),
            ("1.1", 2_000.0),
            ("1.2", 2_000.0),
        ];
        let issued = costs
            .issued("raster compute 64", &runs)
            .expect("it is there");
        let raster = stage(&CHIP, BackEnd::Tiles, "raster");
        assert_is(raster, Limit::Arithmetic, issued.likely / 1e4);
        // The worst: what is likely of all of it, one after the other, is more than any part's most.
        assert!(raster.ms.most >= raster.ms.likely && raster.ms.least <= raster.ms.likely);
    }

    #[test]
    fn a_picture_that_keeps_its_order_sorts_in_part() {
        let mut half = work();
        half.sort_share = 0.5;
        let costs = ShaderCosts::of_table();
        let sorting = |work: &Work| {
            sort(work, &costs, &CHIP)
                .expect("the table's shaders")
                .ms
                .likely
        };
        assert!((sorting(&half) / sorting(&work()) - 0.5).abs() < 1e-9);
    }
}
