//! Takes the panel's figures from running lanes. What that costs does not grow with the call: it looks at the last two seconds.

use super::{FrameTime, OverlayFigures, OverlayLatency, UnitLoad};
use crate::call::{CallCounts, CallWatch};
use app_pipeline::lanes::{Lanes, MotionSource};
use app_pipeline::placement::PlacementReport;
use app_pipeline::profile::nanoseconds;
use app_pipeline::profile::{Collector, LatencyBreakdown, Occupancy, PictureFigures, Recording};
use app_pipeline::quality::QualityFigures;
use app_pipeline::stage::Unit;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// What rates and times are taken of.
const WINDOW: Duration = Duration::from_secs(2);
/// What loss is taken of: in two seconds one frame would be nearly two percent.
const LOSS_WINDOW: Duration = Duration::from_secs(10);
/// Between two counts that are kept, so that there are never many however often one looks.
const APART: Duration = Duration::from_millis(200);

/// Looks at running lanes.
#[derive(Debug)]
pub struct OverlayWatch {
    placement: PlacementReport,
    call: Option<CallWatch>,
    /// Counts of the last [`LOSS_WINDOW`], oldest first.
    counts: VecDeque<(Instant, CallCounts)>,
    begun: Instant,
}

impl OverlayWatch {
    /// Of lanes that were placed as `placement` says; `call` tells what the network brings, if there is one.
    #[must_use]
    pub fn new(placement: PlacementReport, call: Option<CallWatch>) -> Self {
        Self::since(placement, call, Instant::now())
    }

    /// The same for lanes that were started then.
    pub(super) fn since(
        placement: PlacementReport,
        call: Option<CallWatch>,
        begun: Instant,
    ) -> Self {
        Self {
            placement,
            call,
            counts: VecDeque::new(),
            begun,
        }
    }

    /// The figures of the last two seconds, of the first person's lanes where there are several. The display shows a picture
    /// every `period`. Meant to be called twice a second from the thread that draws, for which it is quick enough.
    pub fn look<S: MotionSource>(
        &mut self,
        lanes: &mut Lanes<S>,
        period: Duration,
    ) -> OverlayFigures {
        self.placement.follow(lanes.provider_changes());
        let quality = lanes.quality_figures();
        self.figures(lanes.collector(), &quality, period, Instant::now())
    }

    /// The same of what lanes have told until `now`.
    pub(super) fn figures(
        &mut self,
        collector: &Collector,
        quality: &QualityFigures,
        period: Duration,
        now: Instant,
    ) -> OverlayFigures {
        let begin = now.checked_sub(WINDOW).unwrap_or(now).max(self.begun);
        let recording = Recording::newest(collector, begin, now);
        let pictures = &recording.pictures;
        let units = self.placement.units();
        let figures = PictureFigures::new(&recording, period);
        let occupancy = Occupancy::new(&recording, |stage| units[stage as usize]);
        let latency = LatencyBreakdown::new(pictures, None);
        let has_begun = quality.pictures > 0;
        let (kbit_s, loss) = self.network(now);
        OverlayFigures {
            shown_hz: has_begun.then_some(figures.per_second),
            display_hz: Some(1.0 / period.as_secs_f64().max(1e-6)),
            frames: pictures
                .iter()
                .map(|one| {
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "milliseconds of one picture, to be looked at"
                    )]
                    let ms = (nanoseconds(one.begun, one.drawn) as f64 / 1e6) as f32;
                    FrameTime {
                        ms,
                        is_late: PictureFigures::is_late(one, period),
                    }
                })
                .collect(),
            late_in_all: has_begun.then_some(quality.late_pictures),
            units: Unit::ALL.map(|unit| {
                let share = occupancy.units.iter().find(|busy| busy.who == unit)?.share;
                let is_placed = units.contains(&unit) && !pictures.is_empty();
                is_placed.then(|| UnitLoad {
                    ms: share * recording.seconds() * 1e3 / pictures.len().max(1) as f64,
                    share,
                })
            }),
            latency: latency.map(|latency| OverlayLatency {
                since: latency.since,
                p50_ms: latency.whole.p50_ms,
                p95_ms: latency.whole.p95_ms,
            }),
            kbit_s,
            loss,
            placement: Some(self.placement.name()),
            gaussians: pictures.last().map(|one| one.gaussians),
            quality: Some(quality.quality),
        }
    }

    /// What came a second in the last two, and what never came in the last ten.
    pub(super) fn network(&mut self, now: Instant) -> (Option<f64>, Option<f64>) {
        let Some(call) = &self.call else {
            return (None, None);
        };
        let counts = call.counts();
        let age = |at: Instant| now.saturating_duration_since(at);
        while self
            .counts
            .front()
            .is_some_and(|(at, _)| age(*at) > LOSS_WINDOW)
        {
            self.counts.pop_front();
        }
        let of_rate = self.counts.iter().find(|(at, _)| age(*at) <= WINDOW);
        let kbit_s = of_rate.and_then(|(at, before)| {
            let bits = 8 * counts.payload_bytes.saturating_sub(before.payload_bytes);
            let seconds = age(*at).as_secs_f64();
            (seconds > 0.0).then(|| bits as f64 / 1e3 / seconds)
        });
        let loss = self.counts.front().and_then(|(_, before)| {
            let lost = counts.lost.saturating_sub(before.lost);
            let all = lost + counts.frames.saturating_sub(before.frames);
            (all > 0).then(|| lost as f64 / all as f64)
        });
        if self.counts.back().is_none_or(|(at, _)| age(*at) >= APART) {
            self.counts.push_back((now, counts));
        }
        (kbit_s, loss)
    }
}
