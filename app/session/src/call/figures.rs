//! What a call's frames cost in time, and what became of them.

use super::times::Times;
use app_pipeline::concealment::ConcealmentState;
use app_pipeline::profile::Percentiles;
use link_call::viewer::ViewerStatistics;
use link_codec::Micros;
use link_playout::jitter_buffer::{PlayoutStatistics, Timing};
use link_protocol::Announcement;
use link_voice::VoiceStatistics;
use serde::Serialize;

/// A pause between frames that is worth telling, and how many are told.
const GAP_MS: f64 = 250.0;
const MOST_GAPS: usize = 64;

/// Everything measured in a call.
#[derive(Debug, Clone, Serialize)]
pub struct CallFigures {
    /// What the sender announced last.
    pub announced: Announcement,
    /// Since the call was begun.
    pub seconds: f64,
    /// From there to the first frame released.
    pub first_frame_ms: Option<f64>,
    /// From the first frame to the last.
    pub live_seconds: f64,
    /// What arrived.
    pub received: ViewerStatistics,
    /// Bytes of the messages received while live, without any header, as kbit/s.
    pub payload_kbit_s: f64,
    /// Frames handed to the deform stage.
    pub released: u64,
    /// Frames that never came, by gaps in a connection's sequence: what was captured while there was none is not known here.
    pub lost: u64,
    /// Frames that came when a newer one had been released.
    pub passed: u64,
    /// Frames that came after their time and were shown all the same.
    pub late: u64,
    /// Frames that came after a newer one.
    pub reordered: u64,
    /// Frames that came twice.
    pub duplicate: u64,
    /// What became of the voice, where it was played.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voice: Option<VoiceStatistics>,
    /// Where the time goes.
    pub latency: LatencyFigures,
    /// All pauses of more than a quarter of a second from the first frame to the end of the call, together.
    pub seconds_without_motion: f64,
    /// Pauses of more than a quarter of a second between frames, the first of them.
    pub gaps: Vec<Gap>,
    /// Pictures asked for, by where their motion came from.
    pub shown: Vec<(ConcealmentState, u64)>,
}

/// Where the time from capture to the deform stage goes.
#[derive(Debug, Clone, Serialize)]
pub struct LatencyFigures {
    /// From capture to arrival, by the clocks compared over the channel.
    pub network: Option<Percentiles>,
    /// How long frames were held so that they come evenly.
    pub jitter_buffer: Option<Percentiles>,
    /// From when a frame could be had (arrived and due) to when the deform stage took it.
    pub hand_over: Option<Percentiles>,
    /// From capture to the deform stage, without the jitter buffer's part.
    pub added: Option<Percentiles>,
    /// From capture to the deform stage, all told.
    pub capture_to_deform: Option<Percentiles>,
    /// From the mouth to the ear, where a voice was heard: from the sound's capture to the air.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mouth_to_ear: Option<Percentiles>,
    /// How far apart what was heard and what was seen of one moment were, whichever was the later, where a voice was heard.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voice_apart: Option<Percentiles>,
    /// The jitter buffer's delay at the end.
    pub jitter_buffer_depth_ms: f64,
}

/// A pause between two frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// When it began, since the call was begun.
    pub at_s: f64,
    /// How long it took.
    pub ms: f64,
}

/// What has been measured so far.
#[derive(Debug)]
pub(super) struct Log {
    begun: Micros,
    first: Option<Micros>,
    last: Option<Micros>,
    released: u64,
    network: Times,
    held: Times,
    hand_over: Times,
    added: Times,
    whole: Times,
    mouth_to_ear: Times,
    apart: Times,
    gaps: Vec<Gap>,
    /// Of all gaps, milliseconds.
    gaps_ms: f64,
    shown: [u64; ConcealmentState::ALL.len()],
}

impl Log {
    pub(super) fn new(begun: Micros) -> Self {
        Self {
            begun,
            first: None,
            last: None,
            released: 0,
            network: Times::new(),
            held: Times::new(),
            hand_over: Times::new(),
            added: Times::new(),
            whole: Times::new(),
            mouth_to_ear: Times::new(),
            apart: Times::new(),
            gaps: Vec::with_capacity(MOST_GAPS),
            gaps_ms: 0.0,
            shown: [0; ConcealmentState::ALL.len()],
        }
    }

    /// A frame has left the jitter buffer for the deform stage. It is seen `lag_us` after it is due; `heard_us` is from a sound's capture, by
    /// the sender's clock, to the air, by this side's, where one was heard just now.
    pub(super) fn released(&mut self, timing: &Timing, lag_us: i64, heard_us: Option<i64>) {
        self.released += 1;
        self.first.get_or_insert(timing.released);
        if let Some(last) = self.last.replace(timing.released) {
            let ms = ms_between(last, timing.released);
            if ms > GAP_MS {
                self.gaps_ms += ms;
                if self.gaps.len() < MOST_GAPS {
                    let at_s = ms_between(self.begun, last) / 1e3;
                    self.gaps.push(Gap { at_s, ms });
                }
            }
        }
        let ready = timing.due.max(timing.arrived);
        let held = ms_between(timing.arrived, ready);
        let hand_over = ms_between(ready, timing.released);
        self.held.push(held);
        self.hand_over.push(hand_over);
        if let Some(heard_us) = heard_us {
            let seen_us = timing.due.signed() + lag_us - timing.captured.signed();
            self.apart
                .push((heard_us - seen_us).unsigned_abs() as f64 / 1e3);
            if let Some(here) = timing.captured_local {
                let clocks_us = here.signed() - timing.captured.signed();
                self.mouth_to_ear.push((heard_us - clocks_us) as f64 / 1e3);
            }
        }
        if let Some(network_us) = timing.network_us() {
            let network = network_us as f64 / 1e3;
            self.network.push(network);
            self.added.push(network + hand_over);
            self.whole.push(network + held + hand_over);
        }
    }

    /// Whether there was a frame yet.
    pub(super) fn has_begun(&self) -> bool {
        self.first.is_some()
    }

    /// A picture's motion came from this.
    pub(super) fn shown(&mut self, state: ConcealmentState) {
        if let Some(count) = self.shown.get_mut(state as usize) {
            *count += 1;
        }
    }

    pub(super) fn figures(
        &self,
        now: Micros,
        announced: &Announcement,
        received: ViewerStatistics,
        playout: PlayoutStatistics,
        voice: Option<VoiceStatistics>,
    ) -> CallFigures {
        let live_seconds = self
            .first
            .zip(self.last)
            .map_or(0.0, |(first, last)| ms_between(first, last) / 1e3);
        let since_last = self.last.map_or(0.0, |last| ms_between(last, now));
        let at_the_end = if since_last > GAP_MS { since_last } else { 0.0 };
        CallFigures {
            announced: *announced,
            seconds: ms_between(self.begun, now) / 1e3,
            first_frame_ms: self.first.map(|first| ms_between(self.begun, first)),
            live_seconds,
            payload_kbit_s: received.payload_bytes as f64 * 8e-3 / live_seconds.max(1e-3),
            received,
            released: self.released,
            lost: playout.lost,
            passed: playout.passed,
            late: playout.late,
            reordered: playout.reordered,
            duplicate: playout.duplicate,
            voice,
            latency: LatencyFigures {
                network: self.network.percentiles(),
                jitter_buffer: self.held.percentiles(),
                hand_over: self.hand_over.percentiles(),
                added: self.added.percentiles(),
                capture_to_deform: self.whole.percentiles(),
                mouth_to_ear: self.mouth_to_ear.percentiles(),
                voice_apart: self.apart.percentiles(),
                jitter_buffer_depth_ms: playout.delay.as_secs_f64() * 1e3,
            },
            seconds_without_motion: (self.gaps_ms + at_the_end) / 1e3,
            gaps: self.gaps.clone(),
            shown: ConcealmentState::ALL
                .into_iter()
                .zip(self.shown)
                .filter(|(_, count)| *count > 0)
                .collect(),
        }
    }
}

/// From `from` to `to`; negative if `to` is earlier, as a clock offset's error may make it.
fn ms_between(from: Micros, to: Micros) -> f64 {
    if to >= from {
        (to.0 - from.0) as f64 / 1e3
    } else {
        -((from.0 - to.0) as f64 / 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use link_protocol::PackageId;
    use link_protocol::announcement::{AvatarRef, ChannelMode};

    /// Frames at these times, looked at `now`, milliseconds.
    fn without_motion(frames: &[u64], now: u64) -> f64 {
        let mut log = Log::new(Micros(0));
        for at in frames {
            let at = Micros(at * 1000);
            let timing = Timing {
                captured: at,
                captured_local: None,
                arrived: at,
                due: at,
                released: at,
            };
            log.released(&timing, 0, None);
        }
        let announced = Announcement {
            avatar: AvatarRef {
                sha256: PackageId::of_bytes(b"avatar"),
                bytes: 6,
            },
            channel: ChannelMode::default(),
            codec: link_codec::Codec::default(),
            rate_hz: 30.0,
        };
        let figures = log.figures(
            Micros(now * 1000),
            &announced,
            ViewerStatistics::default(),
            PlayoutStatistics::default(),
            None,
        );
        figures.seconds_without_motion
    }

    #[test]
    fn pauses_are_told_together_with_the_one_at_the_end() {
        assert!((without_motion(&[], 5000)).abs() < 1e-9, "none began");
        assert!(
            (without_motion(&[0, 200, 400], 600)).abs() < 1e-9,
            "no pause"
        );
        assert!(
            (without_motion(&[0, 300, 400, 2400], 2500) - 2.3).abs() < 1e-9,
            "two"
        );
        assert!(
            (without_motion(&[0, 100], 4100) - 4.0).abs() < 1e-9,
            "at the end"
        );
        let many: Vec<u64> = (0..200).map(|number| number * 500).collect();
        assert!(
            (without_motion(&many, 99_500) - 99.5).abs() < 1e-9,
            "more than are listed"
        );
    }
}
