//! The last states of Gaussians, so that pictures can lie between two of them.

use crate::lanes::Pose;
use crate::profile::FrameTimes;
use crate::timeline::Timeline;
use app_kernels::state::{GaussianState, StateChange};
use renderer_splat::motion_bound::Change;
use spmm3::MotionParams;
use std::time::Instant;

/// Three to interpolate between, since a state may come before the last pictures between older ones are drawn, and one that
/// is being made.
const STATES: usize = 4;

/// All that is known of a state but its Gaussians.
#[derive(Debug, Clone)]
pub(super) struct StateHead {
    pub(super) times: FrameTimes,
    pub(super) motion: MotionParams,
    /// How far Gaussians are from those of the state before, at most.
    pub(super) change: Change,
}

/// Heads of states in the order of their time, oldest first, each with the place its Gaussians are kept at.
#[derive(Debug)]
pub(super) struct Heads {
    heads: Vec<(StateHead, usize)>,
    last_due: Option<Instant>,
}

/// Where a picture lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Between {
    /// Places of the two states, and their numbers.
    pub(super) places: [usize; 2],
    pub(super) numbers: [u64; 2],
    pub(super) alpha: f32,
}

impl Heads {
    /// How many states there is room for.
    pub(super) const PLACES: usize = STATES;

    pub(super) fn new() -> Self {
        Self {
            heads: Vec::with_capacity(STATES),
            last_due: None,
        }
    }

    /// The place at which the next state is made: that of the oldest.
    pub(super) fn next_place(&self) -> usize {
        if self.heads.len() < STATES {
            self.heads.len()
        } else {
            self.heads.first().map_or(0, |(_, place)| *place)
        }
    }

    /// Forgets the oldest, whose place is about to be written.
    pub(super) fn make_room(&mut self) {
        if self.heads.len() == STATES {
            self.heads.remove(0);
        }
    }

    /// The newest state's place.
    pub(super) fn newest_place(&self) -> Option<usize> {
        self.heads.last().map(|(_, place)| *place)
    }

    /// The newest state's time.
    pub(super) fn newest_due(&self) -> Option<Instant> {
        self.heads.last().map(|(head, _)| head.times.due)
    }

    /// Takes a state that was made at `place`.
    pub(super) fn push(&mut self, mut head: StateHead, place: usize, timeline: &mut Timeline) {
        if let Some(before) = self.last_due {
            // The axis of motion only goes on: frames that come again after silence may be older than what was made up.
            head.times.due = head.times.due.max(before);
            timeline.state_came(before, head.times.due);
        }
        self.last_due = Some(head.times.due);
        self.heads.push((head, place));
    }

    /// The two states around `moment`, or the two newest if it is later; one and the same if there is but one.
    pub(super) fn around(&self, moment: Instant, timeline: &Timeline) -> Option<Between> {
        let (last, rest) = self.heads.split_last()?;
        let to = rest
            .iter()
            .skip(1)
            .position(|(head, _)| head.times.due >= moment)
            .map_or(last, |at| &rest[at + 1]);
        let from = rest
            .iter()
            .rev()
            .find(|(head, _)| head.times.number < to.0.times.number)
            .unwrap_or(to);
        Some(Between {
            places: [from.1, to.1],
            numbers: [from.0.times.number, to.0.times.number],
            alpha: timeline.alpha(from.0.times.due, to.0.times.due, moment),
        })
    }

    /// The head of the state at a place.
    pub(super) fn at(&self, place: usize) -> Option<&StateHead> {
        self.heads
            .iter()
            .find(|(_, at)| *at == place)
            .map(|(head, _)| head)
    }

    /// How far any Gaussian is, at most, from where it was in the picture before.
    ///
    /// Along the way through the states: on from the one place to the end of its piece, over whole pieces, and from the
    /// beginning of the other's to its place. `None` if that way is not known any more.
    pub(super) fn way(&self, before: Between, now: Between) -> Option<Change> {
        let scaled = |change: &Change, by: f32| Change {
            metres: change.metres * by,
            octaves: change.octaves * by,
            opacity: change.opacity * by,
        };
        let sum = |a: Change, b: Change| Change {
            metres: a.metres + b.metres,
            octaves: a.octaves + b.octaves,
            opacity: a.opacity + b.opacity,
        };
        let index = |number| (self.heads.iter()).position(|(head, _)| head.times.number == number);
        let (to_before, to_now) = (index(before.numbers[1])?, index(now.numbers[1])?);
        let head = |at: usize| self.heads.get(at).map(|(head, _)| head);
        if before.numbers == now.numbers {
            return Some(scaled(
                &head(to_now)?.change,
                (now.alpha - before.alpha).abs(),
            ));
        }
        let mut way = scaled(&head(to_before)?.change, (1.0 - before.alpha).abs());
        way = sum(way, scaled(&head(to_now)?.change, now.alpha));
        for at in to_before + 1..to_now {
            way = sum(way, head(at)?.change);
        }
        Some(way)
    }
}

impl StateHead {
    /// How far its Gaussians went from those of the state before, as the kernels say that made them.
    pub(super) fn moved(&mut self, change: StateChange) {
        self.change = Change {
            metres: change.moved,
            octaves: change.octaves,
            opacity: change.opacity,
        };
    }

    /// Of a pose whose graph ran; when the state is ready is known when its Gaussians are.
    pub(super) fn new(pose: &Pose) -> Self {
        Self {
            times: pose.times,
            motion: pose.motion.clone(),
            change: Change::default(),
        }
    }
}

/// The Gaussians of states, each at its place.
#[derive(Debug)]
pub(super) struct States([GaussianState; STATES]);

impl States {
    /// Room for states of so many Gaussians.
    pub(super) fn new(count: usize) -> Self {
        Self(std::array::from_fn(|_| GaussianState::new(count)))
    }

    /// The state at `place`, to be written, beside the one at `before`.
    pub(super) fn writing(
        &mut self,
        place: usize,
        before: Option<usize>,
    ) -> (&mut GaussianState, Option<&GaussianState>) {
        // The state before is never at the place that is written.
        let (low, high) = self.0.split_at_mut(place.max(before.unwrap_or(0)) % STATES);
        match before {
            Some(before) if before < place => (&mut high[0], low.get(before)),
            Some(before) if before > place => (&mut low[place], high.first()),
            _ => (&mut high[0], None),
        }
    }

    /// Two states, which may be one.
    pub(super) fn reading(&self, places: [usize; 2]) -> [&GaussianState; 2] {
        places.map(|place| &self.0[place % STATES])
    }
}
