//! A thread that looks at one picture at a time.

use crate::TrackerError;
use crate::models::BodyHints;
use crate::source::Picture;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Instant;

/// What a thread is told.
enum Message {
    /// A new picture.
    Look(Arc<Picture>),
    /// What the body's thread found in it.
    Body(Option<BodyHints>),
}

/// What a thread found in a picture.
#[derive(Debug)]
pub(super) struct Answer<T> {
    pub(super) found: Result<T, TrackerError>,
    /// Milliseconds at work, without waiting.
    pub(super) busy_ms: f32,
}

/// A thread and the channels to and from it.
pub(super) struct Worker<T> {
    unit: &'static str,
    /// Nothing once the thread is to end.
    messages: Option<SyncSender<Message>>,
    /// As with the messages.
    answers: Option<Receiver<Answer<T>>>,
    thread: Option<JoinHandle<()>>,
}

/// What a thread's work hears while it is at a picture.
pub(super) struct Inbox<'a> {
    unit: &'static str,
    messages: &'a Receiver<Message>,
    busy_ms: f32,
}

impl Inbox<'_> {
    /// Does `work` and counts its time.
    pub(super) fn busy<R>(&mut self, work: impl FnOnce() -> R) -> R {
        let start = Instant::now();
        let result = work();
        self.busy_ms += ms_since(start);
        result
    }

    /// Waits until the body's thread is done with this picture: where it says that hands and face are, nothing if there is no body.
    pub(super) fn body(&mut self) -> Result<Option<BodyHints>, TrackerError> {
        match self.messages.recv() {
            Ok(Message::Body(hints)) => Ok(hints),
            Ok(Message::Look(_)) | Err(_) => Err(TrackerError::Stopped { unit: self.unit }),
        }
    }
}

impl<T: Send + 'static> Worker<T> {
    /// Starts a thread that does `work` on every picture.
    pub(super) fn start(
        unit: &'static str,
        mut work: impl FnMut(&Picture, &mut Inbox<'_>) -> Result<T, TrackerError> + Send + 'static,
    ) -> Result<Self, TrackerError> {
        // A picture and the body's answer to it.
        let (messages, inbox) = sync_channel(2);
        let (answer, answers) = sync_channel(1);
        let run = move || {
            while let Ok(message) = inbox.recv() {
                let Message::Look(picture) = message else {
                    continue;
                };
                let mut inbox = Inbox {
                    unit,
                    messages: &inbox,
                    busy_ms: 0.0,
                };
                let found = work(&picture, &mut inbox);
                let busy_ms = inbox.busy_ms;
                // Before the answer: the source may use its memory again.
                drop(picture);
                if answer.send(Answer { found, busy_ms }).is_err() {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name(format!("track {unit}"))
            .spawn(run)
            .map_err(|source| TrackerError::Thread { unit, source })?;
        Ok(Self {
            unit,
            messages: Some(messages),
            answers: Some(answers),
            thread: Some(thread),
        })
    }

    /// Hands a picture over.
    pub(super) fn look(&self, picture: &Arc<Picture>) -> Result<(), TrackerError> {
        self.send(Message::Look(Arc::clone(picture)))
    }

    /// Says what the body's thread found.
    pub(super) fn tell(&self, hints: Option<BodyHints>) -> Result<(), TrackerError> {
        self.send(Message::Body(hints))
    }

    fn send(&self, message: Message) -> Result<(), TrackerError> {
        let sent = |to: &SyncSender<Message>| to.send(message).is_ok();
        if self.messages.as_ref().is_some_and(sent) {
            Ok(())
        } else {
            Err(TrackerError::Stopped { unit: self.unit })
        }
    }

    /// Waits for what the thread found in the picture.
    pub(super) fn answer(&self) -> Result<Answer<T>, TrackerError> {
        let answer = self.answers.as_ref().and_then(|from| from.recv().ok());
        answer.ok_or(TrackerError::Stopped { unit: self.unit })
    }
}

impl<T> Drop for Worker<T> {
    fn drop(&mut self) {
        // Before the thread is waited for, which may wait to be told, or to have its answer taken.
        drop(self.messages.take());
        drop(self.answers.take());
        if let Some(thread) = self.thread.take() {
            // That it panicked was returned as `TrackerError::Stopped`.
            let _ = thread.join();
        }
    }
}

impl<T> std::fmt::Debug for Worker<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Worker")
            .field("unit", &self.unit)
            .finish_non_exhaustive()
    }
}

/// Milliseconds since `start`.
pub(super) fn ms_since(start: Instant) -> f32 {
    start.elapsed().as_secs_f32() * 1e3
}
