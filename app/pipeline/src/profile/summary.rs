//! A measured interval in figures: what tables, JSON, the page and an overlay show.

use crate::profile::{
    LatencyBreakdown, Occupancy, PictureFigures, Profile, Recording, StageSummary,
};
use crate::stage::{Stage, Unit};
use serde::Serialize;
use std::time::Duration;

/// What must be known beside a recording.
#[derive(Debug, Clone, Copy)]
pub struct Terms {
    /// From one vertical blank of the display to the next.
    pub display_period: Duration,
    /// Motion frames a second.
    pub motion_hz: f64,
    /// Where each stage ran, in the order of [`Stage::ALL`].
    pub units: [Unit; Stage::ALL.len()],
    /// What the sender needs to encode a frame, on average, if it has told.
    pub encode: Option<Duration>,
    /// Events that lanes could not tell ([`crate::profile::Collector::lost`]), of all lanes.
    pub lost_events: u64,
}

/// Everything measured in an interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// How long was measured.
    pub seconds: f64,
    /// Vertical blanks a second.
    pub display_hz: f64,
    /// Motion frames a second.
    pub motion_hz: f64,
    /// One row per stage that ran.
    pub stages: Vec<StageSummary>,
    /// How busy lanes and units were.
    pub occupancy: Occupancy,
    /// What the display showed.
    pub pictures: PictureFigures,
    /// From capture to display; none without pictures.
    pub latency: Option<LatencyBreakdown>,
    /// Events that found a queue full: with any, the figures miss something.
    pub lost_events: u64,
}

impl Terms {
    /// Where `stage` ran.
    #[must_use]
    pub fn unit_of(&self, stage: Stage) -> Unit {
        self.units[stage as usize]
    }
}

impl Summary {
    /// Of what was recorded.
    #[must_use]
    pub fn new(recording: &Recording, terms: &Terms) -> Self {
        let display_hz = 1.0 / terms.display_period.as_secs_f64().max(1e-6);
        let mut stages = Profile::of(recording).summary(|stage| terms.unit_of(stage));
        for row in &mut stages {
            let rate = if row.stage.is_per_picture() {
                display_hz
            } else {
                terms.motion_hz
            };
            row.display_share = Some(row.times.p50_ms / 1e3 * rate);
        }
        Self {
            seconds: recording.seconds(),
            display_hz,
            motion_hz: terms.motion_hz,
            stages,
            occupancy: Occupancy::new(recording, |stage| terms.unit_of(stage)),
            pictures: PictureFigures::new(recording, terms.display_period),
            latency: LatencyBreakdown::new(&recording.pictures, terms.encode),
            lost_events: terms.lost_events,
        }
    }
}
