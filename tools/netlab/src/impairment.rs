//! The impairments of packets in one direction: data only; [`crate::Link`] applies them.

use std::{fmt, time::Duration};

use crate::{NetlabError, Rate};

/// A probability, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Probability(f64);

impl Probability {
    /// Checks and takes a probability.
    ///
    /// # Errors
    /// [`NetlabError::OutOfRange`] unless it is in 0..=1.
    pub fn new(value: f64) -> Result<Self, NetlabError> {
        if (0.0..=1.0).contains(&value) {
            Ok(Self(value))
        } else {
            Err(NetlabError::OutOfRange {
                what: "a probability",
                value,
                expected: "between 0 and 1",
            })
        }
    }

    /// The number.
    pub fn value(self) -> f64 {
        self.0
    }

    /// Whether a draw from 0..1 hits.
    pub(crate) fn hits(self, draw: f64) -> bool {
        draw < self.0
    }
}

/// How delay varies from packet to packet. It never reorders: a packet that would overtake waits for the one before it.
/// Where the spread is wide against the packets' spacing that waiting adds to the mean.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Jitter {
    /// No jitter.
    #[default]
    None,
    /// Evenly within the delay +- this.
    Uniform(Duration),
    /// By the normal distribution with this deviation, cut at 3 deviations and at no delay at all.
    Normal(Duration),
    /// Later by an exponential time with this mean: mostly short, sometimes long, as behind cross traffic.
    Exponential(Duration),
}

/// Which packets are lost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// Each by itself.
    Independent(Probability),
    /// Gilbert-Elliott: a good and a bad state; each packet first changes the state by chance, then is lost by its state's chance.
    Bursts {
        /// From good to bad, a packet.
        enter: Probability,
        /// From bad to good, a packet.
        leave: Probability,
        /// Chance of loss in the good state.
        good: Probability,
        /// Chance of loss in the bad state.
        bad: Probability,
    },
}

impl Default for Loss {
    fn default() -> Self {
        Self::Independent(Probability::default())
    }
}

impl Loss {
    /// Bursts in which everything is lost, given by the share of all packets lost, and a burst's mean length in packets.
    ///
    /// # Errors
    /// [`NetlabError::OutOfRange`]: the share must be below 1, the length at least 1 and not too short for so great a share.
    pub fn bursts(share: f64, mean_length: f64) -> Result<Self, NetlabError> {
        let share = Probability::new(share)?.value();
        if !(mean_length >= 1.0 && mean_length.is_finite()) {
            return Err(NetlabError::OutOfRange {
                what: "the mean length of a burst of losses",
                value: mean_length,
                expected: "at least 1 packet",
            });
        }
        // In the long run the bad state holds enter / (enter + leave) of the packets, for 1 / leave packets at a time.
        let leave = 1.0 / mean_length;
        let enter = share * leave / (1.0 - share);
        if enter.is_nan() || enter > 1.0 {
            return Err(NetlabError::OutOfRange {
                what: "the share lost in bursts",
                value: share,
                expected: "below 1, and at most length / (length + 1)",
            });
        }
        Ok(Self::Bursts {
            enter: Probability(enter),
            leave: Probability(leave),
            good: Probability(0.0),
            bad: Probability(1.0),
        })
    }

    /// The share of packets lost in the long run.
    pub fn share(self) -> f64 {
        match self {
            Self::Independent(p) => p.0,
            Self::Bursts {
                enter,
                leave,
                good,
                bad,
            } => {
                let in_bad = if enter.0 > 0.0 {
                    enter.0 / (enter.0 + leave.0)
                } else {
                    0.0
                };
                in_bad * bad.0 + (1.0 - in_bad) * good.0
            }
        }
    }
}

/// Some packets are held back, so that later ones come first.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reordering {
    /// The probability that a packet is held back.
    pub probability: Probability,
    /// By how much beyond its delay. It overtakes no packet, and no packet waits for it.
    pub hold: Duration,
}

/// How much may wait before the rate's bottleneck; what does not fit is dropped (drop-tail).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Queue {
    /// So many bytes, headers and the packet being sent included.
    Bytes(u64),
    /// A packet may wait so long before its transmission begins.
    Time(Duration),
}

impl Default for Queue {
    /// 200 ms: the buffer of a well-configured router.
    fn default() -> Self {
        Self::Time(Duration::from_millis(200))
    }
}

/// A time in which every offered packet is lost, as with a cable unplugged. Packets already under way still arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outage {
    /// When it begins, since the impairment was put in place.
    pub at: Duration,
    /// How long it lasts.
    pub length: Duration,
}

/// One direction's quality. The default is a perfect network; times in it count from when it is put in place.
///
/// A packet meets, in this order: outage, queue and rate, loss (a lost packet has used its share of the rate, as on the radio),
/// delay and jitter, reordering, duplication.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Impairment {
    /// Every packet's.
    pub delay: Duration,
    /// Around the delay.
    pub jitter: Jitter,
    /// By chance.
    pub loss: Loss,
    /// By chance.
    pub reordering: Reordering,
    /// A packet comes a second time, with a jitter of its own.
    pub duplication: Probability,
    /// The bottleneck, if there is one.
    pub rate: Option<Rate>,
    /// Before the bottleneck.
    pub queue: Queue,
    /// When no packet passes.
    pub outages: Vec<Outage>,
}

impl Impairment {
    /// Whether every packet offered at a time since the impairment was put in place is lost.
    pub fn is_out(&self, time: Duration) -> bool {
        self.outages
            .iter()
            .any(|o| time >= o.at && time < o.at.saturating_add(o.length))
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}

impl fmt::Display for Impairment {
    /// As a table's row shows it: `20 ms +-5 ms, 5 % lost, 200 kbit/s`, or `clean`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        let jitter = match self.jitter {
            Jitter::None => String::new(),
            Jitter::Uniform(spread) => format!(" +-{} ms", ms(spread)),
            Jitter::Normal(deviation) => format!(" +-{} ms normal", ms(deviation)),
            Jitter::Exponential(mean) => format!(" + about {} ms", ms(mean)),
        };
        if !self.delay.is_zero() || !jitter.is_empty() {
            parts.push(format!("{} ms{jitter}", ms(self.delay)));
        }
        if self.loss.share() > 0.0 {
            let how = if matches!(self.loss, Loss::Bursts { .. }) {
                " in bursts"
            } else {
                ""
            };
            parts.push(format!("{:.3} % lost{how}", self.loss.share() * 100.0).replace(".000", ""));
        }
        if self.reordering.probability.0 > 0.0 {
            let percent = self.reordering.probability.0 * 100.0;
            parts.push(format!("{percent} % {} ms late", ms(self.reordering.hold)));
        }
        if self.duplication.0 > 0.0 {
            parts.push(format!("{} % twice", self.duplication.0 * 100.0));
        }
        if let Some(rate) = &self.rate {
            parts.push(rate.to_string());
        }
        for outage in &self.outages {
            parts.push(format!(
                "out for {} s at {} s",
                outage.length.as_secs_f64(),
                outage.at.as_secs_f64()
            ));
        }
        if parts.is_empty() {
            parts.push("clean".to_owned());
        }
        f.write_str(&parts.join(", "))
    }
}
