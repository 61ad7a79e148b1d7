//! From capture to display: each picture's latency in parts that add up to the whole, as the paper's figure of its end-to-end
//! latency (section "End-to-End Latency Evaluation") breaks it down.
//!
//! What a picture shows lies between two captured poses; it was "captured" at the same place between their two times. The
//! parts follow the newer one, and what interpolation holds back on purpose is a part of its own.

use super::recorded::{ms, nanoseconds};
use crate::profile::{Percentiles, PictureTimes};
use serde::Serialize;
use std::time::Duration;

/// A part of the way from capture to display, in the order of that way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// The sender's encoder, as the sender measured it on average.
    Encode,
    /// From there until the datagram is here.
    Network,
    /// Held so that frames come evenly.
    JitterBuffer,
    /// From when the frame could be had until the deform graph begins with it.
    HandOver,
    /// The deform graph.
    Inference,
    /// Until the state of Gaussians is ready.
    Bind,
    /// What showing an older moment than the newest state's costs, and waiting for the display's turn: constant, one
    /// motion period, when interpolation runs evenly. Extrapolation may make it negative.
    Hold,
    /// Interpolation.
    Interpolate,
    /// From there until the GPU lane begins; where the device interpolates, what it does before: upload, and posing of a state.
    WaitForGpu,
    /// Upload, projection and sort.
    ProjectAndSort,
    /// Tile lists and raster.
    Splat,
    /// From the drawn picture to the vertical blank that shows it.
    WaitForDisplay,
}

impl Part {
    /// All parts in order.
    pub const ALL: [Self; 12] = [
        Self::Encode,
        Self::Network,
        Self::JitterBuffer,
        Self::HandOver,
        Self::Inference,
        Self::Bind,
        Self::Hold,
        Self::Interpolate,
        Self::WaitForGpu,
        Self::ProjectAndSort,
        Self::Splat,
        Self::WaitForDisplay,
    ];

    /// The part's name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Encode => "encode",
            Self::Network => "network",
            Self::JitterBuffer => "jitter buffer",
            Self::HandOver => "hand-over to inference",
            Self::Inference => "inference",
            Self::Bind => "bind",
            Self::Hold => "hold for interpolation",
            Self::Interpolate => "interpolate",
            Self::WaitForGpu => "wait for the GPU",
            Self::ProjectAndSort => "project and sort",
            Self::Splat => "splat",
            Self::WaitForDisplay => "wait for the display",
        }
    }
}

impl Serialize for Part {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Where a picture's latency is counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Since {
    /// The sender's capture, by clocks compared over the channel.
    Capture,
    /// Arrival here: the capture times of its poses are unknown. Encode and network are none then.
    Arrival,
}

/// One picture's latency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PictureLatency {
    /// Where it is counted from.
    pub since: Since,
    /// Nanoseconds of each part, in the order of [`Part::ALL`]. A network part below zero is the clock comparison's error.
    pub parts: [i64; Part::ALL.len()],
}

impl PictureLatency {
    /// Takes `picture`'s way apart; `encode` is what the sender needs on average, if it has told.
    #[must_use]
    pub fn new(picture: &PictureTimes, encode: Option<Duration>) -> Self {
        let (from, to) = (&picture.from, &picture.to);
        let captured = from.captured.zip(to.captured);
        let (since, [before, begun]) = match captured {
            Some((before, begun)) => (Since::Capture, [before, begun]),
            None => (Since::Arrival, [from.arrived, to.arrived]),
        };
        // From the moment that the picture shows to the newer state's.
        #[expect(
            clippy::cast_possible_truncation,
            reason = "rounds nanoseconds to a whole number"
        )]
        let behind =
            ((1.0 - f64::from(picture.alpha)) * nanoseconds(before, begun) as f64).round() as i64;
        let transit = nanoseconds(begun, to.arrived);
        let encode = encode.map_or(0, |encode| {
            i64::try_from(encode.as_nanos()).unwrap_or(i64::MAX)
        });
        let encode = encode.min(transit.max(0));
        // When the frame could be had: neither before it was here nor after it was taken.
        let had = to.due.min(to.released).max(to.arrived);
        let [inference, deformed] = to.inference;
        let [interpolation, interpolated] = picture.interpolation;
        // A device that poses interpolates as a part of the picture, after what else it must do first.
        let first = interpolation.min(picture.begun);
        let on_the_device = nanoseconds(picture.begun, interpolation).max(0);
        let waits = nanoseconds(interpolated, picture.begun).max(0) + on_the_device;
        Self {
            since,
            parts: [
                encode,
                transit - encode,
                nanoseconds(to.arrived, had),
                nanoseconds(had, inference),
                nanoseconds(inference, deformed),
                nanoseconds(deformed, to.ready),
                behind + nanoseconds(to.ready, first),
                nanoseconds(interpolation, interpolated),
                waits,
                nanoseconds(picture.begun.max(interpolated), picture.sorted),
                nanoseconds(picture.sorted, picture.drawn),
                nanoseconds(picture.drawn, picture.displayed),
            ],
        }
    }

    /// From what the picture shows to when it is shown, nanoseconds: the parts' sum.
    #[must_use]
    pub fn whole(&self) -> i64 {
        self.parts.iter().sum()
    }
}

/// The latency of all pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LatencyBreakdown {
    /// Where it is counted from: the capture if that is known of any picture.
    pub since: Since,
    /// Pictures that are not counted, because their capture is unknown where others' is known: no frame brought them.
    pub left_out: usize,
    /// The whole.
    pub whole: Percentiles,
    /// The parts, in the order of the way. Their means add up to the whole's; their percentiles do not, because not all
    /// parts are long in the same picture.
    pub parts: Vec<PartLatency>,
}

/// One part's share of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartLatency {
    /// Which.
    pub part: Part,
    /// How long it takes.
    #[serde(flatten)]
    pub times: Percentiles,
}

impl LatencyBreakdown {
    /// Of `pictures`; `None` without any.
    #[must_use]
    pub fn new<'a>(
        pictures: impl IntoIterator<Item = &'a PictureTimes>,
        encode: Option<Duration>,
    ) -> Option<Self> {
        let all = pictures
            .into_iter()
            .map(|one| PictureLatency::new(one, encode));
        let (captured, others): (Vec<_>, Vec<_>) = all.partition(|one| one.since == Since::Capture);
        let (since, counted, left_out) = if captured.is_empty() {
            (Since::Arrival, others, 0)
        } else {
            (Since::Capture, captured, others.len())
        };
        let of = |time: &dyn Fn(&PictureLatency) -> i64| {
            let times: Vec<f64> = counted.iter().map(|one| ms(time(one))).collect();
            Percentiles::of(&times)
        };
        let parts = Part::ALL.into_iter().enumerate().map(|(k, part)| {
            let times = of(&|one| one.parts[k])?;
            Some(PartLatency { part, times })
        });
        let is_known = |part: Part| {
            (since == Since::Capture || !matches!(part, Part::Encode | Part::Network))
                && (encode.is_some() || part != Part::Encode)
        };
        Some(Self {
            since,
            left_out,
            whole: of(&PictureLatency::whole)?,
            parts: parts.flatten().filter(|one| is_known(one.part)).collect(),
        })
    }
}
