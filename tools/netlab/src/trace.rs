//! Bandwidth traces: the bandwidth of a real or imagined network over time, to be replayed (the paper, section VI-A, replays its with `tc`).
//!
//! A trace is CSV: `ms,kbit/s` a line, empty lines and lines that begin with `#` are nothing, and the first line may be a
//! heading. Each line's rate holds from its time to the next line's; the last one holds as long as the one before it (one second where it
//! stands alone). Then the trace begins again. 0 kbit/s is an outage: the link holds what it has and its queue fills.

use std::{path::Path, time::Duration};

use crate::{
    NetlabError,
    units::{NANOS_PER_SECOND, from_nanos, whole_bits},
};

const NANOS_PER_MS: u128 = 1_000_000;

/// A bandwidth over time that repeats, never zero throughout.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trace {
    name: String,
    segments: Vec<Segment>,
    /// In nanoseconds.
    period: u128,
    /// What goes through in one period, in bit * 10^-9.
    capacity: u128,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Segment {
    /// In nanoseconds since the trace's beginning.
    start: u128,
    end: u128,
    bits_per_second: u128,
}

impl Trace {
    /// Reads a trace from a file.
    ///
    /// # Errors
    /// [`NetlabError::ReadTrace`], [`NetlabError::Trace`].
    pub fn read(path: &Path) -> Result<Self, NetlabError> {
        let name = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&name, &text),
            Err(source) => Err(NetlabError::ReadTrace {
                trace: name,
                source,
            }),
        }
    }

    /// Reads a trace from text; the name is for messages.
    ///
    /// # Errors
    /// [`NetlabError::Trace`].
    pub fn parse(name: &str, text: &str) -> Result<Self, NetlabError> {
        let at = |line: usize, why: String| NetlabError::Trace {
            trace: name.to_owned(),
            line,
            why,
        };
        let mut rows: Vec<(u128, u64)> = Vec::new();
        let mut may_be_heading = true;
        for (index, raw) in text.lines().enumerate() {
            let line = index + 1;
            let row = raw.trim().trim_start_matches('\u{feff}');
            if row.is_empty() || row.starts_with('#') {
                continue;
            }
            let fields: Vec<&str> = row.split(',').map(str::trim).collect();
            let &[ms, kbit_s] = fields.as_slice() else {
                let why = format!("{} fields where there should be two", fields.len());
                return Err(at(line, why));
            };
            let is_heading = may_be_heading && ms.starts_with(|c: char| c.is_ascii_alphabetic());
            may_be_heading = false;
            if is_heading {
                continue;
            }
            let ms: u64 = ms.parse().map_err(|_| {
                at(
                    line,
                    format!("`{ms}` is not a whole number of milliseconds"),
                )
            })?;
            let bits =
                kbit_s.parse().ok().and_then(whole_bits).ok_or_else(|| {
                    at(line, format!("`{kbit_s}` is not a rate of 0 to 1e9 kbit/s"))
                })?;
            match rows.last() {
                None if ms != 0 => {
                    return Err(at(line, format!("the first time is {ms} ms")));
                }
                Some(&(before, _)) if u128::from(ms) * NANOS_PER_MS <= before => {
                    return Err(at(
                        line,
                        format!("{ms} ms does not come after the line before"),
                    ));
                }
                _ => rows.push((u128::from(ms) * NANOS_PER_MS, bits)),
            }
        }
        Self::from_rows(name, &rows).ok_or_else(|| {
            at(
                text.lines().count().max(1),
                "the trace lets nothing through".to_owned(),
            )
        })
    }

    fn from_rows(name: &str, rows: &[(u128, u64)]) -> Option<Self> {
        let &(last, _) = rows.last()?;
        let last_holds = rows
            .iter()
            .rev()
            .nth(1)
            .map_or(NANOS_PER_SECOND, |&(before, _)| last - before);
        let ends = rows
            .iter()
            .skip(1)
            .map(|&(start, _)| start)
            .chain([last + last_holds]);
        let segments: Vec<Segment> = rows
            .iter()
            .zip(ends)
            .map(|(&(start, bits), end)| Segment {
                start,
                end,
                bits_per_second: u128::from(bits),
            })
            .collect();
        let capacity = segments
            .iter()
            .map(|s| (s.end - s.start) * s.bits_per_second)
            .sum();
        (capacity > 0).then(|| Self {
            name: name.to_owned(),
            segments,
            period: last + last_holds,
            capacity,
        })
    }

    /// What the caller called it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The length of one period.
    pub fn period(&self) -> Duration {
        from_nanos(self.period)
    }

    /// Its mean rate in kbit/s.
    pub fn mean_kbit_s(&self) -> f64 {
        self.capacity as f64 / self.period as f64 / 1000.0
    }

    /// The rate at a time since the trace's beginning, in kbit/s.
    pub fn kbit_s_at(&self, time: Duration) -> f64 {
        let time = time.as_nanos() % self.period;
        self.segments
            .iter()
            .find(|s| time < s.end)
            .map_or(0.0, |s| s.bits_per_second as f64 / 1000.0)
    }

    /// When a packet of so many bytes whose transmission begins at `start` has left, rounded up to the nanosecond.
    pub(crate) fn finish(&self, start: Duration, bytes: u64) -> Duration {
        let mut work = u128::from(bytes) * 8 * NANOS_PER_SECOND;
        if work == 0 {
            return start;
        }
        let mut within = start.as_nanos() % self.period;
        // Whole periods at once; the rest (at least something) is walked, so that the end lies where the last bit leaves.
        let whole = (work - 1) / self.capacity;
        work -= whole * self.capacity;
        let mut lap = start.as_nanos() - within + whole * self.period;
        loop {
            for segment in self.segments.iter().filter(|s| s.end > within) {
                let from = segment.start.max(within);
                let room = (segment.end - from) * segment.bits_per_second;
                if room >= work {
                    return from_nanos(lap + from + work.div_ceil(segment.bits_per_second));
                }
                work -= room;
            }
            within = 0;
            lap += self.period;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Trace {
        Trace::parse("t", text).expect("a good trace")
    }

    fn refusal(text: &str) -> String {
        Trace::parse("bad.csv", text)
            .expect_err("a bad trace")
            .to_string()
    }

    #[test]
    fn a_trace_is_read_with_heading_comments_and_blank_lines() {
        let trace = parse("# made up\nms,kbit/s\n\n0,1000\n500, 250.5\r\n# more\n1500,0\n");
        assert_eq!(
            trace.period(),
            Duration::from_millis(2500),
            "the last line holds as long as the one before"
        );
        for (ms, kbit_s) in [
            (0, 1000.0),
            (499, 1000.0),
            (500, 250.5),
            (1500, 0.0),
            (2600, 1000.0),
        ] {
            assert_eq!(
                trace.kbit_s_at(Duration::from_millis(ms)),
                kbit_s,
                "at {ms} ms"
            );
        }
    }

    #[test]
    fn a_bad_trace_is_refused_with_its_line() {
        for (text, line, why) in [
            ("0,100\n10,abc\n", 2, "`abc` is not a rate"),
            ("0,100\n10,-5\n", 2, "`-5` is not a rate"),
            ("0,100\n10,NaN\n", 2, "`NaN` is not a rate"),
            ("0,100\n10,inf\n", 2, "`inf` is not a rate"),
            ("ms,kbit/s\nms,kbit/s\n0,1", 2, "`ms` is not a whole number"),
            ("# x\n\n1.5,100\n", 3, "`1.5` is not a whole number"),
            ("0,100\n20,1\n20,2\n", 3, "20 ms does not come after"),
            ("0,100,5\n", 1, "3 fields"),
            ("0\n", 1, "1 fields"),
            ("100,5\n", 1, "the first time is 100 ms"),
            ("0,0\n1000,0\n", 2, "the trace lets nothing through"),
            ("", 1, "the trace lets nothing through"),
        ] {
            let said = refusal(text);
            assert!(
                said.starts_with(&format!("bad.csv, line {line}: {why}")),
                "{text:?} gave {said}"
            );
        }
    }

    #[test]
    fn packets_leave_when_a_slow_simulation_says_so() {
        // Independent: a walk in steps of a microsecond, in f64.
        let trace = parse("0,800\n3,0\n5,80\n9,1600\n");
        let rate = |us: u64| match us / 1000 % 13 {
            0..=2 => 0.8,
            3..=4 => 0.0,
            5..=8 => 0.08,
            _ => 1.6_f64, // bits per microsecond
        };
        for start in (0..40_000).step_by(1370) {
            for bytes in [1, 28, 400, 1500, 9000] {
                let mut left = bytes as f64 * 8.0;
                let mut now = start;
                while left > 1e-6 {
                    left -= rate(now);
                    now += 1;
                }
                let got = trace.finish(Duration::from_micros(start), bytes);
                let off = got.as_secs_f64() * 1e6 - now as f64;
                assert!(
                    (-1.001..=0.001).contains(&off),
                    "{bytes} B from {start} us leave {off} us apart"
                );
            }
        }
    }

    #[test]
    fn a_tiny_capacity_is_computed_without_a_long_loop() {
        // One bit a lap of a day less a millisecond: the 8000th leaves at the end of the 8000th lap's first millisecond.
        let trace = parse("0,1\n1,0\n43200000,0\n");
        assert_eq!(trace.period(), Duration::from_millis(86_399_999), "the lap");
        assert_eq!(
            trace.finish(Duration::ZERO, 1000),
            Duration::from_millis(86_399_999 * 7999 + 1),
            "8000 bits"
        );
    }
}
