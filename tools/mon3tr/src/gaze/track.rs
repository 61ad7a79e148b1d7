//! A file of gaze samples, as eye trackers export them.
//!
//! One sample a line, either `seconds,x,y` (CSV, with or without that line as a heading) or
//! `{"seconds": 0.5, "x": 0.4, "y": 0.6}` (JSON lines, which may say more). Seconds count from the first picture and grow from
//! line to line; x goes to the right and y down, 0 to 1 over the picture. Trackers also see eyes a little beyond the picture,
//! which counts as its edge. While the eyes are shut there are no samples, or samples without x and y (empty, or null). Empty
//! lines, and those that begin with #, say nothing.

use super::{BLINK, Place};
use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Deserializer};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::time::Duration;

/// Largest file: two hours of a tracker of 500 samples a second.
const MOST_BYTES: u64 = 256 << 20;

/// How far beyond the picture a gaze may lie, in its widths: further out it is something else than a share of the picture.
const BEYOND: f64 = 1.0;

/// Samples with a gaze, by time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Track {
    samples: Vec<(f64, Place)>,
}

/// A sample as it is read.
#[derive(Debug, Deserialize)]
struct Sample {
    seconds: f64,
    // Not there at all is a mistake; null is an eye that is shut.
    #[serde(deserialize_with = "nullable")]
    x: Option<f64>,
    #[serde(deserialize_with = "nullable")]
    y: Option<f64>,
}

fn nullable<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    Option::deserialize(deserializer)
}

impl Track {
    /// Reads a file.
    ///
    /// # Errors
    /// If there is none, or a line is no sample; the line is named.
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let text = || -> anyhow::Result<Vec<u8>> {
            let mut text = Vec::new();
            BufReader::new(File::open(path)?)
                .take(MOST_BYTES + 1)
                .read_to_end(&mut text)?;
            Ok(text)
        };
        text()
            .and_then(|text| Self::parse(&text))
            .with_context(|| format!("cannot use the gaze {}", path.display()))
    }

    fn parse(text: &[u8]) -> anyhow::Result<Self> {
        ensure!(
            text.len() as u64 <= MOST_BYTES,
            "it is larger than {} MB: shorten it",
            MOST_BYTES >> 20
        );
        let text = text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(text);
        let mut samples: Vec<(f64, Place)> = Vec::new();
        let mut last = None;
        let mut is_first = true;
        for (number, line) in (1u64..).zip(text.split(|byte| *byte == b'\n')) {
            let sample =
                read_line(line, &mut is_first, last).with_context(|| format!("line {number}"))?;
            if let Some((seconds, place)) = sample {
                last = Some(seconds);
                samples.extend(place.map(|place| (seconds, place)));
            }
        }
        ensure!(
            !samples.is_empty(),
            "it holds no gaze: lines are seconds,x,y with x and y from 0 to 1"
        );
        Ok(Self { samples })
    }

    /// Where the viewer looks so long after the first picture; nowhere once the last gaze is older than a blink.
    pub(super) fn at(&self, since_first: Duration) -> Option<Place> {
        let now = since_first.as_secs_f64();
        let later = (self.samples).partition_point(|(seconds, _)| *seconds <= now);
        let (seconds, place) = self.samples.get(later.checked_sub(1)?)?;
        (now - seconds <= BLINK.as_secs_f64()).then_some(*place)
    }
}

/// A line's time and gaze, which comes after that of the `last` one; nothing for a line that says nothing. Only the first that says
/// something may be a heading.
fn read_line(
    line: &[u8],
    is_first: &mut bool,
    last: Option<f64>,
) -> anyhow::Result<Option<(f64, Option<Place>)>> {
    let line = std::str::from_utf8(line).context("it is no text")?.trim();
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    if std::mem::take(is_first) && is_heading(line) {
        return Ok(None);
    }
    let sample = sample(line)?;
    Ok(Some((sample.seconds, place(&sample, last)?)))
}

fn is_heading(line: &str) -> bool {
    let names = line.split(',').map(|name| name.trim().trim_matches('"'));
    names
        .map(str::to_ascii_lowercase)
        .eq(["seconds", "x", "y"].map(str::to_owned))
}

/// A line as a sample, whatever its numbers are.
fn sample(line: &str) -> anyhow::Result<Sample> {
    if line.starts_with('{') {
        return serde_json::from_str(line).context("it is no {\"seconds\": S, \"x\": X, \"y\": Y}");
    }
    let fields: Vec<&str> = line.splitn(4, ',').map(str::trim).collect();
    let [seconds, x, y] = fields[..] else {
        bail!("it is not seconds,x,y: it has {} of them", fields.len());
    };
    let number = |text: &str| -> anyhow::Result<f64> {
        text.parse()
            .with_context(|| format!("{} is no number", shortened(text)))
    };
    let nullable = |text: &str| match text {
        "" => Ok(None),
        text => number(text).map(Some),
    };
    Ok(Sample {
        seconds: number(seconds)?,
        x: nullable(x)?,
        y: nullable(y)?,
    })
}

/// Checks a sample's numbers; nothing if the eyes are shut.
fn place(sample: &Sample, last: Option<f64>) -> anyhow::Result<Option<Place>> {
    let Sample { seconds, x, y } = *sample;
    ensure!(
        seconds.is_finite() && seconds >= 0.0,
        "{seconds} is no time: give seconds since the first picture"
    );
    if let Some(last) = last {
        ensure!(
            seconds > last,
            "{seconds} s comes after {last} s: times have to grow"
        );
    }
    let (x, y) = match (x, y) {
        (Some(x), Some(y)) => (x, y),
        (None, None) => return Ok(None),
        _ => bail!("x and y are there or missing together"),
    };
    for (name, value) in [("x", x), ("y", y)] {
        ensure!(
            value.is_finite(),
            "{name} is {value}: leave x and y empty while the eyes are shut"
        );
        ensure!(
            (-BEYOND..=1.0 + BEYOND).contains(&value),
            "{name} is {value}, far from the picture: x and y go from 0 to 1, not in pixels"
        );
    }
    #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
    let share = |value: f64| value.clamp(0.0, 1.0) as f32;
    Ok(Some([share(x), share(y)]))
}

/// As much of a text as an error may repeat.
fn shortened(text: &str) -> String {
    let most = 40;
    let mut short: String = text.chars().take(most).collect();
    if text.chars().nth(most).is_some() {
        short.push('\u{2026}');
    }
    short.escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(track: &Track, seconds: f64) -> Option<Place> {
        track.at(Duration::from_secs_f64(seconds))
    }

    #[test]
    fn both_formats_read_the_same() {
        let csv =
            "seconds,x,y\n# a tracker's\n0,0.5,0.5\r\n\n 0.02, 0.25 ,1\n0.04,,\n0.06,-0.2,1.3\n";
        let json = concat!(
            "{\"seconds\": 0, \"x\": 0.5, \"y\": 0.5, \"confidence\": 0.9}\n",
            "{\"seconds\": 0.02, \"x\": 0.25, \"y\": 1}\n",
            "{\"seconds\": 0.04, \"x\": null, \"y\": null}\n",
            "{\"seconds\": 0.06, \"x\": -0.2, \"y\": 1.3}",
        );
        let expected = Track {
            samples: vec![(0.0, [0.5, 0.5]), (0.02, [0.25, 1.0]), (0.06, [0.0, 1.0])],
        };
        for text in [csv.to_owned(), json.to_owned(), format!("\u{feff}{csv}")] {
            let read = Track::parse(text.as_bytes()).expect("samples");
            assert_eq!(read, expected, "{text}");
        }
    }

    #[test]
    fn a_blink_is_bridged_and_a_longer_gap_is_no_gaze() {
        let track = Track::parse(b"1,0.1,0.2\n1.3,,\n1.6,0.3,0.4\n").expect("samples");
        assert_eq!(at(&track, 0.9), None, "before the first");
        assert_eq!(at(&track, 1.0), Some([0.1, 0.2]), "at the first");
        assert_eq!(at(&track, 1.35), Some([0.1, 0.2]), "in a blink");
        assert_eq!(at(&track, 1.5), None, "eyes shut for longer");
        assert_eq!(at(&track, 1.9), Some([0.3, 0.4]), "after it");
        assert_eq!(at(&track, 1e9), None, "long after the last");
    }

    #[test]
    fn what_is_no_gaze_is_refused_with_its_line() {
        let cases: [(&str, &str); 18] = [
            ("0,0.5,0.5\n0.1,nan,0.5", "line 2: x is NaN"),
            ("0,0.5,0.5\n0.1,0.5,inf", "line 2: y is inf"),
            ("\n\nnan,0.5,0.5", "line 3: NaN is no time"),
            ("inf,0.5,0.5", "line 1: inf is no time"),
            ("-1,0.5,0.5", "line 1: -1 is no time"),
            ("1,0.5,0.5\n0.5,0.5,0.5", "line 2: 0.5 s comes after 1 s"),
            ("1,,\n1,0.5,0.5", "line 2: 1 s comes after 1 s"),
            ("0,960,540", "line 1: x is 960, far from the picture"),
            ("0,0.5", "line 1: it is not seconds,x,y"),
            ("0,0.5,0.5,0.5", "line 1: it is not seconds,x,y"),
            ("0,0.5,", "line 1: x and y are there or missing together"),
            ("time,gx,gy\n0,0.5,0.5", "line 1: time is no number"),
            ("0,0.5,0.5\nseconds,x,y", "line 2: seconds is no number"),
            ("{\"seconds\":0,\"x\":0.5}", "line 1: it is no {"),
            ("{\"seconds\":0,\"x\":1e999,\"y\":0}", "line 1: it is no {"),
            ("{", "line 1: it is no {"),
            ("# nothing\n", "it holds no gaze"),
            ("0,,\n1,,\n", "it holds no gaze"),
        ];
        for (text, expected) in cases {
            let error = format!("{:#}", Track::parse(text.as_bytes()).expect_err(text));
            assert!(error.contains(expected), "{text:?}: {error}");
        }
        let error = format!(
            "{:#}",
            Track::parse(b"0,0.5,0.5\n\xff\xfe").expect_err("no text")
        );
        assert!(error.contains("line 2: it is no text"), "{error}");
        let long = format!("0,0.5,0.5\n{}", "9a".repeat(1 << 20));
        let error = format!(
            "{:#}",
            Track::parse(long.as_bytes()).expect_err("one long line")
        );
        assert!(error.len() < 200, "a short line for a long one: {error}");
    }

    #[test]
    fn whatever_the_bytes_are_reading_them_ends_with_samples_in_order_or_an_error() {
        let mut random = fastrand::Rng::with_seed(3);
        let words: [&[u8]; 14] = [
            b"0", b"1.5", b",", b",", b"\n", b"{", b"}", b"\"x\":", b"nan", b"-", b"e9", b" ",
            b"\xc3", b"#",
        ];
        for _ in 0..20_000 {
            let text: Vec<u8> = (0..random.usize(0..24))
                .flat_map(|_| words[random.usize(0..words.len())])
                .copied()
                .collect();
            if let Ok(track) = Track::parse(&text) {
                let times = track.samples.windows(2);
                assert!(times.into_iter().all(|two| two[0].0 < two[1].0), "{text:?}");
                let within = |(_, place): &(f64, Place)| {
                    place.iter().all(|share| (0.0..=1.0).contains(share))
                };
                assert!(track.samples.iter().all(within), "{text:?}");
            }
        }
    }
}
