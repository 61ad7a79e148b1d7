//! Chooses the back end: the requested one, or the faster of the two. They are compared on the first picture, and once more
//! on the first picture that is drawn into external images, since drawing there may take longer or shorter.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::FrameParams;

use crate::error::RenderError;
use crate::external_images::{BackEndSet, ExternalImages};
use crate::geometry_pass::GeometryPass;
use crate::options::BackEnd;
use crate::quads::Quads;
use crate::target::Target;
use crate::tiles::Tiles;

/// Times each back end draws the first picture before they are compared; the first of each warms up and does not count, where there is another.
const TRIALS: usize = 4;

/// A picture that takes longer than this, ms, ends the comparison: more of it would look like a program that hangs.
const LONGEST_COMPARED: f64 = 500.0;

/// Nor is a picture of more pairs compared by a software driver: its quads take thirty times as long as tiles, which leave out what does not show.
const MOST_COMPARED_PAIRS: u32 = 1 << 19;

/// Milliseconds that each back end took for the same picture (listing and drawing).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackEndTrial {
    /// Median of the tile back end's.
    pub tiles: f64,
    /// Median of the quad back end's.
    pub quads: f64,
}

impl BackEndTrial {
    /// The faster one.
    #[must_use]
    pub fn winner(&self) -> BackEnd {
        if self.quads < self.tiles {
            BackEnd::Quads
        } else {
            BackEnd::Tiles
        }
    }
}

/// Whether the picture that was drawn is to be drawn once more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Redraw {
    /// No: it is finished.
    No,
    /// The back ends are being compared.
    ForComparison,
    /// The comparison is over: draw it as all that follow.
    ForShowing,
}

/// Both back ends while they are compared, one after that.
pub(crate) struct BackEnds {
    gpu: Arc<Gpu>,
    tiles: Option<Tiles>,
    quads: Option<Quads>,
    times: [Vec<f64>; 2],
    trial: Option<BackEndTrial>,
    /// Whether pictures are drawn into external images.
    for_external: bool,
}

impl BackEnds {
    /// The asked-for one, else the winner of a trial on the same device, else both where the device can tell which is faster.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        geometry: &GeometryPass,
        target: &Target,
        asked: Option<BackEnd>,
        trial: Option<BackEndTrial>,
    ) -> Result<Self, RenderError> {
        if asked == Some(BackEnd::Quads) && !BackEnd::Quads.runs_on(gpu) {
            return Err(RenderError::NoQuads);
        }
        let comparable = gpu.has_clock() && BackEnd::Quads.runs_on(gpu);
        let asked = asked
            .or(trial.map(|trial| trial.winner()))
            .or((!comparable).then_some(BackEnd::Tiles));
        let tiles = (asked != Some(BackEnd::Quads))
            .then(|| Tiles::new(gpu, geometry, target))
            .transpose()?;
        let quads = match asked {
            Some(BackEnd::Tiles) => None,
            Some(BackEnd::Quads) => Some(Quads::new(gpu, geometry, target)?),
            None => unless_out_of_memory(BackEnd::Tiles, Quads::new(gpu, geometry, target))?,
        };
        Ok(Self {
            gpu: Arc::clone(gpu),
            tiles,
            quads,
            times: Default::default(),
            trial,
            for_external: false,
        })
    }

    /// The picture that follows goes into these images: makes both ready for one another, and has the back ends compared anew
    /// where that was done for the renderer's target. The device is idle.
    pub(crate) fn prepare(
        &mut self,
        geometry: &GeometryPass,
        target: &Target,
        images: &mut dyn ExternalImages,
    ) -> Result<(), RenderError> {
        if !std::mem::replace(&mut self.for_external, true) && self.trial.is_some() {
            self.times = Default::default();
            if self.tiles.is_none() {
                self.tiles =
                    unless_out_of_memory(BackEnd::Quads, Tiles::new(&self.gpu, geometry, target))?;
            }
            if self.quads.is_none() {
                self.quads =
                    unless_out_of_memory(BackEnd::Tiles, Quads::new(&self.gpu, geometry, target))?;
            }
        }
        let drawers = BackEndSet {
            tiles: self.tiles.is_some(),
            quads: self.quads.is_some(),
        };
        images.prepare(&self.gpu, target, drawers)?;
        if let (Some(quads), Some(pass)) = (&mut self.quads, images.pass()) {
            quads.prepare(pass)?;
        }
        Ok(())
    }

    /// Whether the next picture is drawn directly into these images.
    pub(crate) fn draws_into(&self, images: Option<&dyn ExternalImages>) -> bool {
        let drawn_into = images.is_some_and(|images| images.pass().is_some());
        drawn_into && self.current() == BackEnd::Quads
    }

    /// The one that draws the next picture.
    pub(crate) fn current(&self) -> BackEnd {
        let [tiles, quads] = &self.times;
        match (&self.tiles, &self.quads) {
            (Some(_), Some(_)) if tiles.len() > quads.len() => BackEnd::Quads,
            (None, _) => BackEnd::Quads,
            _ => BackEnd::Tiles,
        }
    }

    /// What the comparison found; nothing before its end, or where a back end was asked for.
    pub(crate) fn trial(&self) -> Option<BackEndTrial> {
        self.trial
    }

    /// Whether the comparison was begun and is not at its end.
    pub(crate) fn is_comparing(&self) -> bool {
        let [tiles, _] = &self.times;
        self.tiles.is_some() && self.quads.is_some() && !tiles.is_empty()
    }

    /// Fills in what the shaders read of sizes.
    pub(crate) fn describe(&self, frame: &mut FrameParams, target: &Target) {
        if let Some(tiles) = &self.tiles {
            tiles.describe(frame, target);
        }
    }

    /// Records what comes between the sort and the drawing.
    pub(crate) fn record_bin(&self, commands: vk::CommandBuffer, target: &Target) {
        if let (BackEnd::Tiles, Some(tiles)) = (self.current(), &self.tiles) {
            tiles.record_bin(commands, target);
        }
    }

    /// Records the drawing into the target, and from there into the images, if any; or directly into those.
    pub(crate) fn record_draw(
        &self,
        commands: vk::CommandBuffer,
        target: &Target,
        images: Option<&dyn ExternalImages>,
    ) {
        match (self.current(), &self.tiles, &self.quads) {
            (BackEnd::Tiles, Some(tiles), _) => tiles.record_raster(commands, target),
            (_, _, Some(quads)) => {
                if let Some((images, pass)) = images.and_then(|it| Some((it, it.pass()?))) {
                    images.record_direct(commands, &|area| {
                        quads.record_within(commands, pass, area);
                    });
                    return;
                }
                quads.record(commands, target);
            }
            _ => {}
        }
        barrier(&self.gpu, commands);
        if let Some(images) = images {
            images.record_copied(commands);
        }
    }

    /// Whether the picture was not drawn because a list was too small, which has grown now. The device is idle.
    pub(crate) fn has_grown(
        &mut self,
        geometry: &GeometryPass,
        target: &Target,
    ) -> Result<bool, RenderError> {
        let BackEnd::Tiles = self.current() else {
            return Ok(false);
        };
        let Some(tiles) = &mut self.tiles else {
            return Ok(false);
        };
        let wanted = tiles.pairs_wanted();
        if wanted <= tiles.pair_capacity() {
            return Ok(false);
        }
        tiles.grow(wanted, geometry, target)?;
        Ok(true)
    }

    /// Records how long the picture took, and frees the slower back end at the end of the comparison. The device is idle. Returns
    /// whether to draw the picture again.
    pub(crate) fn record_time(&mut self, milliseconds: f64) -> Redraw {
        if self.tiles.is_none() || self.quads.is_none() {
            return Redraw::No;
        }
        if self.current() == BackEnd::Tiles && self.tile_pairs() == 0 {
            // Nothing is in view: nothing to compare them with.
            return Redraw::No;
        }
        let pairs = self.tile_pairs();
        let [tiles, quads] = &mut self.times;
        let times = if tiles.len() > quads.len() {
            &mut *quads
        } else {
            &mut *tiles
        };
        times.push(milliseconds);
        // The first one's time is a software driver's compiler's.
        let is_slow = times.len() > 1 && milliseconds > LONGEST_COMPARED;
        if quads.is_empty() && self.gpu.info().is_cpu && pairs > MOST_COMPARED_PAIRS {
            // Drawn already, by the back end that leaves out what does not show.
            log::info!("splatting by tiles, without comparison: {pairs} pairs of splat and tile");
            self.quads = None;
            return Redraw::No;
        }
        if quads.len() < TRIALS && !is_slow {
            return Redraw::ForComparison;
        }
        let trial = BackEndTrial {
            tiles: median(tiles),
            quads: median(quads),
        };
        let winner = trial.winner();
        log::info!(
            "splatting by {winner}: tiles took {:.2} ms, quads {:.2} ms",
            trial.tiles,
            trial.quads
        );
        match winner {
            BackEnd::Tiles => self.quads = None,
            BackEnd::Quads => self.tiles = None,
        }
        self.trial = Some(trial);
        Redraw::ForShowing
    }

    /// The tiles' lists; nothing where quads drew the last picture.
    pub(crate) fn tiles(&self) -> Option<&Tiles> {
        match self.current() {
            BackEnd::Tiles => self.tiles.as_ref(),
            BackEnd::Quads => None,
        }
    }

    /// (Gaussian, tile) pairs in the last picture; 0 for quads.
    pub(crate) fn tile_pairs(&self) -> u32 {
        self.tiles().map_or(0, Tiles::pairs_wanted)
    }
}

/// The other back end for the comparison; none where the device has no memory for both.
fn unless_out_of_memory<T>(
    other: BackEnd,
    made: Result<T, VulkanError>,
) -> Result<Option<T>, VulkanError> {
    match made {
        Err(why @ VulkanError::OutOfMemory { .. }) => {
            log::info!("{other} draw without comparison: {why}");
            Ok(None)
        }
        made => made.map(Some),
    }
}

/// The median of all but the first, or the only one.
fn median(times: &mut [f64]) -> f64 {
    let counted = match times {
        [_, rest @ ..] if !rest.is_empty() => rest,
        all => all,
    };
    counted.sort_by(f64::total_cmp);
    counted.get(counted.len() / 2).copied().unwrap_or_default()
}
