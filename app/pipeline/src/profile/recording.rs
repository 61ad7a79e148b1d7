//! What lanes tell of themselves: spans of work, and each picture's way from capture to display.
//!
//! Every lane owns a [`Recorder`], a queue without locks that never grows; one [`Collector`] empties them. What does not
//! fit is counted, not waited for.

use super::frame_times::FrameTimes;
use crate::concealment::ConcealmentState;
use crate::stage::{Lane, Stage};
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;

/// Events a lane may be ahead of the collector: two seconds' worth.
const QUEUE: usize = 1 << 12;
/// Spans that are kept, of which a second at 90 Hz has a thousand, and pictures: more than a minute of each.
const SPANS: usize = 1 << 17;
const PICTURES: usize = 1 << 13;

/// One piece of work on one lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Who did it.
    pub lane: Lane,
    /// What was done.
    pub stage: Stage,
    /// The motion frame's number for stages of motion, the picture's for those of pictures ([`Stage::is_per_picture`]).
    pub frame: u64,
    /// When it began ...
    pub begin: Instant,
    /// ... and ended.
    pub end: Instant,
}

/// A picture's way to the display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureTimes {
    /// Counts pictures drawn.
    pub number: u64,
    /// The states it lies between.
    pub from: FrameTimes,
    /// The newer one.
    pub to: FrameTimes,
    /// Its place between them: 0 at `from`, 1 at `to`, more where it was extrapolated.
    pub alpha: f32,
    /// The picture that its Gaussians were made for, by which spans of [`Stage::Interpolate`] go: an earlier one where they came
    /// too late for that.
    pub interpolated_for: u64,
    /// When interpolation began and ended.
    pub interpolation: [Instant; 2],
    /// When the GPU lane began with the picture ...
    pub begun: Instant,
    /// ... its order was there ...
    pub sorted: Instant,
    /// ... and it was drawn.
    pub drawn: Instant,
    /// The display's vertical blank at which it was shown.
    pub displayed: Instant,
    /// When it was meant to be shown.
    pub predicted: Instant,
    /// The Gaussians are those of the picture before: the CPU lane was not there in time.
    pub repeated: bool,
    /// Gaussians drawn.
    pub gaussians: u32,
    /// Part of the full width and height that was drawn.
    pub scale: f32,
}

/// Something a lane has to tell.
#[derive(Debug, Clone, Copy)]
#[expect(
    clippy::large_enum_variant,
    reason = "queues are allocated once; boxing would allocate per picture"
)]
pub enum Event {
    /// Work was done.
    Span(Span),
    /// A picture was shown.
    Picture(PictureTimes),
}

/// A lane's end of its queue.
#[derive(Debug)]
pub struct Recorder {
    lane: Lane,
    queue: Producer<Event>,
    lost: Arc<AtomicU64>,
}

impl Recorder {
    /// Records that `stage` of `frame` took from `begin` until `end`.
    pub fn span(&mut self, stage: Stage, frame: u64, begin: Instant, end: Instant) {
        let lane = self.lane;
        self.tell(Event::Span(Span {
            lane,
            stage,
            frame,
            begin,
            end,
        }));
    }

    /// Records that `stage` of `frame` took from `begin` until now, and returns now.
    pub fn span_until_now(&mut self, stage: Stage, frame: u64, begin: Instant) -> Instant {
        let end = Instant::now();
        self.span(stage, frame, begin, end);
        end
    }

    /// Records a picture.
    pub fn picture(&mut self, picture: PictureTimes) {
        self.tell(Event::Picture(picture));
    }

    fn tell(&mut self, event: Event) {
        if self.queue.push(event).is_err() {
            self.lost.fetch_add(1, Relaxed);
        }
    }
}

/// Gathers what the lanes tell. Keeps the newest minute, at least.
#[derive(Debug)]
pub struct Collector {
    queues: Vec<Consumer<Event>>,
    lost: Arc<AtomicU64>,
    /// Spans, by when they were collected.
    spans: VecDeque<Span>,
    /// Pictures, oldest first.
    pictures: VecDeque<PictureTimes>,
    /// When the newest of what had to be forgotten ended.
    known_since: Option<Instant>,
}

impl Default for Collector {
    fn default() -> Self {
        let now = Instant::now();
        let span = Span {
            lane: Lane::Motion,
            stage: Stage::Kinematics,
            frame: 0,
            begin: now,
            end: now,
        };
        let frame = FrameTimes::new(ConcealmentState::Resting, now);
        let picture = PictureTimes {
            number: 0,
            from: frame,
            to: frame,
            alpha: 0.0,
            interpolated_for: 0,
            interpolation: [now; 2],
            begun: now,
            sorted: now,
            drawn: now,
            displayed: now,
            predicted: now,
            repeated: false,
            gaussians: 0,
            scale: 1.0,
        };
        Self {
            queues: Vec::with_capacity(Lane::ALL.len()),
            lost: Arc::default(),
            spans: room(span, SPANS),
            pictures: room(picture, PICTURES),
            known_since: None,
        }
    }
}

/// Room for so many, each page of it written to: memory that a call takes is taken when it begins, not in its first ten minutes, page by
/// page.
fn room<T: Copy>(any: T, count: usize) -> VecDeque<T> {
    let mut room = VecDeque::from(vec![any; count]);
    room.clear();
    room
}

impl Collector {
    /// Another lane's recorder.
    pub fn recorder(&mut self, lane: Lane) -> Recorder {
        let (queue, consumer) = RingBuffer::new(QUEUE);
        self.queues.push(consumer);
        Recorder {
            lane,
            queue,
            lost: Arc::clone(&self.lost),
        }
    }

    /// Takes what the lanes have told since. Does not allocate.
    pub fn collect(&mut self) {
        for queue in &mut self.queues {
            while let Ok(event) = queue.pop() {
                match event {
                    Event::Span(span) => {
                        let forgotten = keep(&mut self.spans, span).map(|span| span.end);
                        self.known_since = self.known_since.max(forgotten);
                    }
                    Event::Picture(picture) => {
                        let forgotten = keep(&mut self.pictures, picture).map(|one| one.displayed);
                        self.known_since = self.known_since.max(forgotten);
                    }
                }
            }
        }
    }

    /// Forgets what was collected: the start of what is to be measured.
    pub fn clear(&mut self) {
        self.collect();
        self.spans.clear();
        self.pictures.clear();
        self.known_since = None;
    }

    /// Since when nothing is missing, if anything had to be forgotten to keep what came later.
    #[must_use]
    pub fn known_since(&self) -> Option<Instant> {
        self.known_since
    }

    /// Events that found their queue full: with any, what is kept misses something.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
    }

    /// The newest spans of all lanes, by when they were collected.
    pub fn spans(&self) -> impl DoubleEndedIterator<Item = &Span> {
        self.spans.iter()
    }

    /// The newest pictures, oldest first.
    pub fn pictures(&self) -> impl DoubleEndedIterator<Item = &PictureTimes> {
        self.pictures.iter()
    }
}

/// Keeps one more, and returns the oldest if there was no room for both.
fn keep<T>(kept: &mut VecDeque<T>, one: T) -> Option<T> {
    let oldest = if kept.len() == kept.capacity() {
        kept.pop_front()
    } else {
        None
    };
    kept.push_back(one);
    oldest
}
