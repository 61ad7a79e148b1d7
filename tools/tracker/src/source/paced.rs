//! A recording in a camera's place: it plays at its own rate, and pictures that the caller is too late for are left out.

use std::fmt;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::error::SourceError;
use super::picture::{Picture, Source, SourceInfo};

/// Opens the recording from its start.
pub(super) type Again = Box<dyn FnMut() -> Result<Box<dyn Source>, SourceError> + Send>;

/// For so long a call leaves out pictures to catch up; then the recording goes on from where it is, because it is decoded more
/// slowly than it plays.
const LONGEST_CATCHING_UP: Duration = Duration::from_millis(500);

/// A pause in a recording is waited for up to this.
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

/// A recording that plays in real time.
pub(super) struct Paced {
    info: SourceInfo,
    again: Again,
    source: Box<dyn Source>,
    repeat: bool,
    /// When the picture at 0 seconds of this source was due.
    begun: Option<Instant>,
    /// The last picture's time, and the time to the one before it, in seconds.
    last: Option<f64>,
    period: f64,
    /// The only picture of this round so far, where it may be the only one of the recording: to be given again without opening
    /// the recording for each.
    only: Option<Picture>,
    /// Where this round of the recording starts, in seconds and pictures.
    round_seconds: f64,
    round_number: u64,
    next_number: u64,
    ended: bool,
}

impl fmt::Debug for Paced {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Paced")
            .field("info", &self.info)
            .finish_non_exhaustive()
    }
}

impl Paced {
    /// Opens the recording. It starts to play when its first picture is asked for, and again from its start at its end where
    /// `repeat` is set.
    pub(super) fn open(mut again: Again, repeat: bool) -> Result<Self, SourceError> {
        let source = again()?;
        let mut info = source.info().clone();
        if repeat {
            info.frames = None;
        }
        Ok(Self {
            period: info
                .rate_hz
                .filter(|rate| *rate > 0.0)
                .map_or(1.0 / 30.0, f64::recip),
            info,
            again,
            source,
            repeat,
            begun: None,
            last: None,
            only: None,
            round_seconds: 0.0,
            round_number: 0,
            next_number: 0,
            ended: false,
        })
    }

    /// The recording's next picture, as this source numbers and times it.
    fn read(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        if !self.source.next(into)? {
            // A recording without pictures would be opened for ever.
            if !self.repeat || self.next_number == self.round_number {
                return Ok(false);
            }
            self.round_number = self.next_number;
            self.round_seconds = self.last.unwrap_or(0.0) + self.period;
            if let Some(only) = &self.only {
                into.resize(only.width, only.height);
                into.rgb.copy_from_slice(&only.rgb);
                (into.number, into.seconds) = (0, 0.0);
            } else {
                self.source = (self.again)()?;
                if !self.source.next(into)? {
                    return Ok(false);
                }
            }
        } else if self.repeat && self.last.is_none() {
            self.only = Some(into.clone());
        } else {
            self.only = None;
        }
        into.number = self.round_number.saturating_add(into.number);
        into.seconds += self.round_seconds;
        self.next_number = into.number + 1;
        if let Some(last) = self.last {
            into.seconds = into.seconds.max(last);
            self.period = into.seconds - last;
        }
        self.last = Some(into.seconds);
        Ok(true)
    }
}

impl Source for Paced {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        if self.ended {
            return Ok(false);
        }
        self.ended = true;
        let called = Instant::now();
        loop {
            if !self.read(into)? {
                return Ok(false);
            }
            let offset = Duration::try_from_secs_f64(into.seconds).unwrap_or_default();
            let period = Duration::try_from_secs_f64(self.period).unwrap_or_default();
            let now = Instant::now();
            let begun = *self
                .begun
                .get_or_insert_with(|| now.checked_sub(offset).unwrap_or(now));
            let due = begun + offset;
            let late = now.saturating_duration_since(due);
            // Where it is later than that, the one after it is due already.
            if late > period {
                if now.duration_since(called) < LONGEST_CATCHING_UP {
                    continue;
                }
                self.begun = Some(begun + late);
                into.at = now;
            } else {
                let early = due.saturating_duration_since(now);
                if early > LONGEST_PAUSE {
                    self.begun = now.checked_sub(offset);
                    into.at = now;
                } else {
                    sleep(early);
                    into.at = due;
                }
            }
            self.ended = false;
            return Ok(true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pictures at given times in seconds, numbered.
    struct Times {
        info: SourceInfo,
        times: Vec<f64>,
        next: usize,
        decoding: Duration,
    }

    impl Source for Times {
        fn info(&self) -> &SourceInfo {
            &self.info
        }

        fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
            sleep(self.decoding);
            let Some(seconds) = self.times.get(self.next) else {
                return Ok(false);
            };
            (into.seconds, into.number) = (*seconds, self.next as u64);
            self.next += 1;
            Ok(true)
        }
    }

    fn paced(times: &[f64], repeat: bool) -> Paced {
        decoded_in(Duration::ZERO, times, repeat)
    }

    fn decoded_in(decoding: Duration, times: &[f64], repeat: bool) -> Paced {
        let times = times.to_vec();
        let again = move || -> Result<Box<dyn Source>, SourceError> {
            Ok(Box::new(Times {
                info: SourceInfo {
                    name: "times".to_owned(),
                    width: 1,
                    height: 1,
                    rate_hz: None,
                    frames: Some(times.len() as u64),
                },
                times: times.clone(),
                next: 0,
                decoding,
            }))
        };
        Paced::open(Box::new(again), repeat).expect("a source")
    }

    #[test]
    fn a_recording_plays_at_its_own_varying_rate() {
        let times = [0.0, 0.02, 0.10, 0.11, 0.25];
        let mut source = paced(&times, false);
        let mut picture = Picture::empty();
        let mut first = None;
        let mut seen = Vec::new();
        while source.next(&mut picture).expect("no error") {
            let first = *first.get_or_insert(picture.at);
            assert!(picture.at <= Instant::now(), "before it was due");
            let at = (picture.at - first).as_secs_f64();
            assert!(
                (at - picture.seconds).abs() < 1e-6,
                "{at} of {}",
                picture.seconds
            );
            seen.push(picture.number);
        }
        assert_eq!(seen.first(), Some(&0), "the first");
        assert!(seen.is_sorted_by(|a, b| a < b), "rising: {seen:?}");
    }

    #[test]
    fn a_slow_caller_misses_pictures_and_their_numbers() {
        let times: Vec<f64> = (0..40).map(|i| f64::from(i) * 0.01).collect();
        let mut source = paced(&times, false);
        let mut picture = Picture::empty();
        let mut seen = Vec::new();
        while source.next(&mut picture).expect("no error") {
            seen.push(picture.number);
            sleep(Duration::from_millis(60));
        }
        assert!(seen.len() <= 12, "{seen:?}");
        // Six were due meanwhile, and what is shown is up to one late.
        let missed = seen.is_sorted_by(|a, b| a + 5 <= *b);
        assert!(missed, "{seen:?}");
    }

    #[test]
    fn a_recording_that_decodes_too_slowly_is_still_seen() {
        let times: Vec<f64> = (0..60).map(|i| f64::from(i) * 0.01).collect();
        let mut source = decoded_in(Duration::from_millis(30), &times, false);
        let mut picture = Picture::empty();
        let mut seen = 0;
        while source.next(&mut picture).expect("no error") {
            seen += 1;
        }
        // 1.8 s, with one at least every 0.53 s.
        assert!(seen >= 3, "{seen} pictures");
        assert!(seen < 60, "it catches up");
    }

    #[test]
    fn a_repeated_recording_has_rising_times_and_numbers() {
        let mut source = paced(&[0.0, 0.004, 0.008], true);
        let mut picture = Picture::empty();
        let (mut number, mut seconds) = (0, -1.0);
        for _ in 0..8 {
            assert!(source.next(&mut picture).expect("no error"), "no end");
            assert!(
                picture.seconds > seconds && picture.number >= number,
                "rising"
            );
            (number, seconds) = (picture.number, picture.seconds);
        }
        assert!(
            (seconds - 0.004 * f64::from(u32::try_from(number).expect("few"))).abs() < 1e-9,
            "{seconds} at {number}"
        );
    }

    #[test]
    fn a_recording_of_one_picture_is_opened_once() {
        let opened = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
        let count = std::sync::Arc::clone(&opened);
        let again = move || -> Result<Box<dyn Source>, SourceError> {
            count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            Ok(Box::new(One(SourceInfo {
                name: "one".to_owned(),
                width: 2,
                height: 1,
                rate_hz: Some(500.0),
                frames: Some(1),
            })))
        };
        let mut source = Paced::open(Box::new(again), true).expect("it opens");
        let mut last = -1.0;
        for _ in 0..5 {
            // The caller may keep the buffer.
            let mut picture = Picture::empty();
            assert!(source.next(&mut picture).expect("no error"), "no end");
            assert_eq!(picture.rgb, [1, 2, 3, 4, 5, 6], "pixels");
            assert!(picture.seconds > last, "rising");
            last = picture.seconds;
        }
        assert_eq!(
            opened.load(std::sync::atomic::Ordering::Relaxed),
            1,
            "opened"
        );
    }

    /// One picture, once.
    struct One(SourceInfo);

    impl Source for One {
        fn info(&self) -> &SourceInfo {
            &self.0
        }

        fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
            let first = self.0.frames.take().is_some();
            if first {
                into.resize(2, 1);
                into.rgb.copy_from_slice(&[1, 2, 3, 4, 5, 6]);
                (into.number, into.seconds) = (0, 0.0);
            }
            Ok(first)
        }
    }

    #[test]
    fn a_recording_without_pictures_ends_also_where_it_repeats() {
        let mut source = paced(&[], true);
        assert!(
            !source.next(&mut Picture::empty()).expect("no error"),
            "the end"
        );
    }
}
