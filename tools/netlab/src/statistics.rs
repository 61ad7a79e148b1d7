//! The lab's statistics: counts per direction, and bitrates for each second to be drawn.

use std::time::Duration;

use serde::Serialize;

use crate::link::{Backlog, Cause};

/// What IPv4 (20) and UDP (8) put around every datagram, in bytes.
pub const IP_UDP_HEADERS: u64 = 28;

/// Packets and their bytes, IPv4 and UDP headers included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Count {
    /// Packets.
    pub packets: u64,
    /// Bytes with headers.
    pub bytes: u64,
}

impl Count {
    fn add(&mut self, bytes: u64) {
        self.packets += 1;
        self.bytes += bytes;
    }
}

/// Packets lost, by cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Lost {
    /// By chance, as asked.
    pub chance: u64,
    /// The bottleneck's queue was full.
    pub queue: u64,
    /// In an outage.
    pub outage: u64,
    /// The lab could not send it: the other side's address was not known yet, or the system refused.
    pub undeliverable: u64,
}

impl Lost {
    /// Of all causes.
    pub fn total(&self) -> u64 {
        self.chance + self.queue + self.outage + self.undeliverable
    }
}

/// One second of one direction, in kbit/s with headers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Second {
    /// What was sent into the lab.
    pub offered_kbit_s: f64,
    /// What came out.
    pub delivered_kbit_s: f64,
}

/// One direction, over all calls.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct DirectionStatistics {
    /// Sent into the lab.
    pub offered: Count,
    /// Came out of the lab, copies included.
    pub delivered: Count,
    /// Lost.
    pub lost: Lost,
    /// Came out a second time.
    pub duplicated: u64,
    /// Came out after a packet that had been sent later.
    pub reordered: u64,
    /// The most that waited before the bottleneck of one call, in bytes with headers.
    pub max_queue_bytes: u64,
    /// The longest a packet would have had to wait there, in milliseconds.
    pub max_queue_ms: f64,
    /// Each second since the lab was started.
    pub seconds: Vec<Second>,
}

impl DirectionStatistics {
    fn second(&mut self, now: Duration) -> Option<&mut Second> {
        // A day: bounds the memory of a lab that keeps running.
        let index = usize::try_from(now.as_secs())
            .ok()
            .filter(|&i| i < 86_400)?;
        if self.seconds.len() <= index {
            self.seconds.resize(index + 1, Second::default());
        }
        self.seconds.get_mut(index)
    }

    pub(crate) fn offer(&mut self, now: Duration, bytes: u64, backlog: Backlog) {
        self.offered.add(bytes);
        self.max_queue_bytes = self.max_queue_bytes.max(backlog.bytes);
        self.max_queue_ms = self.max_queue_ms.max(backlog.wait.as_secs_f64() * 1000.0);
        if let Some(second) = self.second(now) {
            second.offered_kbit_s += kbit(bytes);
        }
    }

    pub(crate) fn lose(&mut self, cause: Cause) {
        *match cause {
            Cause::Chance => &mut self.lost.chance,
            Cause::Queue => &mut self.lost.queue,
            Cause::Outage => &mut self.lost.outage,
        } += 1;
    }

    pub(crate) fn deliver(&mut self, now: Duration, bytes: u64) {
        self.delivered.add(bytes);
        if let Some(second) = self.second(now) {
            second.delivered_kbit_s += kbit(bytes);
        }
    }
}

fn kbit(bytes: u64) -> f64 {
    bytes as f64 * 8.0 / 1000.0
}

/// The lateness of the lab itself: the time between when a packet was due and when it was sent on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Punctuality {
    /// Tasks run at their time.
    pub done: u64,
    /// The sum of their lateness, in nanoseconds.
    pub late_total_ns: u64,
    /// The worst, in nanoseconds.
    pub late_max_ns: u64,
    /// How many were more than a millisecond late.
    pub late_over_1_ms: u64,
}

impl Punctuality {
    pub(crate) fn add(&mut self, late: Duration) {
        let late = u64::try_from(late.as_nanos()).unwrap_or(u64::MAX);
        self.done += 1;
        self.late_total_ns = self.late_total_ns.saturating_add(late);
        self.late_max_ns = self.late_max_ns.max(late);
        self.late_over_1_ms += u64::from(late > 1_000_000);
    }

    /// Mean lateness in milliseconds.
    pub fn mean_ms(&self) -> f64 {
        self.late_total_ns as f64 / 1e6 / self.done.max(1) as f64
    }
}

/// A lab's statistics since it was started.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Statistics {
    /// From the sender to the viewers, as motion goes.
    pub down: DirectionStatistics,
    /// From the viewers to the sender.
    pub up: DirectionStatistics,
    /// Calls whose session descriptions went through the lab, a reconnection counting again.
    pub calls: u64,
    /// Datagrams from an address that is neither of a call's two.
    pub strangers: u64,
    /// The lab's own accuracy.
    pub punctuality: Punctuality,
}
