//! The lanes' threads: started, watched, stopped.

use super::MotionSource;
use super::triple_buffer::WakeSignal;
use crate::error::ReceiverError;
use crate::pool::in_own_pool;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;

/// Ends when it is dropped.
#[derive(Debug)]
pub(super) struct Threads<S: MotionSource> {
    stop: Arc<AtomicBool>,
    /// The motion source is over.
    over: Arc<AtomicBool>,
    bells: [WakeSignal; 2],
    motion: Option<JoinHandle<S>>,
    lanes: Vec<JoinHandle<Result<(), ReceiverError>>>,
}

impl<S: MotionSource> Threads<S> {
    /// None yet; `bells` wake those that sleep.
    pub(super) fn new(bells: [WakeSignal; 2]) -> Self {
        Self {
            stop: Arc::default(),
            over: Arc::default(),
            bells,
            motion: None,
            lanes: Vec::new(),
        }
    }

    pub(super) fn spawn_motion(
        &mut self,
        run: impl FnOnce(&AtomicBool, &AtomicBool) -> S + Send + 'static,
    ) -> Result<(), ReceiverError> {
        let (stop, over) = (Arc::clone(&self.stop), Arc::clone(&self.over));
        self.motion = Some(spawn("motion lane", move || run(&stop, &over))?);
        Ok(())
    }

    pub(super) fn spawn(
        &mut self,
        name: &str,
        run: impl FnOnce(&AtomicBool) -> Result<(), ReceiverError> + Send + 'static,
    ) -> Result<(), ReceiverError> {
        let stop = Arc::clone(&self.stop);
        self.lanes.push(spawn(name, move || run(&stop))?);
        Ok(())
    }

    /// As [`Self::spawn`], within a pool of its own for the kernels, which ends with it: a thread of the pool hands work to the others
    /// without allocating, one from outside does not.
    pub(super) fn spawn_in_pool(
        &mut self,
        name: &str,
        run: impl FnOnce(&AtomicBool) -> Result<(), ReceiverError> + Send + 'static,
    ) -> Result<(), ReceiverError> {
        let threads = name.to_owned();
        self.spawn(name, move |stop| in_own_pool(&threads, || run(stop))?)
    }

    /// Whether the motion source has no more poses.
    pub(super) fn is_over(&self) -> bool {
        self.over.load(Relaxed)
    }

    /// What ended a lane, if one has ended.
    pub(super) fn check(&mut self) -> Result<(), ReceiverError> {
        let motion_ended = self.motion.as_ref().is_some_and(JoinHandle::is_finished);
        if motion_ended && !self.is_over() {
            // Without its last word: it panicked.
            return self
                .motion
                .take()
                .map_or(Ok(()), |lane| join(lane).map(drop));
        }
        let ended = self.lanes.iter().position(JoinHandle::is_finished);
        match ended.map(|at| self.lanes.swap_remove(at)) {
            None => Ok(()),
            Some(lane) => match join(lane)? {
                Err(error) => Err(error),
                Ok(()) => Err(ReceiverError::LaneEnded),
            },
        }
    }

    /// Has them all end soon.
    pub(super) fn ask_to_stop(&self) {
        self.stop.store(true, Relaxed);
        self.bells.iter().for_each(WakeSignal::ring);
    }

    /// Stops them all: the source, unless its lane panicked, and the first error of a lane.
    pub(super) fn finish(&mut self) -> (Option<S>, Option<ReceiverError>) {
        self.ask_to_stop();
        let source = self.motion.take().map(join).transpose();
        // All of them, whatever the first one says.
        let ends: Vec<_> = self.lanes.drain(..).map(join).collect();
        let error = ends.into_iter().find_map(|end| end.flatten().err());
        match source {
            Ok(source) => (source, error),
            Err(panic) => (None, error.or(Some(panic))),
        }
    }
}

impl<S: MotionSource> Drop for Threads<S> {
    fn drop(&mut self) {
        if (self.motion.is_some() || !self.lanes.is_empty())
            && let (_, Some(error)) = self.finish()
        {
            log::warn!("a lane ended with an error: {error}");
        }
    }
}

fn spawn<T: Send + 'static>(
    name: &str,
    run: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, ReceiverError> {
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(run)
        .map_err(ReceiverError::Thread)
}

fn join<T>(thread: JoinHandle<T>) -> Result<T, ReceiverError> {
    let name = thread.thread().name().unwrap_or("a lane").to_owned();
    thread.join().map_err(|_| ReceiverError::Panicked(name))
}
