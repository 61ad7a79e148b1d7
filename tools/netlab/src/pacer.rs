//! Runs tasks at given times, to a fraction of a millisecond: one thread that sleeps until the next is due. (The async runtime's own timer
//! counts whole milliseconds and rounds up, which a network of 20 ms would show.)

use std::{
    collections::BinaryHeap,
    fmt,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread::JoinHandle,
    time::{Duration, Instant},
};

use crate::statistics::Punctuality;

type Task = Box<dyn FnOnce() + Send>;

/// A thread that runs tasks when they are due. Dropping it drops the tasks that are not due yet.
pub(crate) struct Pacer {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    started: Instant,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    due: BinaryHeap<Due>,
    next_order: u64,
    stopped: bool,
    punctuality: Punctuality,
}

struct Due {
    at: Instant,
    order: u64,
    task: Task,
}

impl Ord for Due {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        // The heap's greatest is the earliest; of two at one time the one that was asked for first.
        (other.at, other.order).cmp(&(self.at, self.order))
    }
}

impl PartialOrd for Due {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Due {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Due {}

/// A lock that survives a panic elsewhere: the state behind it is consistent after every step.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Pacer {
    pub(crate) fn start() -> Result<Self, std::io::Error> {
        let shared = Arc::new(Shared::default());
        let thread = std::thread::Builder::new()
            .name("netlab-pacer".to_owned())
            .spawn({
                let shared = shared.clone();
                move || shared.run()
            })?;
        Ok(Self {
            shared,
            thread: Some(thread),
            started: Instant::now(),
        })
    }

    /// Time since the pacer was started.
    pub(crate) fn now(&self) -> Duration {
        self.started.elapsed()
    }

    /// Runs a short task, which must not block, at a time since the pacer was started.
    pub(crate) fn at(&self, time: Duration, task: impl FnOnce() + Send + 'static) {
        // A time beyond the clock's end never comes.
        let Some(at) = self.started.checked_add(time) else {
            return;
        };
        let mut state = locked(&self.shared.state);
        let order = state.next_order;
        state.next_order += 1;
        let is_next = state.due.peek().is_none_or(|next| at < next.at);
        state.due.push(Due {
            at,
            order,
            task: Box::new(task),
        });
        drop(state);
        if is_next {
            self.shared.changed.notify_one();
        }
    }

    /// Waits until a time since the pacer was started; returns early only if the pacer ends.
    pub(crate) async fn wait_until(&self, time: Duration) {
        if time > self.now() {
            let (done, waiting) = tokio::sync::oneshot::channel();
            self.at(time, move || {
                let _ = done.send(());
            });
            let _ = waiting.await;
        }
    }

    pub(crate) fn punctuality(&self) -> Punctuality {
        locked(&self.shared.state).punctuality
    }
}

impl Shared {
    fn run(&self) {
        let mut state = locked(&self.state);
        while !state.stopped {
            let now = Instant::now();
            let wait = match state.due.peek() {
                Some(next) if next.at <= now => Duration::ZERO,
                Some(next) => next.at - now,
                None => Duration::from_secs(3600),
            };
            if !wait.is_zero() {
                state = self
                    .changed
                    .wait_timeout(state, wait)
                    .unwrap_or_else(PoisonError::into_inner)
                    .0;
                continue;
            }
            if let Some(next) = state.due.pop() {
                state.punctuality.add(now - next.at);
                drop(state);
                (next.task)();
                state = locked(&self.state);
            }
        }
        // Dropped here, outside the lock: tasks may own sockets.
        let left = std::mem::take(&mut state.due);
        drop(state);
        drop(left);
    }
}

impl fmt::Debug for Pacer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pacer")
            .field("started", &self.started)
            .finish_non_exhaustive()
    }
}

impl Drop for Pacer {
    fn drop(&mut self) {
        locked(&self.shared.state).stopped = true;
        self.shared.changed.notify_one();
        // The last owner may be a task on this very thread, which cannot wait for itself.
        if let Some(thread) = self.thread.take()
            && thread.thread().id() != std::thread::current().id()
        {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn tasks_run_in_the_order_of_their_times_and_not_early() {
        let pacer = Pacer::start().expect("a thread");
        let (report, done) = mpsc::channel();
        for (name, ms) in [(3, 30), (1, 10), (2, 20), (4, 30)] {
            let report = report.clone();
            pacer.at(Duration::from_millis(ms), move || {
                let _ = report.send((name, Instant::now()));
            });
        }
        for (name, ms) in [(1, 10), (2, 20), (3, 30), (4, 30)] {
            let (got, when) = done.recv().expect("every task has run");
            assert_eq!(got, name, "the order");
            assert!(
                when >= pacer.started + Duration::from_millis(ms),
                "{name} came early"
            );
        }
        assert_eq!(pacer.punctuality().done, 4, "each counts");
    }

    #[test]
    fn a_pacer_ends_with_tasks_left() {
        let pacer = Pacer::start().expect("a thread");
        let (report, done) = mpsc::channel::<()>();
        pacer.at(Duration::from_secs(1000), move || {
            let _ = report.send(());
        });
        drop(pacer);
        assert!(done.recv().is_err(), "the task is dropped without a run");
    }
}
