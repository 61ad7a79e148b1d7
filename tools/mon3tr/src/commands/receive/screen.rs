//! A call on a screen, in a window or not: what stands around the person, and what the pictures came to.

use super::Options;
use crate::gaze::{Gaze, GazeFigures};
use crate::live::{Live, Moment, Shown};
use crate::report::Splatting;
use crate::scenery::Scenery;
use crate::stage::Setting;
use crate::viewpoint::Viewpoint;
use app::hold::HoldFigures;
use app::{Call, Collector, PlacementReport, Recording, Skipped, Summary, Terms};
use profile_report::Measured;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A call that is shown.
#[derive(Debug)]
pub(crate) struct Screen<'a> {
    pub(super) options: &'a Options,
    pub(crate) live: Live,
    /// Moves the camera, if somebody's gaze does.
    pub(crate) gaze: Option<Gaze>,
    pub(super) pictures: Vec<PathBuf>,
    /// Whether the scene stands already; it is put around the place where the person first stands.
    settled: bool,
    began: Option<Instant>,
}

/// What pictures came to.
#[derive(Debug, Serialize)]
pub(super) struct Watched {
    #[serde(skip)]
    pub(super) pictures: Vec<PathBuf>,
    pub(super) views: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) splatting: Splatting,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) gaze: Option<GazeFigures>,
    #[serde(flatten)]
    pub(super) shown: Measured,
}

impl Watched {
    /// The tables that `profile` prints.
    pub(super) fn print(&self) {
        let of = &self.shown.measured;
        let eyes = if self.views == 2 { "2 x " } else { "" };
        println!(
            "\npictures   {eyes}{} x {} pixels for a display of {:.0} Hz, the last {:.1} s",
            self.width, self.height, of.display_hz, of.seconds
        );
        println!("splatting  {}", self.splatting);
        for line in self.shown.tables() {
            println!("{line}");
        }
        println!();
        for line in self.shown.totals() {
            println!("{line}");
        }
    }
}

impl<'a> Screen<'a> {
    pub(super) fn new(options: &'a Options, live: Live, gaze: Option<Gaze>) -> Self {
        Self {
            options,
            live,
            gaze,
            pictures: Vec::new(),
            settled: options.scenery.background.is_none(),
            began: None,
        }
    }

    /// Begins the picture that is due now; `None` until there is somebody to be seen.
    pub(crate) fn begin(&mut self) -> anyhow::Result<Option<Moment>> {
        let Some(moment) = self.live.begin()? else {
            return Ok(None);
        };
        if !self.settled {
            self.settled = true;
            let scenery = (self.options.scenery).around(None, moment.floor, moment.heading)?;
            let setting = self.live.setting().clone();
            self.live.set(Setting {
                background: (scenery.as_ref()).map(|scenery| Arc::clone(&scenery.background)),
                filter: scenery.as_ref().map_or(setting.filter, Scenery::filter),
                ..setting
            })?;
        }
        self.began.get_or_insert_with(Instant::now);
        Ok(Some(moment))
    }

    /// Where the picture that was begun now is seen from, if it were seen from `viewpoint` without a gaze.
    pub(crate) fn seen_from(&mut self, viewpoint: Viewpoint) -> Viewpoint {
        match &mut self.gaze {
            Some(gaze) => gaze.follow(viewpoint, Instant::now()),
            None => viewpoint,
        }
    }

    /// Ends the lanes.
    pub(super) fn finish(mut self) -> anyhow::Result<(Call, Option<Watched>)> {
        let renderer = self.live.lanes.renderer();
        let splatting = Splatting::new(renderer.back_end(), renderer.back_end_trial());
        let Setting { size, views, .. } = *self.live.setting();
        let period = self.live.display.period();
        let Shown {
            call,
            collector,
            placement,
            skipped,
            hold,
        } = self.live.finish()?;
        let Some(began) = self.began else {
            return Ok((call, None));
        };
        let motion_hz = call.figures().announced.rate_hz;
        let shown = measured(
            &collector,
            placement,
            (skipped, hold),
            began,
            period,
            motion_hz,
        );
        let watched = Watched {
            pictures: self.pictures,
            views: views.count(),
            width: size.width,
            height: size.height,
            splatting,
            gaze: self.gaze.map(Gaze::figures),
            shown,
        };
        Ok((call, Some(watched)))
    }
}

/// What lanes told since `began`, of a display with that period.
pub(super) fn measured(
    collector: &Collector,
    placement: PlacementReport,
    (skipped, hold): (Skipped, HoldFigures),
    began: Instant,
    display_period: Duration,
    motion_hz: f64,
) -> Measured {
    let terms = Terms {
        display_period,
        motion_hz,
        units: placement.units(),
        encode: None,
        lost_events: collector.lost(),
    };
    let recording = Recording::new(collector, began, Instant::now());
    Measured {
        placement,
        skipped,
        hold,
        measured: Summary::new(&recording, &terms),
    }
}
