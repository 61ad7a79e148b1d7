//! The report as text, at most 100 columns wide.

use std::fmt;

use super::{CallRow, Report};

const WIDTH: usize = 100;
const COLUMNS: [&str; 11] = [
    "condition",
    "codec",
    "channel",
    "down",
    "up",
    "p50",
    "p95",
    "p99",
    "frames",
    "lost",
    "recover",
];
const UNITS: [&str; 11] = [
    "", "", "", "kbit/s", "kbit/s", "ms", "ms", "ms", "", "%", "s",
];
/// The first so many columns are words and stand left; figures stand right.
const WORDS: usize = 3;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.title.is_empty() {
            for line in wrap(&self.title, WIDTH) {
                writeln!(f, "{line}")?;
            }
            writeln!(f)?;
        }
        let mut rows = vec![COLUMNS.map(str::to_owned), UNITS.map(str::to_owned)];
        let mut previous = None;
        for call in &self.calls {
            // A condition is said once, above its calls.
            let condition = if previous == Some(&call.condition) {
                String::new()
            } else {
                call.condition.clone()
            };
            previous = Some(&call.condition);
            rows.push(cells(call, condition));
        }
        let mut widths = [0; 11];
        for row in &rows {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = (*width).max(cell.chars().count());
            }
        }
        // Long conditions are wrapped over several lines.
        let others: usize = widths.iter().skip(1).sum::<usize>() + 2 * (COLUMNS.len() - 1);
        let [condition_width, ..] = &mut widths;
        *condition_width = (*condition_width).min(WIDTH.saturating_sub(others).max(9));
        let condition_width = *condition_width;

        for (index, row) in rows.iter().enumerate() {
            let [condition, rest @ ..] = row;
            if index == 2 || (index > 2 && !condition.is_empty()) {
                let total = condition_width + others;
                writeln!(f, "{}", "-".repeat(total.min(WIDTH)))?;
            }
            let mut lines = wrap(condition, condition_width).into_iter();
            let mut text = pad(&lines.next().unwrap_or_default(), condition_width);
            for (column, (cell, &width)) in rest.iter().zip(widths.iter().skip(1)).enumerate() {
                let cell = if column + 1 < WORDS {
                    pad(cell, width)
                } else {
                    format!("{cell:>width$}")
                };
                text.push_str("  ");
                text.push_str(&cell);
            }
            writeln!(f, "{}", text.trim_end())?;
            for more in lines {
                writeln!(f, "{more}")?;
            }
        }
        self.write_voices(f)?;
        if !self.notes.is_empty() {
            writeln!(f)?;
        }
        for note in &self.notes {
            for line in wrap(note, WIDTH) {
                writeln!(f, "{line}")?;
            }
        }
        Ok(())
    }
}

impl Report {
    /// A table of the calls with a voice.
    fn write_voices(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let voices = self
            .calls
            .iter()
            .filter_map(|call| Some((call, call.voice?)));
        for (number, (call, voice)) in voices.enumerate() {
            if number == 0 {
                writeln!(
                    f,
                    "\n{:<44}  {:>13}  {:>9}  {:>8}  {:>13}",
                    "voice", "mouth to ear", "concealed", "gap", "heard and seen"
                )?;
                writeln!(
                    f,
                    "{:<44}  {:>6} {:>6}  {:>9}  {:>8}  {:>13}",
                    "", "p50 ms", "p95 ms", "%", "ms", "apart p95 ms"
                )?;
            }
            let of = |times: Option<super::LatencyMs>, at: fn(super::LatencyMs) -> f64| {
                times.map_or_else(|| "-".to_owned(), |times| format!("{:.1}", at(times)))
            };
            let ear = voice.mouth_to_ear_ms;
            writeln!(
                f,
                "{:<44}  {:>6} {:>6}  {:>9.1}  {:>8}  {:>13}",
                format!("{}, {}", call.condition, call.variant()),
                of(ear, |ear| ear.p50),
                of(ear, |ear| ear.p95),
                voice.concealed_percent(),
                voice.longest_gap_ms,
                of(voice.apart_ms, |apart| apart.p95),
            )?;
        }
        Ok(())
    }
}

fn cells(call: &CallRow, condition: String) -> [String; 11] {
    let latency = |of: fn(&super::LatencyMs) -> f64| {
        call.latency_ms
            .as_ref()
            .map_or_else(|| "-".to_owned(), |l| format!("{:.1}", of(l)))
    };
    [
        condition,
        call.codec.clone(),
        call.channel.clone(),
        format!("{:.1}", call.down_kbit_s),
        format!("{:.1}", call.up_kbit_s),
        latency(|l| l.p50),
        latency(|l| l.p95),
        latency(|l| l.p99),
        call.frames.sent.to_string(),
        format!("{:.2}", call.frames.lost_percent()),
        call.recover_s
            .map_or_else(|| "-".to_owned(), |s| format!("{s:.2}")),
    ]
}

fn pad(text: &str, width: usize) -> String {
    format!("{text:<width$}")
}

/// Breaks between words; a word that is too long stays whole.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        if let Some(line) = lines.last_mut() {
            let taken = line.chars().count();
            if taken == 0 {
                line.push_str(word);
            } else if taken + 1 + word.chars().count() <= width {
                line.push(' ');
                line.push_str(word);
            } else {
                lines.push(word.to_owned());
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use crate::report::samples;

    #[test]
    fn a_voice_has_a_line_of_its_own() {
        let mut report = samples::report();
        assert!(
            !report.to_string().contains("mouth to ear"),
            "without a voice"
        );
        let times = |p50, p95| crate::report::LatencyMs {
            p50,
            p95,
            p99: 99.9,
        };
        report.calls[3].voice = Some(crate::report::VoiceRow {
            mouth_to_ear_ms: Some(times(61.2, 83.4)),
            apart_ms: Some(times(5.0, 12.3)),
            heard: 480,
            recovered: 8,
            concealed: 12,
            longest_gap_ms: 40,
        });
        let table = report.to_string();
        let line = table
            .lines()
            .find(|line| line.contains("83.4"))
            .expect("its line");
        let cells: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(
            cells,
            [
                "clean,",
                "compact,",
                "unreliable",
                "61.2",
                "83.4",
                "2.4",
                "40",
                "12.3"
            ],
            "{table}"
        );
    }

    #[test]
    fn the_table_is_aligned_and_at_most_a_hundred_columns() {
        let mut report = samples::report();
        let text = report.to_string();
        println!("{text}");
        assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
        let ends: Vec<usize> = text
            .lines()
            .filter(|l| l.contains("reliable"))
            .map(|l| l.chars().count())
            .collect();
        assert!(
            ends.len() == 16 && ends.windows(2).all(|w| w[0] == w[1]),
            "the last figures end in one column: {ends:?}"
        );
        // A condition that says everything takes more lines, not more columns.
        report.calls[0].condition = "20 ms +-5 ms, 5 % lost in bursts, 0.5 % twice, trace traces/lte-walk.csv, out for 3 s at 10 s".into();
        let text = report.to_string();
        assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
        assert!(
            text.contains("out for"),
            "and nothing of it is lost: {text}"
        );
    }

    #[test]
    fn a_call_without_frames_has_no_latency() {
        let mut report = samples::report();
        report.calls.truncate(1);
        report.calls[0].latency_ms = None;
        report.calls[0].frames.shown = 0;
        let text = report.to_string();
        let row = text.lines().find(|l| l.contains("reliable"));
        let words: Vec<&str> = row.expect("its row").split_whitespace().collect();
        assert_eq!(words[5..], ["-", "-", "-", "1800", "100.00", "-"], "{text}");
    }
}
