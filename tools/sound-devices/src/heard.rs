//! What a microphone's thread heard, for the thread that takes it: the newest second.

use crate::RATE;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Samples that may wait: what is older is of no use in a call.
const WAITING: usize = RATE as usize;

/// Samples that wait to be taken.
#[derive(Debug, Default)]
pub(crate) struct Heard {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    samples: VecDeque<f32>,
    /// When the one after the newest of them is in the air.
    end: Option<Instant>,
}

impl Heard {
    /// Takes samples in, and drops what has waited for more than a second. `end` is when the one after the last of them is in the air.
    pub(crate) fn put(&self, samples: &[f32], end: Instant) {
        let mut waiting = self.lock();
        let sound = samples.iter().map(|sample| {
            if sample.is_finite() {
                sample.clamp(-1.0, 1.0)
            } else {
                0.0
            }
        });
        waiting.samples.extend(sound);
        waiting.end = Some(end);
        let late = waiting.samples.len().saturating_sub(WAITING);
        waiting.samples.drain(..late);
        self.changed.notify_all();
    }

    /// Forgets what waits.
    pub(crate) fn clear(&self) {
        self.lock().samples.clear();
    }

    /// Waits for as many samples as `out` takes, at most a second's, for `longest` at most; when the first of them was in the air.
    pub(crate) fn take(&self, out: &mut [f32], longest: Duration) -> Option<Instant> {
        let waiting = self
            .changed
            .wait_timeout_while(self.lock(), longest, |waiting| {
                waiting.samples.len() < out.len()
            });
        let (mut waiting, _) = waiting.unwrap_or_else(PoisonError::into_inner);
        let length = waiting.samples.len();
        let end = waiting.end?;
        if length < out.len() {
            return None;
        }
        let taken = waiting.samples.drain(..out.len());
        for (out, sample) in out.iter_mut().zip(taken) {
            *out = sample;
        }
        let before = Duration::from_secs_f64(length as f64 / f64::from(RATE));
        Some(end.checked_sub(before).unwrap_or(end))
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: Duration = Duration::from_millis(5);

    fn after(begun: Instant, samples: u32) -> Instant {
        begun + Duration::from_secs_f64(f64::from(samples) / f64::from(RATE))
    }

    #[test]
    fn samples_are_taken_in_their_order_with_the_time_of_the_first() {
        let (heard, begun) = (Heard::default(), Instant::now());
        let mut out = [0.0; 3];
        assert_eq!(heard.take(&mut out, SHORT), None, "nothing yet");
        heard.put(&[0.1, 0.2], after(begun, 2));
        assert_eq!(heard.take(&mut out, SHORT), None, "too few");
        heard.put(&[0.3, f32::NAN, 7.0], after(begun, 5));
        let at = heard.take(&mut out, SHORT).expect("enough");
        assert_eq!(out, [0.1, 0.2, 0.3]);
        assert!(at.saturating_duration_since(begun) < Duration::from_micros(1));
        let mut out = [0.5; 2];
        let at = heard.take(&mut out, SHORT).expect("the rest");
        assert_eq!(out, [0.0, 1.0], "no number, and too loud");
        let off = at.saturating_duration_since(after(begun, 3));
        assert!(off < Duration::from_micros(1), "{off:?}");
    }

    #[test]
    fn only_the_newest_second_waits_and_it_can_be_forgotten() {
        let (heard, begun) = (Heard::default(), Instant::now());
        for second in 1..=3u16 {
            let samples = vec![f32::from(second) / 10.0; RATE as usize];
            heard.put(&samples, after(begun, u32::from(second) * RATE));
        }
        let mut out = [0.0; 480];
        let at = heard.take(&mut out, SHORT).expect("a second waits");
        assert_eq!(out, [0.3; 480], "the third");
        let off = at.saturating_duration_since(after(begun, 2 * RATE));
        assert!(off < Duration::from_micros(1), "{off:?}");
        heard.clear();
        assert_eq!(heard.take(&mut out, SHORT), None, "forgotten");
    }

    #[test]
    fn who_waits_is_woken_by_what_comes() {
        let (heard, begun) = (Heard::default(), Instant::now());
        std::thread::scope(|scope| {
            let taken = scope.spawn(|| heard.take(&mut [0.0; 2], Duration::from_secs(60)));
            heard.put(&[0.1], begun);
            heard.put(&[0.2], begun);
            assert!(taken.join().expect("no panic").is_some(), "woken");
        });
    }
}
