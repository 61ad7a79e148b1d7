//! The microphone.

use crate::SoundError;
use crate::clock::DeviceClock;
use crate::pulse::connection::{Connection, Message, SoundServer};
use crate::pulse::device::{Device, Stream};
use crate::pulse::stream::{self, LONGEST_SILENCE, MEASURING, SAMPLE_BYTES};
use pulseaudio::protocol::stream::{BufferAttr, StreamFlags};
use pulseaudio::protocol::{
    ChannelMap, Command, CreateRecordStreamReply, LatencyParams, RecordLatency, RecordStreamParams,
    ServerInfo, SourceInfoList,
};
use std::collections::VecDeque;
use std::ffi::CString;
use std::ops::Range;
use std::time::{Duration, Instant, SystemTime};

/// Samples that may wait: what is older is of no use in a call.
const WAITING: usize = 48_000;

/// A stream that nothing was taken from for so long is begun anew where what was said does not matter.
const STALE: Duration = Duration::from_secs(1);

/// A microphone, and what becomes of it.
#[derive(Debug)]
pub struct Microphone(Device<Recording>);

#[derive(Debug)]
struct Recording {
    connection: Connection,
    channel: u32,
    clock: DeviceClock,
    /// Samples received.
    count: u64,
    waiting: VecDeque<f32>,
    last: Instant,
    measured: Instant,
    /// Of the measurement that is under way.
    measuring: Option<u32>,
}

impl Microphone {
    /// The one of that name, as the server calls it (`pactl list short sources`), or the server's own choice.
    ///
    /// # Errors
    /// If the server does not answer, or has no such microphone.
    pub fn open(server: &SoundServer, name: Option<&str>) -> Result<Self, SoundError> {
        Device::open(server, name).map(Self)
    }

    /// What the server calls it.
    #[must_use]
    pub fn name(&self) -> &str {
        self.0.name()
    }

    /// Forgets what was said up to now.
    pub fn skip(&mut self) {
        let now = Instant::now();
        // Where nothing was taken for a while, much waits: a new stream instead.
        let is_stale = |recording: &Recording| now > recording.last + STALE;
        if self.0.stream().is_some_and(|recording| is_stale(recording)) {
            self.0.begin_anew();
        }
        while let Some(recording) = self.0.stream() {
            recording.waiting.clear();
            match recording.receive(now) {
                Ok(true) => {}
                Ok(false) => return,
                Err(error) => self.0.lose(&error),
            }
        }
    }

    /// Waits for as many samples as `out` takes, for `longest` at most; when the first of them was in the air. `None` if there are none,
    /// also while the microphone is away: it is taken up again when it is back.
    pub fn next(&mut self, out: &mut [f32], longest: Duration) -> Option<Instant> {
        let until = Instant::now() + longest;
        loop {
            match self.0.stream() {
                Some(recording) => match recording.next(out, until) {
                    Ok(spoken) => return spoken,
                    Err(error) => self.0.lose(&error),
                },
                None if Instant::now() >= until => return None,
                None => self.0.look(until),
            }
        }
    }
}

impl Stream for Recording {
    const KIND: &'static str = "microphone";
    const WITHOUT: &'static str = "the call goes on without it";

    fn choose(connection: &mut Connection, asked: Option<&str>) -> Result<String, SoundError> {
        let sources: SourceInfoList = connection.ask(&Command::GetSourceInfoList)?;
        let names: Vec<String> = sources
            .iter()
            .map(|source| source.name.to_string_lossy().into_owned())
            .collect();
        if let Some(name) = asked {
            return if names.iter().any(|one| one == name) {
                Ok(name.to_owned())
            } else {
                Err(SoundError::NoSuchDevice {
                    kind: Self::KIND,
                    name: name.to_owned(),
                    others: names,
                })
            };
        }
        let server: ServerInfo = connection.ask(&Command::GetServerInfo)?;
        let chosen = server.default_source_name;
        // What is heard on a loudspeaker is no one's voice.
        let is_real =
            |source: &&pulseaudio::protocol::SourceInfo| source.monitor_of_sink_index.is_none();
        let mut real = sources.iter().filter(is_real);
        let default = real
            .clone()
            .find(|source| Some(&source.name) == chosen.as_ref());
        match default.or_else(|| real.next()) {
            Some(source) => Ok(source.name.to_string_lossy().into_owned()),
            None => Err(SoundError::NoDevice {
                kind: Self::KIND,
                others: names,
            }),
        }
    }

    fn begin(mut connection: Connection, name: &str) -> Result<Self, SoundError> {
        let stream: CreateRecordStreamReply =
            connection.ask(&Command::CreateRecordStream(RecordStreamParams {
                sample_spec: stream::format(1),
                channel_map: ChannelMap::mono(),
                source_name: CString::new(name).ok(),
                buffer_attr: BufferAttr {
                    fragment_size: PIECE_BYTES,
                    ..BufferAttr::default()
                },
                flags: StreamFlags {
                    adjust_latency: true,
                    // What another device hears is not what was asked for.
                    no_move: true,
                    ..StreamFlags::default()
                },
                ..RecordStreamParams::default()
            }))?;
        let now = Instant::now();
        Ok(Self {
            connection,
            channel: stream.channel,
            clock: DeviceClock::new(),
            count: 0,
            waiting: VecDeque::with_capacity(2 * WAITING),
            last: now,
            measured: now,
            measuring: None,
        })
    }
}

impl Recording {
    fn next(&mut self, out: &mut [f32], until: Instant) -> Result<Option<Instant>, SoundError> {
        while self.waiting.len() < out.len() {
            if !self.receive(until)? && Instant::now() >= until {
                return Ok(None);
            }
        }
        let first = self.count - self.waiting.len() as u64;
        // What was received beyond them waits for the next call.
        let taken = self.waiting.drain(..out.len());
        for (out, sample) in out.iter_mut().zip(taken) {
            *out = if sample.is_finite() {
                sample.clamp(-1.0, 1.0)
            } else {
                0.0
            };
        }
        let handed = self.clock.at(first);
        Ok(Some(
            handed.checked_sub(self.clock.delay()).unwrap_or(handed),
        ))
    }

    /// Takes what comes next; whether anything did.
    fn receive(&mut self, until: Instant) -> Result<bool, SoundError> {
        let now = Instant::now();
        if now > self.measured + MEASURING {
            self.measured = now;
            self.measuring = Some(self.connection.send(&Command::GetRecordLatency(
                LatencyParams {
                    channel: self.channel,
                    now: SystemTime::now(),
                },
            ))?);
        }
        // What has come is read first: nobody may have asked for a long time.
        let silent = (self.last + LONGEST_SILENCE).max(now);
        match self.connection.next(until.min(silent))? {
            None if Instant::now() > self.last + LONGEST_SILENCE => return Err(SoundError::Slow),
            None => return Ok(false),
            Some(Message::Samples(bytes)) => self.take(bytes),
            Some(Message::Reply { sequence, bytes }) if self.measuring == Some(sequence) => {
                self.measuring = None;
                let latency: RecordLatency = self.connection.read(bytes)?;
                if self.count == 0 {
                    return Ok(true);
                }
                let behind = latency.write_offset.saturating_sub(latency.read_offset);
                // What the server had sent before its answer has been read before it. Its own count may hold samples that it had to drop.
                self.clock.was_in_the_air(
                    self.count,
                    Instant::now(),
                    stream::seconds(behind, SAMPLE_BYTES, latency.source_usec),
                );
            }
            Some(Message::Command(Command::RecordStreamKilled(_))) => {
                return Err(SoundError::TakenAway);
            }
            Some(Message::Reply { .. } | Message::Command(_)) => {}
        }
        Ok(true)
    }

    fn take(&mut self, bytes: Range<usize>) {
        self.last = Instant::now();
        let (samples, _) = self.connection.payload(bytes).as_chunks::<4>();
        let more = samples.iter().map(|bytes| f32::from_le_bytes(*bytes));
        self.waiting.extend(more);
        self.count += samples.len() as u64;
        let late = self.waiting.len().saturating_sub(WAITING);
        self.waiting.drain(..late);
        // Its last sample was known when it came.
        self.clock.observe(self.count, self.last);
    }
}

/// Bytes of a piece, 10 ms.
const PIECE_BYTES: u32 = 480 * SAMPLE_BYTES;
const _: () = assert!(SAMPLE_BYTES == 4, "as many as are read");
