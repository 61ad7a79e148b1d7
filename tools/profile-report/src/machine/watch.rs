//! The thread that reads samplers while something is measured.

use super::{MachineFigures, Sampler};
use std::io;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two samples: heat is slow, and a hundred sensors take some milliseconds to read.
pub const EVERY: Duration = Duration::from_millis(500);

/// Most samples kept, an hour's: the newest.
const MOST: usize = 7_200;

/// Samples and when they were taken.
type Taken = (Vec<Box<dyn Sampler>>, Vec<(Instant, Vec<Option<f64>>)>);

/// Samples from when it is made until it is finished.
#[derive(Debug)]
pub struct Watch {
    /// Dropped to end it.
    _stop: Sender<()>,
    thread: JoinHandle<Taken>,
}

impl Watch {
    /// Begins to read `samplers`, every so long ([`EVERY`] but for tests).
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start(samplers: Vec<Box<dyn Sampler>>, every: Duration) -> io::Result<Self> {
        let (_stop, stopped) = channel::<()>();
        let thread = std::thread::Builder::new()
            .name("machine".to_owned())
            .spawn(move || {
                let mut samplers = samplers;
                let mut taken = Vec::new();
                loop {
                    let mut values = Vec::new();
                    let at = Instant::now();
                    for sampler in &mut samplers {
                        sampler.sample(&mut values);
                    }
                    if taken.len() == MOST {
                        taken.remove(0);
                    }
                    taken.push((at, values));
                    if stopped.recv_timeout(every) != Err(RecvTimeoutError::Timeout) {
                        return (samplers, taken);
                    }
                }
            })?;
        Ok(Self { _stop, thread })
    }

    /// Ends it and returns what was sampled from `begin` to `end`.
    #[must_use]
    pub fn finish(self, begin: Instant, end: Instant) -> MachineFigures {
        drop(self._stop);
        let Ok((samplers, taken)) = self.thread.join() else {
            log::warn!("the thread that watches the machine panicked: its figures are lost");
            return MachineFigures::default();
        };
        let samples: Vec<(f64, Vec<Option<f64>>)> = taken
            .into_iter()
            .filter(|(at, _)| (begin..=end).contains(at))
            .map(|(at, values)| (at.duration_since(begin).as_secs_f64(), values))
            .collect();
        MachineFigures::new(&samplers, &samples)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Absent, Channel, Quantity};
    use super::*;

    /// Counts up; every other time its second channel cannot be read, and its third never.
    struct Counter([Channel; 3], f64);

    impl Counter {
        fn new() -> Self {
            let channel = |name: &str| Channel {
                name: name.to_owned(),
                quantity: Quantity::Level,
            };
            Self(["steady", "now and then", "never"].map(channel), 0.0)
        }
    }

    impl Sampler for Counter {
        fn channels(&self) -> &[Channel] {
            &self.0
        }

        fn absent(&self) -> &[Absent] {
            &[]
        }

        fn sample(&mut self, values: &mut Vec<Option<f64>>) {
            self.1 += 1.0;
            values.extend([Some(self.1), (self.1 % 2.0 == 0.0).then_some(self.1), None]);
        }
    }

    #[test]
    fn series_have_a_value_or_a_gap_for_every_time_and_what_never_came_is_absent() {
        let begin = Instant::now();
        let samplers: Vec<Box<dyn Sampler>> = vec![Box::new(Counter::new())];
        let watch = Watch::start(samplers, Duration::from_millis(1)).expect("a thread");
        std::thread::sleep(Duration::from_millis(50));
        let figures = watch.finish(begin, Instant::now());
        let [steady, now_and_then] = figures.series.as_slice() else {
            panic!("{figures:?}");
        };
        assert!(figures.at_s.len() > 2, "it sampled");
        assert!(figures.at_s.is_sorted(), "in order: {:?}", figures.at_s);
        for series in [steady, now_and_then] {
            assert_eq!(series.values.len(), figures.at_s.len(), "{series:?}");
        }
        assert_eq!(steady.least, 1.0, "the first");
        assert_eq!(steady.most, figures.at_s.len() as f64, "the last");
        assert_eq!(steady.mean, (steady.least + steady.most) / 2.0, "by ones");
        assert_eq!(now_and_then.values[..2], [None, Some(2.0)], "a gap");
        let [never] = figures.absent.as_slice() else {
            panic!("{:?}", figures.absent);
        };
        assert_eq!(never.what, "never", "{never:?}");
    }

    #[test]
    fn samples_before_and_after_the_measurement_are_left_out() {
        let samplers: Vec<Box<dyn Sampler>> = vec![Box::new(Counter::new())];
        let watch = Watch::start(samplers, Duration::from_millis(1)).expect("a thread");
        std::thread::sleep(Duration::from_millis(10));
        let later = Instant::now() + Duration::from_secs(3600);
        let figures = watch.finish(later, later);
        assert_eq!(
            (figures.at_s.len(), figures.series.len()),
            (0, 0),
            "{figures:?}"
        );
    }
}
