//! Whether a call stays as it was: its first minutes against its last.

use super::sample::{PROGRAMS, Sample, Shown};
use super::schedule::Schedule;
use crate::usage::Usage;
use serde::Serialize;
use std::ops::Range;
use std::time::Duration;

/// How much more memory may be taken at the end: a fiftieth.
const MOST_MEMORY: f64 = 0.02;

/// How much longer latency's 99th percentile may be at the end: a fifth.
const MOST_LATENCY: f64 = 0.2;

/// What is allowed of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Rule {
    /// Growth by this share of the first.
    Share(f64),
    /// No growth.
    Flat,
    /// None of it at all, at any time.
    None,
    /// Exactly so many.
    Exactly(f64),
    /// Anything: it is told, not judged.
    Told,
}

/// One figure of a call, at its beginning and at its end.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Row {
    /// Whose.
    of: &'static str,
    /// What, with its unit.
    what: &'static str,
    /// In the first minutes, the median; nothing where it is not known.
    first: Option<f64>,
    /// In the last.
    last: Option<f64>,
    /// Of the first; nothing where that is nought or not known.
    growth: Option<f64>,
    /// What is allowed, in words; empty where all is.
    allowed: String,
    /// Whether it is as it should be; nothing where it is not judged.
    pub(super) good: Option<bool>,
}

/// What a call came to beside its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Outcome {
    /// Times the headset was opened.
    pub(super) opened: u64,
    /// Connections that the receiver had with the sender.
    pub(super) connections: u64,
}

/// All rows.
pub(super) fn rows(samples: &[Sample], schedule: &Schedule, outcome: Outcome) -> Vec<Row> {
    let windows = [&schedule.first, &schedule.last].map(|time| within(samples, time));
    let late = schedule.late.each_ref().map(|time| within(samples, time));
    let between = |[first, last]: &[Vec<&Sample>; 2],
                   of,
                   what,
                   rule,
                   value: &dyn Fn(&[&Sample]) -> Option<f64>| {
        Row::new(of, what, [value(first), value(last)], rule)
    };
    let row = |of, what, rule, value: &dyn Fn(&[&Sample]) -> Option<f64>| {
        between(&windows, of, what, rule, value)
    };
    let mut rows = Vec::new();
    for (k, program) in PROGRAMS.into_iter().enumerate() {
        let usage = |value: fn(&Usage) -> f64| {
            move |window: &[&Sample]| {
                median(
                    window
                        .iter()
                        .filter_map(|one| one.processes.get(k))
                        .map(value),
                )
            }
        };
        rows.extend([
            row(
                program,
                "resident memory, MB",
                Rule::Share(MOST_MEMORY),
                &usage(|one| one.resident_bytes as f64 / 1e6),
            ),
            row(
                program,
                "descriptors",
                Rule::Flat,
                &usage(|one| one.descriptors as f64),
            ),
            row(
                program,
                "threads",
                Rule::Flat,
                &usage(|one| one.threads as f64),
            ),
        ]);
    }
    let shown = |value: fn(&Shown) -> Option<f64>| {
        move |window: &[&Sample]| {
            median((window.iter()).filter_map(|one| value(one.shown.as_ref()?)))
        }
    };
    let receive = "receive";
    let receiver = PROGRAMS.iter().position(|program| *program == receive);
    rows.extend([
        between(
            &late,
            receive,
            "resident since restarts, MB",
            Rule::Share(MOST_MEMORY),
            &|window| {
                let usage = |one: &&Sample| Some(one.processes.get(receiver?)?.resident_bytes);
                median(
                    window
                        .iter()
                        .filter_map(usage)
                        .map(|bytes| bytes as f64 / 1e6),
                )
            },
        ),
        row(
            receive,
            "device memory, MB",
            Rule::Share(MOST_MEMORY),
            &shown(|one| Some(one.device_bytes as f64 / 1e6)),
        ),
        row(
            receive,
            "capture to display, p50, ms",
            Rule::Told,
            &shown(|one| one.latency.map(|ms| ms.p50_ms)),
        ),
        row(
            receive,
            "capture to display, p99, ms",
            Rule::Share(MOST_LATENCY),
            &shown(|one| one.latency.map(|ms| ms.p99_ms)),
        ),
        row(receive, "motion frames lost, %", Rule::Told, &lost),
        row(receive, "validation messages", Rule::None, &|window| {
            window.last().map(|one| one.validation_messages as f64)
        }),
        Row::of_all(
            receive,
            "headset opened, times",
            outcome.opened,
            1 + schedule.restarts.len() as u64,
        ),
        Row::of_all(
            receive,
            "connections with the sender",
            outcome.connections,
            1,
        ),
        row("machine", "load", Rule::Told, &|window| {
            median(window.iter().filter_map(|one| one.load))
        }),
    ]);
    rows
}

fn within<'a>(samples: &'a [Sample], time: &Range<Duration>) -> Vec<&'a Sample> {
    let time = time.start.as_secs_f64()..=time.end.as_secs_f64();
    let samples = samples.iter();
    samples.filter(|one| time.contains(&one.seconds)).collect()
}

/// Motion frames lost of those sent, per cent.
fn lost(window: &[&Sample]) -> Option<f64> {
    let mut shown = window.iter().filter_map(|one| one.shown.as_ref());
    let first = shown.next()?;
    let last = shown.next_back()?;
    let lost = last.lost.saturating_sub(first.lost) as f64;
    let all = lost + last.frames.saturating_sub(first.frames) as f64;
    (all > 0.0).then(|| lost / all * 100.0)
}

/// The lower one of two in the middle.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len().checked_sub(1)? / 2).copied()
}

impl Row {
    fn new(
        of: &'static str,
        what: &'static str,
        [first, last]: [Option<f64>; 2],
        rule: Rule,
    ) -> Self {
        let both = first.zip(last);
        let growth = both.and_then(|(first, last)| (first > 0.0).then(|| last / first - 1.0));
        // What is not known is not good.
        let good = |is_good: bool| Some(both.is_some() && is_good);
        let is_at_most = |most: f64| both.is_some_and(|(first, last)| last <= first * most);
        let (allowed, good) = match rule {
            Rule::Share(most) => (
                format!("at most +{:.0} %", most * 100.0),
                good(is_at_most(1.0 + most)),
            ),
            Rule::Flat => ("no more".to_owned(), good(is_at_most(1.0))),
            Rule::None => ("none".to_owned(), good(last == Some(0.0))),
            Rule::Exactly(so_many) => (format!("{so_many}"), good(last == Some(so_many))),
            Rule::Told => (String::new(), None),
        };
        Self {
            of,
            what,
            first,
            last,
            growth,
            allowed,
            good,
        }
    }

    /// Of the whole call.
    fn of_all(of: &'static str, what: &'static str, all: u64, wanted: u64) -> Self {
        let all = Some(all as f64);
        let mut row = Self::new(of, what, [all; 2], Rule::Exactly(wanted as f64));
        (row.first, row.growth) = (None, None);
        row
    }
}

/// Rows as people read them.
pub(super) fn table(rows: &[Row]) -> Vec<String> {
    let mut lines = vec![format!(
        "{:<9} {:<28} {:>10} {:>10} {:>9}  {:<12} verdict",
        "", "medians", "first", "last", "growth", "allowed"
    )];
    for row in rows {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), written);
        let growth = row.growth.map(|growth| format!("{:+.1} %", growth * 100.0));
        let verdict = match row.good {
            None => "",
            Some(true) => "ok",
            Some(false) => "FAILS",
        };
        let line = format!(
            "{:<9} {:<28} {:>10} {:>10} {:>9}  {:<12} {verdict}",
            row.of,
            row.what,
            number(row.first),
            number(row.last),
            growth.unwrap_or_default(),
            row.allowed
        );
        lines.push(line.trim_end().to_owned());
    }
    lines
}

/// Whole numbers as such.
fn written(value: f64) -> String {
    if value.fract() == 0.0 {
        format!("{value:.0}")
    } else {
        format!("{value:.2}")
    }
}

#[cfg(test)]
mod tests;
