//! What was recorded in one measured interval, in order of time: what summaries, traces and pages are made of.

use crate::profile::{Collector, PictureTimes, Span};
use std::time::Instant;

/// Spans and pictures of one interval.
#[derive(Debug, Clone)]
pub struct Recording {
    /// When measuring began ...
    pub begin: Instant,
    /// ... and ended.
    pub end: Instant,
    /// Work that went on in between, by when it began; the first and the last may reach beyond.
    pub spans: Vec<Span>,
    /// Pictures displayed in between, by when they were.
    pub pictures: Vec<PictureTimes>,
}

impl Recording {
    /// What `collector` has of the time from `begin` until `end`. Where it has forgotten the beginning, that is when what it
    /// still knows begins.
    #[must_use]
    pub fn new(collector: &Collector, begin: Instant, end: Instant) -> Self {
        let begin = collector
            .known_since()
            .map_or(begin, |known| begin.max(known));
        let end = end.max(begin);
        Self::of(collector.spans(), collector.pictures(), begin, end)
    }

    /// The same for the newest time alone: looks no further back than twice as far as from `end` to `begin`, and so costs the
    /// same however much was recorded before. Lanes that fell silent for longer than that in between may be missed.
    #[must_use]
    pub fn newest(collector: &Collector, begin: Instant, end: Instant) -> Self {
        let begin = collector
            .known_since()
            .map_or(begin, |known| begin.max(known));
        let end = end.max(begin);
        // Spans come lane by lane, not strictly by time.
        let oldest = begin.checked_sub(end - begin).unwrap_or(begin);
        Self::of(
            collector
                .spans()
                .rev()
                .take_while(|span| span.end >= oldest),
            collector
                .pictures()
                .rev()
                .take_while(|picture| picture.displayed >= oldest),
            begin,
            end,
        )
    }

    fn of<'a>(
        spans: impl Iterator<Item = &'a Span>,
        pictures: impl Iterator<Item = &'a PictureTimes>,
        begin: Instant,
        end: Instant,
    ) -> Self {
        let within = |at: Instant| (begin..=end).contains(&at);
        let mut spans: Vec<Span> = spans
            .filter(|span| span.begin <= end && (span.end > begin || span.begin == begin))
            .copied()
            .collect();
        spans.sort_by_key(|span| (span.begin, span.lane));
        let mut pictures: Vec<PictureTimes> = pictures
            .filter(|picture| within(picture.displayed))
            .copied()
            .collect();
        pictures.sort_by_key(|picture| (picture.displayed, picture.number));
        Self {
            begin,
            end,
            spans,
            pictures,
        }
    }

    /// How long was measured, seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        (self.end - self.begin).as_secs_f64()
    }
}

/// From `from` to `to` in nanoseconds; negative if `to` is earlier.
#[must_use]
pub fn nanoseconds(from: Instant, to: Instant) -> i64 {
    let signed = |from, to: Instant| {
        i64::try_from(to.saturating_duration_since(from).as_nanos()).unwrap_or(i64::MAX)
    };
    if to >= from {
        signed(from, to)
    } else {
        -signed(to, from)
    }
}

/// Nanoseconds in milliseconds.
pub(crate) fn ms(nanoseconds: i64) -> f64 {
    nanoseconds as f64 / 1e6
}
