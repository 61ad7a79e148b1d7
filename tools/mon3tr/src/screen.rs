//! A call on a screen, in a window or not: what stands around the person, and what the pictures came to.

use crate::gaze::{Gaze, GazeFigures};
use crate::live::{LiveView, Moment, ViewReport};
use crate::report::Splatting;
use crate::scenery::{Scenery, SceneryOptions};
use crate::stills::RenderSettings;
use crate::viewpoint::Viewpoint;
use app_pipeline::lanes::Skipped;
use app_pipeline::placement::PlacementReport;
use app_pipeline::profile::{Collector, Recording, Summary, Terms};
use app_pipeline::quality::QualityFigures;
use app_session::call::Call;
use profile_report::Measured;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A call that is shown.
#[derive(Debug)]
pub(crate) struct Screen<'a> {
    scenery: &'a SceneryOptions,
    pub(crate) live: LiveView,
    /// Moves the camera, if somebody's gaze does.
    pub(crate) gaze: Option<Gaze>,
    pub(crate) pictures: Vec<PathBuf>,
    /// Whether the scene stands already; it is put around the place where the person first stands.
    settled: bool,
    began: Option<Instant>,
}

/// What pictures came to.
#[derive(Debug, Serialize)]
pub(crate) struct Watched {
    #[serde(skip)]
    pub(crate) pictures: Vec<PathBuf>,
    pub(crate) views: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) splatting: Splatting,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) gaze: Option<GazeFigures>,
    #[serde(flatten)]
    pub(crate) shown: Measured,
}

impl Watched {
    /// The tables that `profile` prints.
    pub(crate) fn print(&self) {
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
    pub(crate) fn new(scenery: &'a SceneryOptions, live: LiveView, gaze: Option<Gaze>) -> Self {
        Self {
            scenery,
            live,
            gaze,
            pictures: Vec::new(),
            settled: scenery.background.is_none(),
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
            let scenery = (self.scenery).around(None, moment.floor, moment.heading)?;
            let setting = self.live.setting().clone();
            self.live.set(RenderSettings {
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
    pub(crate) fn finish(mut self) -> anyhow::Result<(Call, Option<Watched>)> {
        let renderer = self.live.lanes.renderer();
        let splatting = Splatting::new(renderer.back_end(), renderer.back_end_trial());
        let RenderSettings { size, views, .. } = *self.live.setting();
        let period = self.live.display.period();
        let ViewReport {
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
pub(crate) fn measured(
    collector: &Collector,
    placement: PlacementReport,
    (skipped, hold): (Skipped, QualityFigures),
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
