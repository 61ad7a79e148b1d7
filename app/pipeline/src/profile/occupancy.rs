//! How busy lanes and units are, and how much of the time they are busy at once: whether three units really work in parallel.

use super::recorded::nanoseconds;
use crate::profile::Recording;
use crate::stage::{Lane, Stage, Unit};
use serde::Serialize;

/// Shares of the measured time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Occupancy {
    /// How much of the time each lane works, in the order of [`Lane::ALL`].
    pub lanes: Vec<Busy<Lane>>,
    /// The same for units: whatever lane, provider or stage keeps them busy.
    pub units: Vec<Busy<Unit>>,
    /// For each pair of lanes how much of the time both work.
    pub pairs: Vec<Overlap>,
    /// How much of the time exactly so many lanes work: none, one, two, three, four. Adds up to 1.
    pub at_once: [f64; Lane::ALL.len() + 1],
}

/// How busy something is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Busy<T> {
    /// What.
    pub who: T,
    /// Share of the time in which it works.
    pub share: f64,
}

/// How much of the time two lanes both work.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Overlap {
    /// Which two.
    pub lanes: [Lane; 2],
    /// Share of the time.
    pub share: f64,
}

impl Occupancy {
    /// Counts the time of `recording`; `unit_of` tells where each stage ran.
    #[must_use]
    pub fn new(recording: &Recording, unit_of: impl Fn(Stage) -> Unit) -> Self {
        let length = nanoseconds(recording.begin, recording.end);
        let intervals = |member: &dyn Fn(&crate::profile::Span) -> usize| -> Vec<Interval> {
            let interval = |span: &crate::profile::Span| Interval {
                member: member(span),
                begin: nanoseconds(recording.begin, span.begin),
                end: nanoseconds(recording.begin, span.end),
            };
            recording.spans.iter().map(interval).collect()
        };
        let lanes = together::<{ Lane::ALL.len() }>(&intervals(&|span| span.lane as usize), length);
        let units = together::<{ Unit::ALL.len() }>(
            &intervals(&|span| unit_of(span.stage) as usize),
            length,
        );
        let mut at_once = [0.0; Lane::ALL.len() + 1];
        for (mask, share) in lanes.iter().enumerate() {
            at_once[mask.count_ones() as usize] += share;
        }
        let pairs = Lane::ALL.into_iter().enumerate().flat_map(|(k, one)| {
            let others = Lane::ALL.into_iter().skip(k + 1);
            others.map(move |other| [one, other])
        });
        Self {
            pairs: pairs
                .map(|[one, other]| Overlap {
                    lanes: [one, other],
                    share: all_of(&lanes, (1 << one as usize) | (1 << other as usize)),
                })
                .collect(),
            lanes: busy(Lane::ALL, &lanes),
            units: busy(Unit::ALL, &units),
            at_once,
        }
    }
}

fn busy<T: Copy, const N: usize>(all: [T; N], shares: &[f64]) -> Vec<Busy<T>> {
    let one = |(k, who)| Busy {
        who,
        share: all_of(shares, 1_usize << k),
    };
    all.into_iter().enumerate().map(one).collect()
}

/// How much of the time all members of `mask` are busy, whatever the others do.
fn all_of(shares: &[f64], mask: usize) -> f64 {
    let with = shares
        .iter()
        .enumerate()
        .filter(|(who, _)| who & mask == mask);
    with.map(|(_, share)| share).sum()
}

/// One member's work, nanoseconds since the measuring began.
#[derive(Debug, Clone, Copy)]
struct Interval {
    member: usize,
    begin: i64,
    end: i64,
}

/// For each set of `MEMBERS` members (bit k: member k) the share of 0..`length` in which exactly they are busy. A member's
/// intervals may overlap: what is busy twice is busy.
fn together<const MEMBERS: usize>(intervals: &[Interval], length: i64) -> Vec<f64> {
    let mut shares = vec![0.0; 1 << MEMBERS];
    if length <= 0 {
        shares[0] = 1.0;
        return shares;
    }
    let mut changes: Vec<(i64, usize, i32)> = Vec::with_capacity(2 * intervals.len());
    for interval in intervals {
        let (begin, end) = (
            interval.begin.clamp(0, length),
            interval.end.clamp(0, length),
        );
        if begin < end && interval.member < MEMBERS {
            changes.extend([(begin, interval.member, 1), (end, interval.member, -1)]);
        }
    }
    changes.sort_unstable();
    let mut depth = [0; MEMBERS];
    let mut last = 0;
    for (at, member, change) in changes.into_iter().chain([(length, 0, 0)]) {
        let busy = depth.iter().enumerate().filter(|(_, depth)| **depth > 0);
        let mask: usize = busy.map(|(k, _)| 1 << k).sum();
        shares[mask] += (at - last) as f64 / length as f64;
        if let Some(depth) = depth.get_mut(member) {
            *depth += change;
        }
        last = at;
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn shares_are_those_of_a_raster_of_milliseconds(
            work in proptest::collection::vec((0_usize..4, -50_i64..400, 0_i64..120), 0..40),
            length in 1_i64..300,
        ) {
            let intervals: Vec<Interval> = work.iter().map(|&(member, begin, takes)| Interval {
                member,
                begin: begin * 1_000_000,
                end: (begin + takes) * 1_000_000,
            }).collect();
            let shares = together::<4>(&intervals, length * 1_000_000);
            // Independent: each millisecond asks everybody.
            let mut raster = [0_u32; 16];
            for at in 0..length {
                let mut who = [false; 4];
                for &(member, begin, takes) in &work {
                    who[member] |= begin <= at && at < begin + takes;
                }
                let set = who.iter().rev().fold(0, |set, busy| set * 2 + usize::from(*busy));
                raster[set] += 1;
            }
            for (set, (share, cells)) in shares.iter().zip(raster).enumerate() {
                let expected = f64::from(cells) / length as f64;
                prop_assert!((share - expected).abs() < 1e-9, "{set:04b}: {share}, in the raster {expected}");
            }
        }
    }
}
