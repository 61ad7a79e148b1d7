//! The measurements of a call's lanes, and where its stages ran: as tables for people and as JSON for programs, of whichever
//! command showed the call. Only a profile has a page and a trace.

mod latency;
mod placement;

pub(crate) use placement::headed;

use app_pipeline::lanes::Skipped;
use app_pipeline::placement::PlacementReport;
use app_pipeline::profile::{Occupancy, PictureFigures, Recording, StageSummary, Summary, Terms};
use app_pipeline::quality::QualityFigures;
use app_session::attendee::PersonReport;
use app_session::session::SessionReport;
use serde::Serialize;
use std::time::{Duration, Instant};

/// Columns that lines have at most.
const COLUMNS: usize = 110;
/// Columns of the heading before the text of a line.
const HEADING: usize = 11;

/// All measurements of a call's lanes.
#[derive(Debug, Serialize)]
pub struct Measured {
    /// The placement, its alternatives, and why they were not chosen.
    pub placement: PlacementReport,
    /// What lanes left out because something newer had come, since the call began.
    pub skipped: Skipped,
    /// The changes of quality to hold the display's rate.
    pub quality: QualityFigures,
    /// Of the measured time, or of its last half minute.
    pub measured: Summary,
}

/// What is known of a session beside what its lanes recorded.
#[derive(Debug, Clone, Copy)]
pub struct SessionTerms {
    /// When measuring began and ended.
    pub time: [Instant; 2],
    /// From one refresh of the display to the next.
    pub display_period: Duration,
    /// Motion frames a second.
    pub motion_hz: f64,
    /// What the sender needed to encode a frame, if that is known.
    pub encode: Option<Duration>,
}

impl SessionTerms {
    /// One person's recording, and what its figures are of.
    #[must_use]
    pub fn recording(&self, person: &PersonReport) -> (Recording, Terms) {
        let [begin, end] = self.time;
        let terms = Terms {
            display_period: self.display_period,
            motion_hz: self.motion_hz,
            units: person.placement.units(),
            encode: self.encode,
            lost_events: person.collector.lost(),
        };
        (Recording::new(&person.collector, begin, end), terms)
    }
}

impl Measured {
    /// What the lanes of one person of a session measured.
    #[must_use]
    pub fn of(session: &SessionReport, person: &PersonReport, terms: &SessionTerms) -> Self {
        let (recording, terms) = terms.recording(person);
        Self {
            placement: person.placement.clone(),
            skipped: session.skipped,
            quality: session.quality.clone(),
            measured: Summary::new(&recording, &terms),
        }
    }

    /// Where stages run and what else was tried, what each takes, how lanes overlap, and latency in parts.
    #[must_use]
    pub fn tables(&self) -> Vec<String> {
        let of = &self.measured;
        let mut lines = placement::chosen(&self.placement);
        for table in [
            placement::tried(&self.placement),
            stages(&of.stages, of.display_hz),
            lanes(&of.occupancy),
            of.latency.as_ref().map_or_else(Vec::new, latency::table),
        ] {
            if !table.is_empty() {
                lines.push(String::new());
                lines.extend(table);
            }
        }
        lines
    }

    /// The pictures shown, late and repeated, and what the figures leave out.
    #[must_use]
    pub fn totals(&self) -> Vec<String> {
        let of = &self.measured;
        let mut lines = vec![pictures(&of.pictures, of.display_hz)];
        lines.extend(quality(&self.quality));
        let s = &self.skipped;
        lines.push(format!(
            "{:<HEADING$}{} poses, {} inferences, {} requests for pictures, {} interpolations: something newer had come",
            "left out", s.poses, s.inferences, s.requests, s.interpolations
        ));
        if of.lost_events > 0 {
            lines.push(format!(
                "incomplete: {} events found the profiler's queue full",
                of.lost_events
            ));
        }
        lines
    }
}

fn stages(rows: &[StageSummary], display_hz: f64) -> Vec<String> {
    let mut lines = vec![format!(
        "{:<24} {:<4} {:>7} {:>9} {:>9} {:>9} {:>9} {:>13}",
        "stage, ms",
        "unit",
        "count",
        "p50",
        "p95",
        "p99",
        "max",
        format!("of {:.1} ms", 1e3 / display_hz)
    )];
    for row in rows {
        let t = &row.times;
        lines.push(format!(
            "{:<24} {:<4} {:>7} {:>9.2} {:>9.2} {:>9.2} {:>9.2} {:>13}",
            row.stage.name(),
            row.unit.name(),
            t.count,
            t.p50_ms,
            t.p95_ms,
            t.p99_ms,
            t.max_ms,
            row.display_share.map_or_else(String::new, percent)
        ));
    }
    lines
}

fn pictures(p: &PictureFigures, display_hz: f64) -> String {
    format!(
        "{:<HEADING$}{} shown: {:.1} of {display_hz:.0} a second; {} repeated, {} late, {} blanks missed",
        "pictures", p.shown, p.per_second, p.repeated, p.late, p.missed_vblanks
    )
}

/// The most changes of quality that are listed: the last ones.
const CHANGES: usize = 4;

/// Which quality was drawn for how long, and why it changed last; nothing where it did not.
fn quality(figures: &QualityFigures) -> Vec<String> {
    if figures.change_count == 0 {
        return Vec::new();
    }
    let mut lines = vec![format!(
        "{:<HEADING$}changed {} times to hold the rate",
        "quality", figures.change_count
    )];
    let drawn = figures.steps.iter().filter(|step| step.pictures > 0);
    lines.extend(drawn.map(|step| {
        format!(
            "{:<HEADING$}{:6.1} s, {:>5} pictures: {}",
            "", step.seconds, step.pictures, step.quality
        )
    }));
    let last = figures.changes.len().saturating_sub(CHANGES);
    let changes = figures.changes.iter().skip(last);
    lines.extend(changes.map(|change| format!("{:<HEADING$}{change}", "")));
    lines
}

fn percent(share: f64) -> String {
    format!("{:.0} %", share * 100.0)
}

fn lanes(occupancy: &Occupancy) -> Vec<String> {
    let names = occupancy.lanes.iter().map(|lane| lane.who.name());
    let mut heading = format!("{:<24} {:>6}", "lane", "busy");
    for name in names.take(occupancy.lanes.len().saturating_sub(1)) {
        heading += &format!(" {:>15}", format!("& {name}"));
    }
    let mut lines = vec![heading];
    for lane in &occupancy.lanes {
        let mut line = format!("{:<24} {:>6}", lane.who.name(), percent(lane.share));
        let pairs = occupancy.pairs.iter();
        for pair in pairs.filter(|pair| pair.lanes[1] == lane.who) {
            line += &format!(" {:>15}", percent(pair.share));
        }
        lines.push(line);
    }
    let counts = ["none", "one", "two", "three", "four"];
    let at_once = counts.iter().zip(occupancy.at_once);
    let at_once: Vec<String> = at_once
        .map(|(count, share)| format!("{count} {}", percent(share)))
        .collect();
    lines.push(format!(
        "{:<24} {}",
        "lanes busy at once",
        at_once.join(", ")
    ));
    let units = occupancy.units.iter();
    let units: Vec<String> = units
        .map(|unit| format!("{} {}", unit.who.name(), percent(unit.share)))
        .collect();
    lines.push(format!("{:<24} {}", "units busy", units.join(", ")));
    lines
}
