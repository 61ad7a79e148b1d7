//! Packets to samples, at the time at which they are to be heard.
//!
//! A sample captured at *t* is heard at *t* plus an offset, as motion is shown ([`PlayoutDelay`]); voice waits for motion where that is the
//! later one. While the offset changes, speech runs slower or faster by single periods. What is lost is taken from the
//! coarse copy in the next packet, where that has arrived, and else concealed by Opus.

use crate::encoder::{is_active, is_silent};
use crate::{FRAME, FRAME_US, MAX_PACKET_BYTES, RATE, Voice, VoiceError, stretch};
use bytes::Bytes;
use link_codec::Micros;
use link_playout::PlayoutDelay;
use ropus::{Channels, DecodeMode, Decoder};
use serde::Serialize;
use std::collections::VecDeque;

/// Packets that may wait: 1.3 s.
const WAITING: usize = 64;
/// Ahead by more than this, speech is lengthened, and behind by more than that, shortened, samples: what is ahead would be heard before it
/// arrives, and a period is up to 12.5 ms.
const MOST_AHEAD: i64 = 96;
const MOST_BEHIND: i64 = 720;
/// Off by more than this, playout begins anew at the right place, samples.
const JUMP: i64 = 9_600;
/// Frames without a packet after which the voice has stopped: while a person speaks, and in a silence, which Opus refreshes after 20.
const LONGEST_GAP: u32 = 10;
const LONGEST_SILENCE: u32 = 50;
/// How much later than voice alone would be it may be for the sake of motion, microseconds.
const LONGEST_WAIT_US: i64 = 500_000;
/// A packet that would be heard later than this after its arrival, microseconds, is of another clock; so many in a row are believed.
const FUTURE_US: i64 = 2_000_000;
const BELIEVED: u32 = 5;
const FRAME_SAMPLES: i64 = FRAME as i64;

/// Counts since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct VoiceStatistics {
    /// Packets pushed.
    pub received: u64,
    /// Packets that are no frame of 20 ms, or whose time is out of range.
    pub refused: u64,
    /// Packets that arrived after their time, or twice.
    pub late: u64,
    /// Packets dropped because too many waited.
    pub overflowed: u64,
    /// Frames decoded from a packet of their own.
    pub decoded: u64,
    /// Frames taken from the copy in the next packet.
    pub recovered: u64,
    /// Frames without any packet while a person spoke: concealed.
    pub concealed: u64,
    /// The most of them in a row.
    pub longest_gap: u32,
    /// Frames of a silence, which need no packet.
    pub silent: u64,
    /// Periods of speech that were removed to follow the delay.
    pub shortened: u64,
    /// Periods of speech that were repeated for the same.
    pub lengthened: u64,
    /// Times that playout began at another place.
    pub jumps: u64,
    /// What is added to the shortest transit, microseconds.
    pub delay_us: u64,
}

#[derive(Debug)]
struct Waiting {
    /// Of its first sample, by the sender's clock.
    position: i64,
    opus: Bytes,
}

/// One person's voice, from packets to samples.
pub struct VoicePlayout {
    opus: Decoder,
    delay: PlayoutDelay,
    /// By position, oldest first.
    waiting: VecDeque<Waiting>,
    /// Decoded, to be heard next.
    ready: Vec<f32>,
    /// Position of the frame that is decoded next; `None` while no person speaks.
    next: Option<i64>,
    newest: Option<i64>,
    /// Packets in a row that came from the future.
    from_future: u32,
    /// A packet said that silence goes on, and none with a voice came after it.
    silent: bool,
    /// Frames without a packet, up to now.
    gap: u32,
    /// How much of them was made up while no packet was there at all, samples: whether it was lost or is late shows when one comes.
    made_up: i64,
    /// [`Self::heard_offset_us`].
    heard_offset: Option<i64>,
    counts: VoiceStatistics,
}

impl std::fmt::Debug for VoicePlayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VoicePlayout")
            .field("waiting", &self.waiting.len())
            .field("next", &self.next)
            .field("counts", &self.counts)
            .finish_non_exhaustive()
    }
}

impl VoicePlayout {
    /// Silent until packets come.
    ///
    /// # Errors
    /// If Opus cannot decode here.
    pub fn new() -> Result<Self, VoiceError> {
        Ok(Self {
            opus: Decoder::new(RATE, Channels::Mono)?,
            delay: PlayoutDelay::new(),
            waiting: VecDeque::with_capacity(WAITING),
            ready: Vec::with_capacity(4 * FRAME),
            next: None,
            newest: None,
            from_future: 0,
            silent: false,
            gap: 0,
            made_up: 0,
            heard_offset: None,
            counts: VoiceStatistics::default(),
        })
    }

    /// Begins another connection, whose times begin anew: forgets packets and delay, keeps the counts. The decoder stays: it is the same
    /// person's encoder as a rule, and of another one's packets the first is enough to go on from.
    pub fn reset(&mut self) {
        self.delay.reset();
        self.waiting.clear();
        self.newest = None;
        self.from_future = 0;
        self.stop();
    }

    /// Takes a packet that arrived at `arrived`, by this side's clock.
    pub fn push(&mut self, voice: Voice, arrived: Micros) {
        self.counts.received += 1;
        let Voice { captured, opus } = voice;
        let out_of_range = captured >= Micros::LATEST || arrived >= Micros::LATEST;
        if out_of_range || opus.is_empty() || opus.len() > MAX_PACKET_BYTES {
            self.counts.refused += 1;
            return;
        }
        let future = (self.delay.offset_us())
            .is_some_and(|offset| captured.signed() + offset > arrived.signed() + FUTURE_US);
        if future {
            self.from_future += 1;
            if self.from_future < BELIEVED {
                self.counts.refused += 1;
                return;
            }
            self.reset();
        }
        self.from_future = 0;
        let position = position(captured.signed());
        let newest = self.newest.is_none_or(|newest| position > newest);
        self.newest = self.newest.max(Some(position));
        self.delay
            .observe(captured.signed(), arrived.signed(), newest);
        let place = self.waiting.partition_point(|w| w.position < position);
        let twice = (self.waiting.get(place)).is_some_and(|w| w.position == position);
        let passed = (self.next).is_some_and(|next| position < next - FRAME_SAMPLES / 2);
        if twice || passed {
            self.counts.late += 1;
            return;
        }
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
            self.counts.overflowed += 1;
        }
        let place = self.waiting.partition_point(|w| w.position < position);
        self.waiting.insert(place, Waiting { position, opus });
    }

    /// The sound whose first sample is heard at `now`, by this side's clock; some milliseconds of it, because its last sample has to have
    /// arrived as well. `at_least` is the offset of what voice has to wait for: display by this side's clock minus capture by the
    /// sender's, microseconds.
    pub fn play(&mut self, now: Micros, at_least: Option<i64>, out: &mut [f32]) {
        out.fill(0.0);
        self.heard_offset = None;
        let Some(own) = self.offset_us(out.len()) else {
            return;
        };
        let offset = at_least.unwrap_or(own).clamp(own, own + LONGEST_WAIT_US);
        let wanted = position(now.signed().saturating_sub(offset));
        let off = self.heard().map_or(0, |heard| (wanted - heard).abs());
        if off > JUMP + self.made_up {
            self.counts.jumps += 1;
            self.stop();
        }
        if self.next.is_none() && !self.begin(wanted, out.len()) {
            return;
        }
        while self.ready.len() < out.len() && self.next.is_some() {
            self.decode_next();
            self.follow(wanted);
        }
        let count = self.ready.len().min(out.len());
        for (out, sample) in out.iter_mut().zip(self.ready.drain(..count)) {
            *out = sample;
        }
        let is_heard = self.gap == 0 && !self.silent;
        let ended = self.heard().filter(|_| is_heard);
        self.heard_offset = ended.map(|ended| now.signed() - time(ended) + micros(out.len()));
    }

    /// When the last sample that was asked for was played, by this side's clock, minus its capture by the sender's, microseconds; `None` where
    /// no one spoke then, or it was made up.
    #[must_use]
    pub fn heard_offset_us(&self) -> Option<i64> {
        self.heard_offset
    }

    /// When a sample can be played by this side's clock, where so many are asked for at a time, minus its capture by the sender's,
    /// microseconds; `None` before the first packet.
    #[must_use]
    pub fn offset_us(&self, count: usize) -> Option<i64> {
        self.delay.offset_us().map(|own| own + micros(count))
    }

    /// Counts since the start.
    #[must_use]
    pub fn statistics(&self) -> VoiceStatistics {
        VoiceStatistics {
            delay_us: self.delay.added_us(),
            ..self.counts
        }
    }

    /// Whether something that was said is still to be heard; what would be made up from here on is not.
    #[must_use]
    pub fn has_more(&self) -> bool {
        !self.waiting.is_empty() || (self.gap == 0 && !self.ready.is_empty())
    }

    /// Position of the sample that is heard next.
    fn heard(&self) -> Option<i64> {
        let ready = i64::try_from(self.ready.len()).unwrap_or(i64::MAX);
        self.next.map(|next| next - ready)
    }

    fn stop(&mut self) {
        self.ready.clear();
        self.next = None;
        self.gap = 0;
        self.made_up = 0;
        self.silent = false;
    }

    /// Begins to speak if a packet is due within the next `count` samples, at exactly its time; whether it does.
    fn begin(&mut self, wanted: i64, count: usize) -> bool {
        while let Some(first) = self.waiting.front()
            && first.position + FRAME_SAMPLES <= wanted
        {
            self.waiting.pop_front();
            self.counts.late += 1;
        }
        let Some(first) = self.waiting.front() else {
            return false;
        };
        let ahead = first.position - wanted;
        if ahead >= i64::try_from(count).unwrap_or(i64::MAX) {
            return false;
        }
        self.next = Some(first.position);
        if let Ok(silence) = usize::try_from(ahead) {
            self.ready.resize(silence, 0.0);
        } else {
            self.decode_next();
            let passed = usize::try_from(-ahead).unwrap_or(0).min(self.ready.len());
            self.ready.drain(..passed);
        }
        true
    }

    /// Decodes, recovers or conceals the frame at `next`.
    fn decode_next(&mut self) {
        let Some(next) = self.next else {
            return;
        };
        while (self.waiting.front()).is_some_and(|w| w.position < next - FRAME_SAMPLES / 2) {
            self.waiting.pop_front();
            self.counts.late += 1;
        }
        let mut next = next;
        if let Some(first) = self.waiting.front() {
            // Lost after all: what was made up stands for it.
            let lost = (first.position - next).clamp(0, self.made_up);
            next += lost / FRAME_SAMPLES * FRAME_SAMPLES;
            self.made_up = 0;
        }
        let ahead = self.waiting.front().map(|w| w.position - next);
        let here = ahead.is_some_and(|ahead| ahead < FRAME_SAMPLES / 2);
        let mut frame = [0.0; FRAME];
        if here && let Some(packet) = self.waiting.pop_front() {
            self.silent = is_silent(&packet.opus) || (self.silent && !is_active(&packet.opus));
            self.gap = 0;
            if self.decode(&packet.opus, DecodeMode::Normal, &mut frame) {
                self.counts.decoded += 1;
            } else {
                self.counts.refused += 1;
                self.conceal(&mut frame);
            }
            // Another stream may count from another place.
            self.next = Some(packet.position + FRAME_SAMPLES);
        } else {
            self.fill(next, ahead, &mut frame);
        }
        self.ready.extend_from_slice(&frame);
        let longest = if self.silent {
            LONGEST_SILENCE
        } else {
            LONGEST_GAP
        };
        if self.gap > longest {
            // The person has stopped sending, or the network has failed. What was made up has faded by now.
            self.stop();
        }
    }

    /// Makes up a frame that has no packet; the next one that has is `ahead`.
    fn fill(&mut self, next: i64, ahead: Option<i64>, frame: &mut [f32; FRAME]) {
        let copy = ahead
            .filter(|ahead| *ahead < FRAME_SAMPLES * 3 / 2)
            .and_then(|_| self.waiting.front())
            .filter(|w| has_copy(&w.opus))
            .map(|w| w.opus.clone());
        let recovered = copy.is_some_and(|packet| self.decode(&packet, DecodeMode::Fec, frame));
        if recovered {
            self.counts.recovered += 1;
        } else {
            self.conceal(frame);
            self.gap += 1;
            if self.silent {
                self.counts.silent += 1;
            } else {
                self.counts.concealed += 1;
                self.counts.longest_gap = self.counts.longest_gap.max(self.gap);
            }
        }
        if ahead.is_some() || self.silent {
            self.next = Some(next + FRAME_SAMPLES);
        } else {
            // It may only be late, and is heard then.
            self.made_up += FRAME_SAMPLES;
        }
    }

    fn conceal(&mut self, frame: &mut [f32; FRAME]) {
        if !self.decode(&[], DecodeMode::Normal, frame) {
            frame.fill(0.0);
        }
    }

    /// Whether 20 ms came of it.
    fn decode(&mut self, packet: &[u8], mode: DecodeMode, frame: &mut [f32; FRAME]) -> bool {
        matches!(self.opus.decode_float(packet, frame, mode), Ok(FRAME))
            && frame.iter().all(|sample| sample.is_finite())
    }

    /// Shortens or lengthens what is ready by one period where it is off.
    fn follow(&mut self, wanted: i64) {
        let Some(heard) = self.heard().filter(|_| self.made_up == 0) else {
            return;
        };
        if wanted - heard > MOST_BEHIND {
            self.counts.shortened += u64::from(stretch::shorten(&mut self.ready) > 0);
        } else if heard - wanted > MOST_AHEAD {
            self.counts.lengthened += u64::from(stretch::lengthen(&mut self.ready) > 0);
        }
    }
}

/// Whether a packet has a coarse copy of the frame before it: decoding one without would conceal, and say that it did not.
fn has_copy(packet: &[u8]) -> bool {
    let length = i32::try_from(packet.len()).unwrap_or(0);
    ropus::opus::decoder::opus_packet_has_lbrr(packet, length) == Ok(true)
}

/// In samples, of a time in microseconds.
fn position(micros: i64) -> i64 {
    let per_frame = FRAME_US.cast_signed();
    let (frames, rest) = (micros.div_euclid(per_frame), micros.rem_euclid(per_frame));
    frames * FRAME_SAMPLES + rest * FRAME_SAMPLES / per_frame
}

/// In microseconds, of a position.
fn time(position: i64) -> i64 {
    let per_frame = FRAME_US.cast_signed();
    let (frames, rest) = (
        position.div_euclid(FRAME_SAMPLES),
        position.rem_euclid(FRAME_SAMPLES),
    );
    frames * per_frame + rest * per_frame / FRAME_SAMPLES
}

/// In microseconds, of so many samples.
fn micros(samples: usize) -> i64 {
    i64::try_from(samples)
        .unwrap_or(0)
        .saturating_mul(1_000_000)
        / i64::from(RATE)
}
