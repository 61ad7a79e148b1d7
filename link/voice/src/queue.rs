//! From the connection that brings a person's packets to the thread that plays them, which never waits: packets go through a bounded ring
//! without a lock, the delay through an atomic.

use crate::{Voice, VoiceError, VoicePlayout, VoiceStatistics};
use link_codec::Micros;
use std::sync::atomic::{
    AtomicBool, AtomicI64, AtomicU32, AtomicU64,
    Ordering::{Acquire, Relaxed, Release},
};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Packets that may wait for the player: 1.3 s.
const PACKETS: usize = 64;
/// Says that there is nothing to wait for.
const NOTHING: i64 = i64::MIN;
/// What was told so long ago does not hold any longer, microseconds: the device that plays is away.
const STALE_US: u64 = 500_000;

/// One person's voice as it arrives. Shared by the connection, by who knows when motion is shown, and by who reports.
#[derive(Debug, Clone, Default)]
pub struct VoiceQueue(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// There where the voice is played; else packets are dropped as they come. The player never takes this lock.
    entrance: Mutex<Option<Entrance>>,
    told: Arc<Told>,
}

#[derive(Debug)]
struct Entrance {
    packets: rtrb::Producer<Queued>,
    counts: triple_buffer::Output<VoiceStatistics>,
}

/// What both ends tell each other beside the packets.
#[derive(Debug)]
struct Told {
    /// The number of the connection that packets come from.
    connection: AtomicU64,
    /// When was played last, by this side's clock, microseconds.
    played_us: AtomicU64,
    /// [`VoiceQueue::follow`]'s.
    motion_offset_us: AtomicI64,
    /// [`VoiceQueue::offset_us`]'s.
    voice_offset_us: AtomicI64,
    /// [`VoiceQueue::heard_offset_us`]'s.
    heard_offset_us: AtomicI64,
    /// Packets for which the ring had no room.
    overflowed: AtomicU64,
    /// The player has something left that was said.
    has_more: AtomicBool,
    /// [`VoiceQueue::place`]'s, as bits; not finite where there is none. Each is read by itself: three of two neighbouring moments are a place, too.
    place: [AtomicU32; 3],
}

impl Default for Told {
    fn default() -> Self {
        Self {
            connection: AtomicU64::new(0),
            played_us: AtomicU64::new(0),
            motion_offset_us: AtomicI64::new(NOTHING),
            voice_offset_us: AtomicI64::new(NOTHING),
            heard_offset_us: AtomicI64::new(NOTHING),
            overflowed: AtomicU64::new(0),
            has_more: AtomicBool::new(false),
            place: std::array::from_fn(|_| AtomicU32::new(f32::NAN.to_bits())),
        }
    }
}

impl Told {
    fn no_voice(&self) {
        self.voice_offset_us.store(NOTHING, Relaxed);
        self.heard_offset_us.store(NOTHING, Relaxed);
    }

    /// What the player told in `of`, if it still plays.
    fn still(&self, of: &AtomicI64, now: Micros) -> Option<i64> {
        let age = now.0.saturating_sub(self.played_us.load(Relaxed));
        let offset = of.load(Relaxed);
        (offset != NOTHING && age < STALE_US).then_some(offset)
    }
}

#[derive(Debug)]
struct Queued {
    voice: Voice,
    arrived: Micros,
    connection: u64,
}

impl VoiceQueue {
    /// From now on packets are kept for the player, which is to play regularly. A second one takes the place of the first.
    ///
    /// # Errors
    /// If voice cannot be decoded here.
    pub fn listen(&self) -> Result<VoicePlayer, VoiceError> {
        let playout = VoicePlayout::new()?;
        let (packets, queued) = rtrb::RingBuffer::new(PACKETS);
        let (counts, counted) = triple_buffer::TripleBuffer::default().split();
        *self.entrance() = Some(Entrance {
            packets,
            counts: counted,
        });
        Ok(VoicePlayer {
            playout,
            queued,
            counts,
            connection: self.0.told.connection.load(Acquire),
            told: Arc::clone(&self.0.told),
        })
    }

    /// A packet of this connection has arrived at `arrived`, by this side's clock.
    pub fn push(&self, voice: Voice, arrived: Micros) {
        let mut entrance = self.entrance();
        // One who has stopped playing must not hold up the end of the call.
        if entrance.as_ref().is_some_and(|e| e.packets.is_abandoned()) {
            *entrance = None;
        }
        if let Some(entrance) = &mut *entrance {
            let queued = Queued {
                voice,
                arrived,
                connection: self.0.told.connection.load(Acquire),
            };
            if entrance.packets.push(queued).is_err() {
                self.0.told.overflowed.fetch_add(1, Relaxed);
            }
        }
    }

    /// Another connection has begun: what is pushed from now on has times of its own, and what was pushed before is not played any longer.
    pub fn begin_connection(&self) {
        self.0.told.connection.fetch_add(1, Release);
        self.0.told.no_voice();
    }

    /// Voice is not to be heard before what is seen: when a frame is shown, by this side's clock, minus its capture by the sender's,
    /// microseconds.
    pub fn follow(&self, motion_offset_us: Option<i64>) {
        let offset = motion_offset_us.unwrap_or(NOTHING);
        self.0.told.motion_offset_us.store(offset, Relaxed);
    }

    /// When a sample could be heard, by this side's clock, minus its capture by the sender's, microseconds: what is seen is not to be shown
    /// before it. Nothing while no voice comes, or none is played at `now`, by this side's clock.
    #[must_use]
    pub fn offset_us(&self, now: Micros) -> Option<i64> {
        self.0.told.still(&self.0.told.voice_offset_us, now)
    }

    /// When what was heard last was in the air, by this side's clock, minus its capture by the sender's, microseconds. Nothing in a silence, or
    /// where nothing is played at `now`.
    #[must_use]
    pub fn heard_offset_us(&self, now: Micros) -> Option<i64> {
        self.0.told.still(&self.0.told.heard_offset_us, now)
    }

    /// Says where the mouth is, in the listener's head: metres, x right, y up, -z ahead; nothing where it is nowhere.
    pub fn place(&self, mouth: Option<[f32; 3]>) {
        for (place, number) in self.0.told.place.iter().zip(mouth.unwrap_or([f32::NAN; 3])) {
            place.store(number.to_bits(), Relaxed);
        }
    }

    /// Whether all that arrived has been heard, or is played by no one.
    #[must_use]
    pub fn is_played(&self) -> bool {
        match &*self.entrance() {
            Some(entrance) if !entrance.packets.is_abandoned() => {
                // In this order: the player says that it has more before it takes it.
                entrance.packets.slots() == PACKETS && !self.0.told.has_more.load(Acquire)
            }
            _ => true,
        }
    }

    /// What became of its packets; nothing where it is not played.
    #[must_use]
    pub fn statistics(&self) -> Option<VoiceStatistics> {
        let mut entrance = self.entrance();
        let counts = *entrance.as_mut()?.counts.read();
        let dropped = self.0.told.overflowed.load(Relaxed);
        Some(VoiceStatistics {
            received: counts.received + dropped,
            overflowed: counts.overflowed + dropped,
            ..counts
        })
    }

    fn entrance(&self) -> MutexGuard<'_, Option<Entrance>> {
        // Packets stay packets after a panic elsewhere.
        self.0
            .entrance
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

/// The playing end of a [`VoiceQueue`], for one thread. Playing takes no lock; it frees the packets that it has decoded.
#[derive(Debug)]
pub struct VoicePlayer {
    playout: VoicePlayout,
    queued: rtrb::Consumer<Queued>,
    counts: triple_buffer::Input<VoiceStatistics>,
    told: Arc<Told>,
    connection: u64,
}

impl VoicePlayer {
    /// The sound that is handed at `now`, by this side's clock, to a device that needs `device` to make it heard; 48 kHz. It is heard
    /// together with what is seen, if that takes longer.
    pub fn play(&mut self, now: Micros, device: Duration, out: &mut [f32]) {
        self.begin(self.told.connection.load(Acquire));
        while !self.queued.is_empty() {
            // Before each is taken: one that came in the meantime is no less to be heard.
            self.told.has_more.store(true, Release);
            let Ok(queued) = self.queued.pop() else {
                break;
            };
            self.begin(queued.connection);
            if queued.connection == self.connection {
                self.playout.push(queued.voice, queued.arrived);
            }
        }
        let device = i64::try_from(device.as_micros()).unwrap_or(i64::MAX);
        let offset = self.told.motion_offset_us.load(Relaxed);
        let offset = (offset != NOTHING).then(|| offset.saturating_sub(device));
        self.playout.play(now, offset, out);
        let has_more = self.playout.has_more();
        self.told.has_more.store(has_more, Release);
        let own = self.playout.offset_us(out.len());
        let own = own.map_or(NOTHING, |own| own.saturating_add(device));
        self.told.voice_offset_us.store(own, Relaxed);
        let heard = self.playout.heard_offset_us();
        let heard = heard.map_or(NOTHING, |heard| heard.saturating_add(device));
        self.told.heard_offset_us.store(heard, Relaxed);
        self.told.played_us.store(now.0, Relaxed);
        self.counts.write(self.playout.statistics());
    }

    /// Where the mouth is, as [`VoiceQueue::place`] was told last.
    #[must_use]
    pub fn place(&self) -> Option<[f32; 3]> {
        let bits = self
            .told
            .place
            .each_ref()
            .map(|number| number.load(Relaxed));
        Some(bits.map(f32::from_bits)).filter(|place| place.iter().all(|number| number.is_finite()))
    }

    /// Forgets what is left of the connections before this one, whether or not it brings a voice.
    fn begin(&mut self, connection: u64) {
        if connection > self.connection {
            self.connection = connection;
            self.playout.reset();
        }
    }
}

impl Drop for VoicePlayer {
    fn drop(&mut self) {
        self.told.no_voice();
    }
}
