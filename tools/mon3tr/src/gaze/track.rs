//! A file of gaze samples, as eye trackers export them.
//!
//! One [sample](super::sample) a line, with or without a heading. Seconds count from the first picture and grow from line to line. Empty lines,
//! and those that begin with #, say nothing.

use super::sample::{Sample, is_heading, read};
use anyhow::{Context, ensure};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::time::Duration;

/// Largest file: two hours of a tracker of 500 samples a second.
const MOST_BYTES: u64 = 256 << 20;

/// Samples with a gaze, by time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Track {
    samples: Vec<(f64, Sample)>,
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
        let mut samples: Vec<(f64, Sample)> = Vec::new();
        let mut last = f64::NEG_INFINITY;
        let mut is_first = true;
        for (number, line) in (1u64..).zip(text.split(|byte| *byte == b'\n')) {
            if is_first && is_heading(line) {
                is_first = false;
                continue;
            }
            let Some((seconds, sample)) = read(line).with_context(|| format!("line {number}"))?
            else {
                continue;
            };
            is_first = false;
            ensure!(
                seconds > last,
                "line {number}: {seconds} s comes after {last} s: times have to grow"
            );
            last = seconds;
            samples.extend(sample.map(|sample| (seconds, sample)));
        }
        ensure!(
            !samples.is_empty(),
            "it holds no gaze: lines are seconds,x,y with x and y from 0 to 1"
        );
        Ok(Self { samples })
    }

    /// Where is looked so long after the first picture; nowhere once the last gaze is older than a blink, or the last view than a stumble.
    pub(super) fn at(&self, since_first: Duration) -> Option<Sample> {
        let now = since_first.as_secs_f64();
        let later = (self.samples).partition_point(|(seconds, _)| *seconds <= now);
        let (seconds, sample) = self.samples.get(later.checked_sub(1)?)?;
        (now - seconds <= sample.lasts().as_secs_f64()).then_some(*sample)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample::LineOfSight;
    use super::*;
    use glam::Vec3;

    fn at(track: &Track, seconds: f64) -> Option<Sample> {
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
            samples: [(0.0, [0.5, 0.5]), (0.02, [0.25, 1.0]), (0.06, [0.0, 1.0])]
                .map(|(seconds, place)| (seconds, Sample::At(place)))
                .to_vec(),
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
        assert_eq!(
            at(&track, 1.0),
            Some(Sample::At([0.1, 0.2])),
            "at the first"
        );
        assert_eq!(at(&track, 1.35), Some(Sample::At([0.1, 0.2])), "in a blink");
        assert_eq!(at(&track, 1.5), None, "eyes shut for longer");
        assert_eq!(at(&track, 1.9), Some(Sample::At([0.3, 0.4])), "after it");
        assert_eq!(at(&track, 1e9), None, "long after the last");
    }

    #[test]
    fn a_headsets_views_are_read_and_held_for_longer_than_a_blink() {
        let text = concat!(
            "{\"seconds\": 1, \"eye\": [0, 1.6, 2], \"towards\": [0, 1.6, 1]}\n",
            "{\"seconds\": 9, \"eye\": [0, 1.6, 2], \"towards\": [3, 5.6, 2], \"roll\": 0}\n",
        );
        let track = Track::parse(text.as_bytes()).expect("views");
        let view = |x, y, z| {
            Some(Sample::From(LineOfSight {
                eye: Vec3::new(0.0, 1.6, 2.0),
                direction: Vec3::new(x, y, z),
            }))
        };
        assert_eq!(at(&track, 2.9), view(0.0, 0.0, -1.0), "held");
        assert_eq!(at(&track, 3.1), None, "for no longer");
        assert_eq!(at(&track, 9.0), view(0.6, 0.8, 0.0), "the next");
    }

    #[test]
    fn what_is_no_gaze_is_refused_with_its_line() {
        let cases: [(&str, &str); 24] = [
            ("0,0.5,0.5\n0.1,nan,0.5", "line 2: x is NaN"),
            ("0,0.5,0.5\n0.1,0.5,inf", "line 2: y is inf"),
            ("\n\nnan,0.5,0.5", "line 3: NaN is no time"),
            ("inf,0.5,0.5", "line 1: inf is no time"),
            ("-1,0.5,0.5", "line 1: -1 is no time"),
            ("1,0.5,0.5\n0.5,0.5,0.5", "line 2: 0.5 s comes after 1 s"),
            ("1,,\n1,0.5,0.5", "line 2: 1 s comes after 1 s"),
            ("0,960,540", "line 1: x is 960, far from the picture"),
            ("0,0.5", "line 1: 0,0.5 is not seconds,x,y"),
            ("0,0.5,0.5,0.5", "line 1: 0,0.5,0.5,0.5 is not seconds,x,y"),
            ("0,0.5,", "line 1: x and y are there or missing together"),
            ("time,gx,gy\n0,0.5,0.5", "line 1: time is no number"),
            ("0,0.5,0.5\nseconds,x,y", "line 2: seconds is no number"),
            ("{\"seconds\":0,\"x\":0.5}", "line 1: it is no {"),
            ("{\"seconds\":0,\"x\":1e999,\"y\":0}", "line 1: it is no {"),
            ("{", "line 1: it is no {"),
            (
                "{\"seconds\":0,\"eye\":[0,0,0],\"towards\":[0,0,0]}",
                "line 1: eye and towards are one place",
            ),
            (
                "{\"seconds\":0,\"eye\":[0,1600,0],\"towards\":[0,0,0]}",
                "line 1: eye is [0.0, 1600.0, 0.0], further than 1000 m",
            ),
            (
                "{\"seconds\":0,\"eye\":[0,1],\"towards\":[0,0,0]}",
                "line 1: it is no {",
            ),
            (
                "{\"seconds\":0,\"eye\":[0,1,null],\"towards\":[0,0,0]}",
                "line 1: it is no {",
            ),
            ("{\"seconds\":0,\"eye\":[0,1,0]}", "line 1: it is no {"),
            (
                "{\"seconds\":-1,\"eye\":[0,1,0],\"towards\":[0,0,0]}",
                "line 1: -1 is no time",
            ),
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
        let words: [&[u8]; 16] = [
            b"0",
            b"1.5",
            b",",
            b",",
            b"\n",
            b"{",
            b"}",
            b"\"x\":",
            b"nan",
            b"-",
            b"e9",
            b" ",
            b"\xc3",
            b"#",
            b"{\"seconds\":1,\"eye\":[0,1.6,",
            b"2],\"towards\":[0,1.5,0]}",
        ];
        for _ in 0..20_000 {
            let text: Vec<u8> = (0..random.usize(0..24))
                .flat_map(|_| words[random.usize(0..words.len())])
                .copied()
                .collect();
            if let Ok(track) = Track::parse(&text) {
                let times = track.samples.windows(2);
                assert!(times.into_iter().all(|two| two[0].0 < two[1].0), "{text:?}");
                let within = |(_, sample): &(f64, Sample)| match sample {
                    Sample::At(place) => place.iter().all(|share| (0.0..=1.0).contains(share)),
                    Sample::From(view) => view.direction.is_normalized(),
                };
                assert!(track.samples.iter().all(within), "{text:?}");
            }
        }
    }

    #[test]
    fn a_line_of_sight_that_is_cut_or_changed_is_read_in_bounds_or_refused() {
        let line = b"{\"seconds\":12.5,\"eye\":[0.25,1.6,2],\"towards\":[0,-1.5e0,0]}";
        let mut random = fastrand::Rng::with_seed(5);
        let mut read = 0;
        for round in 0..20_000 {
            let mut text = line.to_vec();
            if round < line.len() {
                text.truncate(round);
            }
            for _ in 0..random.usize(1..4) {
                if let Some(byte) = random.choice(text.iter_mut()) {
                    *byte = random.u8(b' '..=b'~');
                }
            }
            let Ok(track) = Track::parse(&text) else {
                continue;
            };
            for (_, sample) in &track.samples {
                let Sample::From(sight) = sample else {
                    panic!("{sample:?}");
                };
                assert!(sight.direction.is_normalized(), "{sample:?}");
                assert!(sight.eye.abs().max_element() <= 1_000.0, "{sample:?}");
                read += 1;
            }
        }
        assert!(read > 200, "some of it stays a line: {read}");
    }
}
