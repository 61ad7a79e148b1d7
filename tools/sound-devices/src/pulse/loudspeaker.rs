//! The loudspeaker.

use crate::clock::DeviceClock;
use crate::pulse::connection::{Connection, Message, SoundServer};
use crate::pulse::device::{Device, Stream};
use crate::pulse::stream::{self, LONGEST_SILENCE, MEASURING, PIECE, SAMPLE_BYTES};
use crate::{Fill, SoundError};
use pulseaudio::protocol::stream::{BufferAttr, StreamFlags};
use pulseaudio::protocol::{
    ChannelMap, ChannelVolume, Command, CreatePlaybackStreamReply, LatencyParams, PlaybackLatency,
    PlaybackStreamParams, ServerInfo, SinkInfoList,
};
use std::ffi::CString;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// Bytes of one moment, left and right ...
const FRAME_BYTES: u32 = 2 * SAMPLE_BYTES;
/// ... and of a piece.
const PIECE_BYTES: u32 = 480 * FRAME_BYTES;
/// What the server and the device hold together: as little as plays without a gap.
const AHEAD_BYTES: u32 = 4 * PIECE_BYTES;
/// The most that a server may ask for at a time.
const MOST_ASKED: u32 = 16 * AHEAD_BYTES;
/// Between two looks whether it is to stop.
const STOPPING: Duration = Duration::from_millis(100);

/// A loudspeaker that plays while this is there, again after it was away.
#[derive(Debug)]
pub struct Loudspeaker {
    name: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Loudspeaker {
    /// Plays what `fill` makes on the loudspeaker of that name, as the server calls it (`pactl list short sinks`), or on the server's own choice.
    ///
    /// # Errors
    /// If the server does not answer, or has no such loudspeaker.
    pub fn begin(server: &SoundServer, name: Option<&str>, fill: Fill) -> Result<Self, SoundError> {
        let device = Device::open(server, name)?;
        let name = device.name().to_owned();
        let stop = Arc::<AtomicBool>::default();
        let thread = std::thread::Builder::new()
            .name("loudspeaker".to_owned())
            .spawn({
                let stop = Arc::clone(&stop);
                move || play(device, fill, &stop)
            })?;
        Ok(Self {
            name,
            stop,
            thread: Some(thread),
        })
    }

    /// What the server calls it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl Drop for Loudspeaker {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            log::error!("the thread of the loudspeaker has failed");
        }
    }
}

/// Plays until it is to stop.
fn play(mut device: Device<Playing>, mut fill: Fill, stop: &AtomicBool) {
    while !stop.load(Relaxed) {
        match device.stream() {
            Some(playing) => {
                if let Err(error) = playing.go_on(&mut fill) {
                    device.lose(&error);
                }
            }
            None => device.look(Instant::now() + STOPPING),
        }
    }
}

struct Playing {
    connection: Connection,
    channel: u32,
    clock: DeviceClock,
    /// Samples of a channel sent.
    count: u64,
    /// Bytes that the server has asked for.
    asked: u32,
    /// When the server said something last: it answers measurements also where it needs no sound.
    heard: Instant,
    measured: Instant,
    /// Of the measurement that is under way.
    measuring: Option<u32>,
}

impl Stream for Playing {
    const KIND: &'static str = "loudspeaker";
    const WITHOUT: &'static str = "the call goes on unheard";

    fn choose(connection: &mut Connection, asked: Option<&str>) -> Result<String, SoundError> {
        let sinks: SinkInfoList = connection.ask(&Command::GetSinkInfoList)?;
        let names: Vec<String> = sinks
            .iter()
            .map(|sink| sink.name.to_string_lossy().into_owned())
            .collect();
        let server: ServerInfo = connection.ask(&Command::GetServerInfo)?;
        let chosen = server
            .default_sink_name
            .map(|name| name.to_string_lossy().into_owned());
        let is_there = |name: &&str| names.iter().any(|one| one == name);
        match (asked, chosen.as_deref().filter(is_there)) {
            (Some(name), _) if is_there(&name) => Ok(name.to_owned()),
            (Some(name), _) => Err(SoundError::NoSuchDevice {
                kind: Self::KIND,
                name: name.to_owned(),
                others: names,
            }),
            (None, Some(name)) => Ok(name.to_owned()),
            (None, None) => names.first().cloned().ok_or(SoundError::NoDevice {
                kind: Self::KIND,
                others: Vec::new(),
            }),
        }
    }

    fn begin(mut connection: Connection, name: &str) -> Result<Self, SoundError> {
        let stream: CreatePlaybackStreamReply =
            connection.ask(&Command::CreatePlaybackStream(PlaybackStreamParams {
                sample_spec: stream::format(2),
                channel_map: ChannelMap::stereo(),
                sink_name: CString::new(name).ok(),
                buffer_attr: BufferAttr {
                    max_length: 8 * AHEAD_BYTES,
                    target_length: AHEAD_BYTES,
                    pre_buffering: 0,
                    minimum_request_length: PIECE_BYTES,
                    ..BufferAttr::default()
                },
                cvolume: Some(ChannelVolume::norm(2)),
                flags: StreamFlags {
                    adjust_latency: true,
                    ..StreamFlags::default()
                },
                ..PlaybackStreamParams::default()
            }))?;
        let mut playing = Self {
            connection,
            channel: stream.channel,
            clock: DeviceClock::new(),
            count: 0,
            asked: 0,
            heard: Instant::now(),
            measured: Instant::now(),
            measuring: None,
        };
        // What fills the buffers at first is no one's voice.
        let silence = [[0.0; 2]; PIECE];
        for _ in 0..stream.requested_bytes.min(MOST_ASKED).div_ceil(PIECE_BYTES) {
            playing.send(&silence)?;
        }
        Ok(playing)
    }
}

impl Playing {
    fn send(&mut self, samples: &[[f32; 2]]) -> Result<(), SoundError> {
        self.count += samples.len() as u64;
        self.connection.play(self.channel, samples.as_flattened())
    }

    /// Does what the server says next, if it says something.
    fn go_on(&mut self, fill: &mut Fill) -> Result<(), SoundError> {
        let now = Instant::now();
        if now > self.measured + MEASURING {
            self.measured = now;
            self.measuring = Some(self.connection.send(&Command::GetPlaybackLatency(
                LatencyParams {
                    channel: self.channel,
                    now: SystemTime::now(),
                },
            ))?);
        }
        let message = self.connection.next(now + STOPPING)?;
        if message.is_some() {
            self.heard = Instant::now();
        } else if Instant::now() > self.heard + LONGEST_SILENCE {
            return Err(SoundError::Slow);
        }
        match message {
            Some(Message::Command(Command::Request(request))) => {
                self.asked = self.asked.saturating_add(request.length).min(MOST_ASKED);
                self.clock.observe(self.count, Instant::now());
                self.give(fill)
            }
            Some(Message::Command(Command::PlaybackStreamKilled(_))) => Err(SoundError::TakenAway),
            Some(Message::Reply { sequence, bytes }) if self.measuring == Some(sequence) => {
                self.measuring = None;
                let latency: PlaybackLatency = self.connection.read(bytes)?;
                if !latency.playing {
                    return Ok(());
                }
                let ahead = latency.write_offset.saturating_sub(latency.read_offset);
                self.clock.will_be_in_the_air(
                    stream::samples(latency.write_offset, FRAME_BYTES),
                    Instant::now(),
                    stream::seconds(ahead, FRAME_BYTES, latency.sink_usec),
                );
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Sends what the server has asked for, in whole pieces.
    fn give(&mut self, fill: &mut Fill) -> Result<(), SoundError> {
        let mut piece = [[0.0; 2]; PIECE];
        while self.asked >= PIECE_BYTES {
            self.asked -= PIECE_BYTES;
            fill(self.clock.at(self.count), self.clock.delay(), &mut piece);
            self.send(&piece)?;
        }
        Ok(())
    }
}

const _: () = assert!(
    PIECE_BYTES as usize == PIECE * FRAME_BYTES as usize,
    "of one piece"
);
