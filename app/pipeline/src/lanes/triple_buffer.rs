//! How one lane hands its newest result to the next: three places, of which the writer writes one, the reader reads one, and the
//! third holds what is newest. Neither side waits for the other, and what was overwritten unseen is counted.
//!
//! The exchange itself is `triple_buffer`'s; here are the bell that wakes a sleeping lane, and values that cannot be cloned.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};
use triple_buffer::{Input, Output, TripleBuffer};

/// Wakes a lane that has nothing to do. Rung while no lane sleeps, it is heard at the next [`Self::wait`].
#[derive(Debug, Clone, Default)]
pub struct WakeSignal(Arc<(Mutex<bool>, Condvar)>);

impl WakeSignal {
    /// Wakes the lane, now or at its next [`Self::wait`].
    pub fn ring(&self) {
        let (rung, wake) = &*self.0;
        // Who was rung for already is awake, or about to be.
        if !std::mem::replace(
            &mut *rung.lock().unwrap_or_else(PoisonError::into_inner),
            true,
        ) {
            wake.notify_one();
        }
    }

    /// Sleeps until the bell rings or `longest` has passed.
    pub fn wait(&self, longest: Duration) {
        let until = Instant::now() + longest;
        let (rung, wake) = &*self.0;
        let mut rung = rung.lock().unwrap_or_else(PoisonError::into_inner);
        while !*rung {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            rung = wake
                .wait_timeout(rung, left)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
        *rung = false;
    }
}

/// The writing end of a [`triple_buffer()`].
#[derive(Debug)]
pub struct Writer<T: Send> {
    input: Input<Option<T>>,
    bell: WakeSignal,
    overwritten: Overwritten,
}

/// Counts what was overwritten before its reader saw it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Overwritten {
    now: Arc<AtomicU64>,
    before: u64,
}

impl Overwritten {
    pub(crate) fn count(&self) -> u64 {
        self.before + self.now.load(Relaxed)
    }

    /// Another hand-over takes this one's place.
    pub(crate) fn go_on_with(&mut self, other: &Self) {
        *self = Self {
            before: self.count(),
            now: Arc::clone(&other.now),
        };
    }
}

/// The reading end of a [`triple_buffer()`].
#[derive(Debug)]
pub struct Reader<T: Send> {
    output: Output<Option<T>>,
}

/// A hand-over with its three places, whose reader sleeps at `bell`: the newest wins, neither side waits, nothing is allocated later.
pub fn triple_buffer<T: Send>(
    [one, two, three]: [T; 3],
    bell: &WakeSignal,
) -> (Writer<T>, Reader<T>) {
    let (mut input, mut output) = TripleBuffer::<Option<T>>::default().split();
    // Round once, so that each of the three places is filled.
    *input.input_buffer_mut() = Some(one);
    input.publish();
    *input.input_buffer_mut() = Some(two);
    output.update();
    input.publish();
    *input.input_buffer_mut() = Some(three);
    output.update();
    let writer = Writer {
        input,
        bell: bell.clone(),
        overwritten: Overwritten::default(),
    };
    (writer, Reader { output })
}

impl<T: Send> Writer<T> {
    /// The place to write next. What stands there is two or three hand-overs old.
    pub fn place(&mut self) -> &mut T {
        match self.input.input_buffer_mut() {
            Some(place) => place,
            None => unreachable!("all three places were filled"),
        }
    }

    /// Hands the place on as the newest.
    pub fn give(&mut self) {
        if self.input.publish() {
            self.overwritten.now.fetch_add(1, Relaxed);
        }
        self.bell.ring();
    }

    /// How many were never seen by the reader, to be read by anyone.
    pub(crate) fn overwritten(&self) -> Overwritten {
        self.overwritten.clone()
    }
}

impl<T: Send> Reader<T> {
    /// Moves on to the newest, if there is one that was not seen yet.
    pub fn take(&mut self) -> bool {
        self.output.update()
    }

    /// What was taken last, or before that one of the places the hand-over was made with.
    pub fn taken(&mut self) -> &mut T {
        match self.output.output_buffer_mut() {
            Some(place) => place,
            None => unreachable!("all three places were filled"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_wins_and_what_was_overwritten_is_counted() {
        let bell = WakeSignal::default();
        let (mut writer, mut reader) = triple_buffer([0, 0, 0], &bell);
        assert!(!reader.take(), "nothing was given yet");
        for value in 1..=5 {
            *writer.place() = value;
            writer.give();
        }
        assert!(reader.take(), "something was given");
        assert_eq!(*reader.taken(), 5, "the newest");
        assert!(!reader.take(), "only once");
        assert_eq!(*reader.taken(), 5, "and it stays");
        assert_eq!(writer.overwritten().count(), 4, "never seen");
    }

    #[test]
    fn across_threads_values_only_grow_and_none_is_torn() {
        const LAST: u64 = 200_000;
        let bell = WakeSignal::default();
        let (mut writer, mut reader) = triple_buffer([[0u64; 16]; 3], &bell);
        let giving = std::thread::spawn(move || {
            for value in 1..=LAST {
                writer.place().fill(value);
                writer.give();
            }
            writer.overwritten().count()
        });
        let (mut seen, mut newest) = (0, 0);
        while newest < LAST {
            bell.wait(Duration::from_secs(10));
            if reader.take() {
                let value = *reader.taken();
                assert!(value[0] > newest, "{} after {newest}", value[0]);
                assert!(value.iter().all(|one| *one == value[0]), "torn: {value:?}");
                newest = value[0];
                seen += 1;
            }
        }
        let overwritten = giving.join().expect("the writer ends");
        assert_eq!(seen + overwritten, LAST, "seen or counted");
    }

    #[test]
    fn a_signal_without_a_sleeper_wakes_the_next_one_and_silence_ends() {
        let bell = WakeSignal::default();
        bell.ring();
        let begun = Instant::now();
        bell.wait(Duration::from_secs(60));
        assert!(begun.elapsed() < Duration::from_secs(60), "it was heard");
        bell.wait(Duration::from_millis(1));
    }
}
