//! Pausing, resuming and ending the work on the GPU from another thread, at any moment.
//!
//! A system that puts a program into the background wants its GPU back at once. Work goes in steps ([`Control::on_gpu`]), few of them
//! longer than a picture: [`Control::pause`] waits for the step that was begun, and no other begins. Work without the GPU asks between
//! its steps whether to go on ([`Control::checkpoint`]). The call goes on meanwhile.

use crate::error::ReceiverError;
use npu_runtime::Cancel;
use renderer_splat::interrupt::Interrupt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Pauses, resumes and ends work on the GPU. Copies control the same work. A new one without copies never stops it.
#[derive(Debug, Clone, Default)]
pub struct Control(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Raised while the GPU is wanted back: the renderer then ends with the picture it draws.
    interrupt: Interrupt,
    /// Ends the loading of graphs for good.
    cancel: Cancel,
}

#[derive(Debug, Clone, Copy, Default)]
struct State {
    pauses: bool,
    leaves: bool,
    /// A step is on the GPU now.
    works: bool,
}

/// A step on the GPU, until it is dropped.
#[derive(Debug)]
pub struct Step<'a>(&'a Control);

impl Drop for Step<'_> {
    fn drop(&mut self) {
        self.0.end_work();
    }
}

impl Control {
    /// Lets no further step begin, and waits at most `patience` for the end of the one that was begun. Returns whether the GPU rests;
    /// if not, that step ends by itself later, and none follows. Pausing again changes nothing.
    #[must_use]
    pub fn pause(&self, patience: Duration) -> bool {
        let mut state = self.lock();
        state.pauses = true;
        self.0.interrupt.set(true);
        self.0.changed.notify_all();
        let waited = self
            .0
            .changed
            .wait_timeout_while(state, patience, |state| state.works && state.pauses);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        !state.works
    }

    /// Lets steps begin again after a pause.
    pub fn resume(&self) {
        let mut state = self.lock();
        state.pauses = false;
        self.0.interrupt.set(state.leaves);
        self.0.changed.notify_all();
    }

    /// Ends all work, also in a pause. There is no way back.
    pub fn leave(&self) {
        let mut state = self.lock();
        state.leaves = true;
        self.0.interrupt.set(true);
        self.0.changed.notify_all();
        drop(state);
        self.0.cancel.cancel();
    }

    /// Whether steps are to pause.
    #[must_use]
    pub fn is_paused(&self) -> bool {
        self.lock().pauses
    }

    /// Whether it is time to leave.
    #[must_use]
    pub fn is_leaving(&self) -> bool {
        self.lock().leaves
    }

    /// Waits while a pause lasts. Asked between the steps of what touches no GPU.
    ///
    /// # Errors
    /// [`ReceiverError::Left`] if it is time to leave.
    pub fn checkpoint(&self) -> Result<(), ReceiverError> {
        let state = self.lock();
        let resumed = (self.0.changed).wait_while(state, |state| state.pauses && !state.leaves);
        let state = resumed.unwrap_or_else(PoisonError::into_inner);
        if state.leaves {
            Err(ReceiverError::Left)
        } else {
            Ok(())
        }
    }

    /// Begins a step on the GPU once no pause forbids it; nothing if it is time to leave before.
    #[must_use]
    pub fn step(&self) -> Option<Step<'_>> {
        self.begin_work().then_some(Step(self))
    }

    /// Begins a step on the GPU; nothing in a pause.
    #[must_use]
    pub fn try_step(&self) -> Option<Step<'_>> {
        self.may_work().then_some(Step(self))
    }

    /// Does one step on the GPU once no pause forbids it.
    ///
    /// # Errors
    /// [`ReceiverError::Left`] if it is time to leave before; the step's own.
    pub fn on_gpu<T, E: From<ReceiverError>>(
        &self,
        step: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        let _step = self.step().ok_or(ReceiverError::Left)?;
        step()
    }

    /// For renderers ([`renderer_splat::options::RendererOptions::interrupt`]): raised in a pause and at the end.
    #[must_use]
    pub fn interrupt(&self) -> Interrupt {
        self.0.interrupt.clone()
    }

    /// For loading graphs ([`npu_runtime::Runtime::cancelled_by`]): cancelled at the end.
    #[must_use]
    pub fn cancel(&self) -> &Cancel {
        &self.0.cancel
    }

    /// Sleeps for `time`, or until it is time to leave.
    pub fn sleep(&self, time: Duration) {
        let state = self.lock();
        let slept = (self.0.changed).wait_timeout_while(state, time, |state| !state.leaves);
        drop(slept);
    }

    /// Begins a step on the GPU, or goes on with it, except in a pause. Returns whether it may.
    pub fn may_work(&self) -> bool {
        let mut state = self.lock();
        state.works |= !state.pauses;
        !state.pauses
    }

    /// Begins a step on the GPU once no pause forbids it. Returns false, without beginning, if it is time to leave before.
    pub fn begin_work(&self) -> bool {
        let state = self.lock();
        let resumed = (self.0.changed).wait_while(state, |state| state.pauses && !state.leaves);
        let mut state = resumed.unwrap_or_else(PoisonError::into_inner);
        state.works |= !state.leaves;
        !state.leaves
    }

    /// The GPU is at rest: a pause that waits for this returns.
    pub fn end_work(&self) {
        self.lock().works = false;
        self.0.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // What is kept is whole at every moment.
        (self.0.state.lock()).unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::SeqCst};

    /// Longer than any step of these tests.
    const PATIENCE: Duration = Duration::from_secs(2);

    /// A loop as the headset's, which counts its frames.
    struct Worker {
        control: Control,
        frames: Arc<AtomicU32>,
        working: Arc<AtomicBool>,
        thread: Option<std::thread::JoinHandle<()>>,
    }

    impl Worker {
        fn start() -> Self {
            let (control, frames, working) = (
                Control::default(),
                Arc::new(AtomicU32::new(0)),
                Arc::new(AtomicBool::new(false)),
            );
            let thread = {
                let (control, frames, working) =
                    (control.clone(), Arc::clone(&frames), Arc::clone(&working));
                std::thread::spawn(move || {
                    while !control.is_leaving() {
                        if !control.begin_work() {
                            return;
                        }
                        working.store(true, SeqCst);
                        std::thread::sleep(Duration::from_millis(3));
                        frames.fetch_add(1, SeqCst);
                        working.store(false, SeqCst);
                        control.end_work();
                    }
                })
            };
            Self {
                control,
                frames,
                working,
                thread: Some(thread),
            }
        }

        fn wait_for_more(&self) {
            let before = self.frames.load(SeqCst);
            while self.frames.load(SeqCst) < before + 3 {
                std::thread::sleep(Duration::from_millis(1));
            }
        }

        fn end(&mut self) {
            self.control.leave();
            let thread = self.thread.take().expect("still there");
            thread.join().expect("no panic");
        }
    }

    #[test]
    fn nothing_is_at_work_from_a_pause_to_its_end() {
        let mut worker = Worker::start();
        for _ in 0..20 {
            worker.wait_for_more();
            assert!(worker.control.pause(PATIENCE), "comes to rest");
            assert!(!worker.working.load(SeqCst), "at rest");
            let frames = worker.frames.load(SeqCst);
            std::thread::sleep(Duration::from_millis(10));
            assert_eq!(worker.frames.load(SeqCst), frames, "no frame in the pause");
            assert!(
                worker.control.pause(PATIENCE),
                "pausing again changes nothing"
            );
            worker.control.resume();
        }
        worker.wait_for_more();
        worker.end();
    }

    #[test]
    fn leaving_in_a_pause_does_not_wait() {
        let mut worker = Worker::start();
        worker.wait_for_more();
        assert!(worker.control.pause(PATIENCE), "comes to rest");
        worker.end();
        assert!(worker.control.is_leaving(), "for good");
    }

    #[test]
    fn a_pause_before_the_first_frame_holds_it_back() {
        let control = Control::default();
        assert!(control.pause(PATIENCE), "nobody is at work");
        let begun = Arc::new(AtomicBool::new(false));
        let thread = {
            let (control, begun) = (control.clone(), Arc::clone(&begun));
            std::thread::spawn(move || {
                let works = control.begin_work();
                begun.store(true, SeqCst);
                works
            })
        };
        std::thread::sleep(Duration::from_millis(20));
        assert!(!begun.load(SeqCst), "held back");
        control.resume();
        assert!(thread.join().expect("no panic"), "begun after the pause");
    }
}
