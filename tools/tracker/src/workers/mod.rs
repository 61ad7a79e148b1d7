//! The networks at work: body, hands and face of one picture in parallel, each on a thread of its own.
//!
//! There is no queue: a picture is handed over, looked at and answered before the next one, and its caller hands over the newest.

mod thread;

use crate::TrackerError;
use crate::models::{
    BodyEstimate, BodyHints, BodyModel, FaceEstimate, FaceModel, HandEstimate, HandModel,
    HandModels, Models, Side,
};
use crate::source::Picture;
use motion_fit::estimates::Observation;
use std::sync::Arc;
use std::time::Instant;
use thread::{Answer, Worker, ms_since};

/// What was seen in one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// When the light fell, seconds on the source's clock.
    pub seconds: f64,
    /// The body.
    pub body: Option<BodyEstimate>,
    /// The person's left and right hand.
    pub hands: [Option<HandEstimate>; 2],
    /// Which hands were looked at: not both where they take turns.
    pub hands_looked_at: [bool; 2],
    /// The face.
    pub face: Option<FaceEstimate>,
    /// How many people were seen when the whole picture was last looked at; nothing if it never was.
    pub people: Option<usize>,
    /// How long it took.
    pub times: StageTimes,
}

impl Seen {
    /// What the fit needs of it.
    #[must_use]
    pub fn into_observation(self) -> Observation {
        Observation {
            seconds: self.seconds,
            body: self.body,
            hands: self.hands,
            hands_skipped: self.hands_looked_at.map(|looked_at| !looked_at),
            face: self.face,
        }
    }
}

/// The time each stage took, milliseconds. What runs in parallel is counted in each.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimes {
    /// The body, with detection where the person was not known.
    pub body_ms: f32,
    /// Each hand, left first, without waiting for the body.
    pub hands_ms: [f32; 2],
    /// The face, without waiting for the body.
    pub face_ms: f32,
    /// From the picture to the answer.
    pub total_ms: f32,
}

/// What the body's thread answers.
type BodyFound = (Option<BodyEstimate>, Option<usize>);

/// What a thread for hands answers: each side that it looked at, and the milliseconds of that.
type HandsFound = [Option<(Option<HandEstimate>, f32)>; 2];

/// Tracks one person through pictures.
#[derive(Debug)]
pub struct Tracker {
    body: Worker<BodyFound>,
    hands: Vec<Worker<HandsFound>>,
    face: Option<Worker<Option<FaceEstimate>>>,
    /// What a thread that has ended was for. The others may be left with a picture whose answer is not taken, so that they get no more.
    stopped: Option<&'static str>,
}

impl Tracker {
    /// Starts the threads for `models`.
    ///
    /// # Errors
    /// [`TrackerError::Thread`] if the system refuses one.
    pub fn new(models: Models) -> Result<Self, TrackerError> {
        let hands = match models.hands {
            HandModels::None => Vec::new(),
            HandModels::Alternating(model) => {
                vec![hands(model, |turn| {
                    vec![Side::BOTH[usize::from(turn % 2 == 1)]]
                })?]
            }
            HandModels::Each([left, right]) => {
                vec![
                    hands(left, |_| vec![Side::Left])?,
                    hands(right, |_| vec![Side::Right])?,
                ]
            }
        };
        Ok(Self {
            body: body(models.body)?,
            hands,
            face: models.face.map(face).transpose()?,
            stopped: None,
        })
    }

    /// What is seen in `picture`. The threads for hands and face look where they saw them last while the body's is at work; then they
    /// hear where the body is, and search what they lost.
    ///
    /// # Errors
    /// Those of the models, and [`TrackerError::Stopped`] if a thread has ended. After an error of a model the next picture may be
    /// handed over; a thread that has ended is the error of all further ones.
    pub fn observe(&mut self, picture: &Arc<Picture>) -> Result<Seen, TrackerError> {
        if let Some(unit) = self.stopped {
            return Err(TrackerError::Stopped { unit });
        }
        let seen = self.look(picture);
        if let Err(TrackerError::Stopped { unit }) = seen {
            self.stopped = Some(unit);
        }
        seen
    }

    fn look(&self, picture: &Arc<Picture>) -> Result<Seen, TrackerError> {
        let start = Instant::now();
        self.body.look(picture)?;
        for worker in &self.hands {
            worker.look(picture)?;
        }
        if let Some(worker) = &self.face {
            worker.look(picture)?;
        }

        let body = self.body.answer()?;
        // Also after an error: each thread waits for this before it answers.
        let hints = match &body.found {
            Ok((Some(body), _)) => Some(body.hints()),
            _ => None,
        };
        for worker in &self.hands {
            worker.tell(hints)?;
        }
        if let Some(worker) = &self.face {
            worker.tell(hints)?;
        }
        let hands: Vec<_> = self
            .hands
            .iter()
            .map(Worker::answer)
            .collect::<Result<_, _>>()?;
        let face = self.face.as_ref().map(Worker::answer).transpose()?;

        let mut seen = Seen {
            seconds: picture.seconds,
            body: None,
            hands: [None, None],
            hands_looked_at: [false; 2],
            face: None,
            people: None,
            times: StageTimes {
                body_ms: body.busy_ms,
                ..StageTimes::default()
            },
        };
        (seen.body, seen.people) = body.found?;
        for answer in hands {
            for (side, found) in Side::BOTH.into_iter().zip(answer.found?) {
                if let Some((hand, ms)) = found {
                    seen.hands[side.index()] = hand;
                    seen.hands_looked_at[side.index()] = true;
                    seen.times.hands_ms[side.index()] = ms;
                }
            }
        }
        if let Some(Answer { found, busy_ms }) = face {
            seen.face = found?;
            seen.times.face_ms = busy_ms;
        }
        seen.times.total_ms = ms_since(start);
        Ok(seen)
    }
}

fn body(mut model: Box<dyn BodyModel>) -> Result<Worker<BodyFound>, TrackerError> {
    Worker::start("body", move |picture, inbox| {
        let seen = inbox.busy(|| model.run(picture.view()?, picture.seconds))?;
        Ok((seen, model.people()))
    })
}

/// `turns` says which sides are looked at in the picture of that number.
fn hands(
    mut model: Box<dyn HandModel>,
    turns: impl Fn(u64) -> Vec<Side> + Send + 'static,
) -> Result<Worker<HandsFound>, TrackerError> {
    let mut turn = 0;
    Worker::start("hands", move |picture, inbox| {
        let sides = turns(turn);
        turn += 1;
        let mut found: HandsFound = [None, None];
        // An error is returned once the body's answer is taken.
        let mut failed = None;
        for side in &sides {
            let start = Instant::now();
            let followed = inbox.busy(|| picture.view().and_then(|view| model.follow(view, *side)));
            let followed = followed.unwrap_or_else(|error| {
                failed.get_or_insert(error);
                None
            });
            found[side.index()] = Some((followed, ms_since(start)));
        }
        let hints: Option<BodyHints> = inbox.body()?;
        if let Some(error) = failed {
            return Err(error);
        }
        for side in sides {
            let Some((hand, ms)) = &mut found[side.index()] else {
                continue;
            };
            let start = Instant::now();
            match hints.and_then(|hints| hints.hands[side.index()]) {
                None => {
                    model.forget(side);
                    *hand = None;
                }
                Some(hint) => {
                    let followed = hand.take();
                    *hand = inbox.busy(|| model.find(picture.view()?, side, &hint, followed))?;
                }
            }
            *ms += ms_since(start);
        }
        Ok(found)
    })
}

fn face(mut model: Box<dyn FaceModel>) -> Result<Worker<Option<FaceEstimate>>, TrackerError> {
    Worker::start("the face", move |picture, inbox| {
        let followed = inbox.busy(|| model.follow(picture.view()?));
        let hint = inbox.body()?.and_then(|hints| hints.face);
        let followed = followed?;
        inbox.busy(|| model.find(picture.view()?, hint.as_ref(), followed))
    })
}
