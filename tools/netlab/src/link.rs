//! One direction of one path: the fate of each offered packet, from its size and time. No sockets, no clock.
//!
//! Every packet takes the same number of random draws in the same order, whatever its fate. So the fate of the nth packet depends
//! on the seed and n alone, not on its neighbours' times; only queue and outage depend on time.

use std::{collections::VecDeque, f64::consts::TAU, time::Duration};

use crate::{
    Impairment, Queue,
    impairment::{Jitter, Loss},
};

/// Why a packet was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// [`Impairment::loss`].
    Chance,
    /// The queue before the bottleneck was full.
    Queue,
    /// [`Impairment::outages`].
    Outage,
}

/// The fate of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It comes at a time, and perhaps a second time. Times are on the same clock as [`Link::offer`]'s.
    Delivered {
        /// The first time.
        at: Duration,
        /// The second time, never before the first.
        copy_at: Option<Duration>,
    },
    /// It is lost.
    Lost(Cause),
}

/// The queue before the bottleneck.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Backlog {
    /// With headers, and with the packet that is being sent.
    pub bytes: u64,
    /// How long a packet offered now would wait.
    pub wait: Duration,
}

/// One direction of one path.
#[derive(Debug)]
pub struct Link {
    impairment: Impairment,
    rng: fastrand::Rng,
    /// When the impairment was put in place.
    epoch: Duration,
    in_burst: bool,
    busy_until: Duration,
    /// When each packet that waits will have left, and its bytes.
    waiting: VecDeque<(Duration, u64)>,
    waiting_bytes: u64,
    newest_due: Duration,
}

/// The chances of one packet, all uniform in 0..1.
struct Draws {
    burst: f64,
    loss: f64,
    reordering: f64,
    duplication: f64,
    jitter: [f64; 2],
    copy_jitter: [f64; 2],
}

impl Draws {
    fn take(rng: &mut fastrand::Rng) -> Self {
        Self {
            burst: rng.f64(),
            loss: rng.f64(),
            reordering: rng.f64(),
            duplication: rng.f64(),
            jitter: [rng.f64(), rng.f64()],
            copy_jitter: [rng.f64(), rng.f64()],
        }
    }
}

impl Link {
    /// A link with an impairment put in place at `now`.
    pub fn new(impairment: Impairment, seed: u64, now: Duration) -> Self {
        Self {
            impairment,
            rng: fastrand::Rng::with_seed(seed),
            epoch: now,
            in_burst: false,
            busy_until: now,
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            newest_due: now,
        }
    }

    /// Puts another impairment in place. What has been offered keeps its fate; the seed's sequence goes on.
    pub fn set(&mut self, impairment: Impairment, now: Duration) {
        self.impairment = impairment;
        self.epoch = now;
    }

    /// Decides about a packet. `now` does not go back; `bytes` is its size with all headers.
    pub fn offer(&mut self, now: Duration, bytes: u64) -> Fate {
        let draws = Draws::take(&mut self.rng);
        let is_lost = self.strikes(&draws);
        if self.impairment.is_out(now.saturating_sub(self.epoch)) {
            return Fate::Lost(Cause::Outage);
        }
        let Some(departs) = self.transmit(now, bytes) else {
            return Fate::Lost(Cause::Queue);
        };
        if is_lost {
            return Fate::Lost(Cause::Chance);
        }

        let mut at = departs.saturating_add(self.delay(draws.jitter));
        let reordering = self.impairment.reordering;
        if reordering.probability.hits(draws.reordering) {
            at = at.saturating_add(reordering.hold);
        } else {
            at = at.max(self.newest_due);
            self.newest_due = at;
        }
        let copy_at = self
            .impairment
            .duplication
            .hits(draws.duplication)
            .then(|| {
                departs
                    .saturating_add(self.delay(draws.copy_jitter))
                    .max(at)
            });
        Fate::Delivered { at, copy_at }
    }

    /// The queue at a time, which does not go back.
    pub fn backlog(&mut self, now: Duration) -> Backlog {
        while let Some(&(departs, bytes)) = self.waiting.front()
            && departs <= now
        {
            self.waiting.pop_front();
            self.waiting_bytes -= bytes;
        }
        Backlog {
            bytes: self.waiting_bytes,
            wait: self.busy_until.saturating_sub(now),
        }
    }

    fn strikes(&mut self, draws: &Draws) -> bool {
        match self.impairment.loss {
            Loss::Independent(probability) => probability.hits(draws.loss),
            Loss::Bursts {
                enter,
                leave,
                good,
                bad,
            } => {
                let change = if self.in_burst { leave } else { enter };
                self.in_burst ^= change.hits(draws.burst);
                if self.in_burst { bad } else { good }.hits(draws.loss)
            }
        }
    }

    /// When the packet has left the bottleneck; `None` if the queue has no room.
    fn transmit(&mut self, now: Duration, bytes: u64) -> Option<Duration> {
        let backlog = self.backlog(now);
        let Some(rate) = &self.impairment.rate else {
            // A bottleneck that was lifted may still be sending what it had.
            return Some(now);
        };
        let has_room = match self.impairment.queue {
            Queue::Bytes(bound) => backlog.bytes + bytes <= bound,
            Queue::Time(bound) => backlog.wait <= bound,
        };
        if !has_room {
            return None;
        }
        let start = self.busy_until.max(now).max(self.epoch) - self.epoch;
        self.busy_until = self.epoch.saturating_add(rate.finish(start, bytes));
        self.waiting.push_back((self.busy_until, bytes));
        self.waiting_bytes += bytes;
        Some(self.busy_until)
    }

    fn delay(&self, draws: [f64; 2]) -> Duration {
        let [first, second] = draws;
        let jitter = match self.impairment.jitter {
            Jitter::None => return self.impairment.delay,
            Jitter::Uniform(spread) => (2.0 * first - 1.0) * spread.as_secs_f64(),
            Jitter::Normal(deviation) => {
                // Box and Muller; 1 - first keeps the logarithm off zero.
                let z = (-2.0 * (1.0 - first).ln()).sqrt() * (TAU * second).cos();
                z.clamp(-3.0, 3.0) * deviation.as_secs_f64()
            }
            Jitter::Exponential(mean) => -(1.0 - first).ln() * mean.as_secs_f64(),
        };
        let seconds = (self.impairment.delay.as_secs_f64() + jitter).max(0.0);
        Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
    }
}

#[cfg(test)]
#[path = "link_tests.rs"]
mod tests;
