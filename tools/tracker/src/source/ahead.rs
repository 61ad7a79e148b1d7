//! A source read by a thread of its own, ahead of the caller or always at the newest picture. Buffers go round: nothing is
//! allocated once each has had a picture.

use std::collections::VecDeque;
use std::mem::swap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle, panicking, sleep};
use std::time::{Duration, Instant};

use super::LONGEST_SILENCE;
use super::error::SourceError;
use super::picture::{Picture, Source, SourceInfo};

/// What becomes of pictures that the caller has not taken yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Keep {
    /// All: the thread waits while so many are ready.
    Every(usize),
    /// One: a newer one takes its place.
    Newest,
}

/// Gives the next picture, or false at the end: [`Source::next`].
pub(super) type Next = Box<dyn FnMut(&mut Picture) -> Result<bool, SourceError> + Send>;

#[derive(Debug)]
struct State {
    ready: VecDeque<Picture>,
    free: Vec<Picture>,
    /// Why no more come.
    end: Option<Result<(), SourceError>>,
    ended: bool,
    stopped: bool,
}

#[derive(Debug)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Each change is whole before a thread could panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// From the end of what it reads to a thread's own.
const LONGEST_END: Duration = Duration::from_secs(2);

/// Waits for a thread's end. One that does not end by then is left to itself.
pub(super) fn join_within(thread: JoinHandle<()>, patience: Duration) {
    let begun = Instant::now();
    while !thread.is_finished() {
        if begun.elapsed() >= patience {
            log::debug!("a thread that reads does not end: it is left");
            return;
        }
        sleep(Duration::from_millis(1));
    }
    // A panic there was reported by the thread itself.
    let _ = thread.join();
}

/// Pictures that a thread reads.
#[derive(Debug)]
pub(super) struct Queue {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Queue {
    /// Starts the thread.
    pub(super) fn start(name: &str, keep: Keep, next: Next) -> Result<Self, SourceError> {
        let spare = match keep {
            Keep::Every(ready) => ready + 1,
            Keep::Newest => 2,
        };
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                ready: VecDeque::with_capacity(spare),
                free: (0..spare).map(|_| Picture::empty()).collect(),
                end: None,
                ended: false,
                stopped: false,
            }),
            changed: Condvar::new(),
        });
        let theirs = Arc::clone(&shared);
        let source = name.to_owned();
        let thread = Builder::new()
            .name("pictures".to_owned())
            .spawn(move || read(&theirs, source, keep, next))
            .map_err(|source| SourceError::Thread {
                name: name.to_owned(),
                source,
            })?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Exchanges `into` for the next picture. Waits `patience` for it at most, and gives `None` where it does not come.
    pub(super) fn next(
        &self,
        into: &mut Picture,
        patience: Option<Duration>,
    ) -> Option<Result<bool, SourceError>> {
        let deadline = patience.map(|patience| Instant::now() + patience);
        let mut state = self.shared.lock();
        loop {
            if let Some(mut picture) = state.ready.pop_front() {
                swap(into, &mut picture);
                state.free.push(picture);
                drop(state);
                self.shared.changed.notify_all();
                return Some(Ok(true));
            }
            if state.ended {
                return Some(state.end.take().unwrap_or(Ok(())).map(|()| false));
            }
            state = match deadline {
                None => self
                    .shared
                    .changed
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner),
                Some(deadline) => {
                    let left = deadline.checked_duration_since(Instant::now())?;
                    let (state, _) = self
                        .shared
                        .changed
                        .wait_timeout(state, left)
                        .unwrap_or_else(PoisonError::into_inner);
                    state
                }
            };
        }
    }

    /// Asks the thread to end after the picture it is reading.
    pub(super) fn stop(&self) {
        self.shared.lock().stopped = true;
        self.shared.changed.notify_all();
    }

    /// Waits for the thread's end, but not for ever; what it reads must have been closed.
    pub(super) fn join(&mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            join_within(thread, LONGEST_END);
        }
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Says that the thread ended, also where it panicked: the caller must not wait for it, nor take it for the end.
struct Ended<'a> {
    shared: &'a Shared,
    source: String,
}

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        let mut state = self.shared.lock();
        state.ended = true;
        if panicking() {
            let name = std::mem::take(&mut self.source);
            state.end = Some(Err(SourceError::Stopped { name }));
        }
        drop(state);
        self.shared.changed.notify_all();
    }
}

/// The thread: reads `source`, as messages call it, by `next`.
fn read(shared: &Shared, source: String, keep: Keep, mut next: Next) {
    let _ended = Ended { shared, source };
    loop {
        let mut picture = {
            let mut state = shared.lock();
            loop {
                if state.stopped {
                    return;
                }
                let room = match keep {
                    Keep::Every(most) => state.ready.len() < most,
                    Keep::Newest => true,
                };
                if room {
                    break state.free.pop().unwrap_or_default();
                }
                state = shared
                    .changed
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner);
            }
        };
        let given = next(&mut picture);
        let mut state = shared.lock();
        match given {
            Ok(true) => {
                if keep == Keep::Newest
                    && let Some(old) = state.ready.pop_front()
                {
                    state.free.push(old);
                }
                state.ready.push_back(picture);
            }
            Ok(false) => return,
            Err(why) => {
                state.end = Some(Err(why));
                return;
            }
        }
        drop(state);
        shared.changed.notify_all();
    }
}

/// Another source, read by a thread. The thread ends by itself, after the picture that it is reading when this is dropped.
#[derive(Debug)]
pub(super) struct Ahead {
    info: SourceInfo,
    queue: Queue,
    patience: Duration,
}

impl Ahead {
    /// Starts the thread.
    pub(super) fn over(mut source: Box<dyn Source>, keep: Keep) -> Result<Self, SourceError> {
        let info = source.info().clone();
        let queue = Queue::start(&info.name, keep, Box::new(move |into| source.next(into)))?;
        Ok(Self {
            info,
            queue,
            patience: LONGEST_SILENCE,
        })
    }
}

impl Source for Ahead {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        self.queue
            .next(into, Some(self.patience))
            .unwrap_or_else(|| {
                Err(SourceError::Silent {
                    name: self.info.name.clone(),
                    seconds: self.patience.as_secs(),
                })
            })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    fn numbered(last: u64, mut before: impl FnMut(u64) + Send + 'static) -> Next {
        let mut number = 0;
        Box::new(move |into| {
            before(number);
            into.number = number;
            number += 1;
            Ok(number <= last)
        })
    }

    #[test]
    fn every_picture_comes_once_and_in_order_and_then_the_end() {
        let queue = Queue::start("test", Keep::Every(2), numbered(50, |_| ())).expect("a thread");
        let mut picture = Picture::empty();
        for expected in 0..50 {
            assert!(
                queue
                    .next(&mut picture, None)
                    .expect("no patience")
                    .expect("no error"),
                "the end at {expected}"
            );
            assert_eq!(picture.number, expected, "order");
        }
        for _ in 0..2 {
            assert!(
                !queue
                    .next(&mut picture, None)
                    .expect("no patience")
                    .expect("no error"),
                "no end"
            );
        }
    }

    #[test]
    fn the_newest_picture_is_given_and_older_ones_are_left_out() {
        let (go, wait) = channel::<()>();
        let (tell, told) = channel();
        let queue = Queue::start(
            "test",
            Keep::Newest,
            numbered(100, move |number| {
                if number == 10 {
                    tell.send(()).expect("the test waits");
                    let _ = wait.recv();
                }
            }),
        )
        .expect("a thread");
        let mut picture = Picture::empty();
        // Until ten were read, nine of which were in the way.
        told.recv_timeout(Duration::from_secs(20))
            .expect("it reads on");
        assert!(
            queue
                .next(&mut picture, None)
                .expect("no patience")
                .expect("no error"),
            "nothing"
        );
        assert_eq!(picture.number, 9, "newest");
        assert!(
            queue
                .next(&mut picture, Some(Duration::from_millis(5)))
                .is_none(),
            "the thread waits"
        );
        drop(go);
        assert!(
            queue
                .next(&mut picture, None)
                .expect("no patience")
                .expect("no error"),
            "nothing"
        );
    }

    #[test]
    fn a_panic_of_the_thread_is_an_error_after_the_pictures_before_it() {
        let queue = Queue::start(
            "test",
            Keep::Every(1),
            numbered(9, |number| assert!(number < 1, "as the test wants")),
        )
        .expect("a thread");
        let mut picture = Picture::empty();
        assert!(
            queue
                .next(&mut picture, None)
                .expect("no patience")
                .expect("no error"),
            "the first"
        );
        let why = queue
            .next(&mut picture, None)
            .expect("no patience")
            .expect_err("it panicked");
        assert!(
            matches!(&why, SourceError::Stopped { name } if name == "test"),
            "{why}"
        );
        assert!(
            !queue
                .next(&mut picture, None)
                .expect("no patience")
                .expect("no error"),
            "the end"
        );
    }

    /// Its producer has stalled.
    struct Stalled(SourceInfo, std::sync::mpsc::Receiver<()>);

    impl Source for Stalled {
        fn info(&self) -> &SourceInfo {
            &self.0
        }

        fn next(&mut self, _: &mut Picture) -> Result<bool, SourceError> {
            let _ = self.1.recv();
            Ok(false)
        }
    }

    #[test]
    fn a_stalled_source_is_not_waited_for_for_ever() {
        let (go, wait) = channel();
        let info = SourceInfo {
            name: "standard input".to_owned(),
            width: 1,
            height: 1,
            rate_hz: None,
            frames: None,
        };
        let mut ahead = Ahead::over(Box::new(Stalled(info, wait)), Keep::Newest).expect("a thread");
        ahead.patience = Duration::from_millis(5);
        let mut picture = Picture::empty();
        let why = ahead.next(&mut picture).expect_err("no picture");
        assert!(
            matches!(&why, SourceError::Silent { name, .. } if name == "standard input"),
            "{why}"
        );
        drop(go);
        ahead.patience = Duration::from_secs(60);
        assert!(!ahead.next(&mut picture).expect("no error"), "the end");
    }

    #[test]
    fn a_thread_that_does_not_end_is_left() {
        let (go, wait) = channel::<()>();
        let thread = Builder::new()
            .spawn(move || {
                let _ = wait.recv();
            })
            .expect("a thread");
        join_within(thread, Duration::from_millis(5));
        drop(go);
    }

    #[test]
    fn buffers_go_round() {
        let queue = Queue::start(
            "test",
            Keep::Every(2),
            Box::new({
                let mut left = 100;
                move |into| {
                    into.resize(64, 64);
                    left -= 1;
                    Ok(left > 0)
                }
            }),
        )
        .expect("a thread");
        let mut picture = Picture::empty();
        let mut seen = std::collections::BTreeSet::new();
        while queue
            .next(&mut picture, None)
            .expect("no patience")
            .expect("no error")
        {
            seen.insert(picture.rgb.as_ptr() as usize);
        }
        assert!(seen.len() <= 4, "{} buffers", seen.len());
    }
}
