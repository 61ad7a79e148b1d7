//! Gaze as it happens: [samples](super::sample) from standard input, or by UDP; the newest wins. A sample's seconds are by any clock of its source's.

use super::BLINK;
use super::sample::{STUMBLE, Sample, is_heading, read};
use anyhow::Context;
use std::io::{self, BufRead, ErrorKind, Read};
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

/// Bytes of a line at most, and of a datagram.
const LONGEST: usize = 1024;

/// Between two looks whether anything still needs the gaze.
const LOOK: Duration = Duration::from_millis(200);

/// Between two looks for datagrams, and how many are read at each: a flood of them costs little, and no display shows more than one gaze in it.
const REST: Duration = Duration::from_millis(2);
const MOST_AT_ONCE: usize = 16;

/// The newest sample. Copies are the same one.
#[derive(Debug, Clone)]
pub(super) struct Live(Arc<Newest>);

#[derive(Debug, Default)]
struct Newest {
    sample: Mutex<Option<(Instant, Sample)>>,
    taken: AtomicU64,
    refused: AtomicU64,
    passed_over: AtomicU64,
}

impl Live {
    /// Of this machine's standard input.
    ///
    /// # Errors
    /// If there is no thread for it.
    pub(super) fn stdin() -> anyhow::Result<Self> {
        Self::read_by(|newest| follow(io::stdin().lock(), newest))
    }

    /// Of who sends to this address of this machine, and where that is.
    ///
    /// # Errors
    /// If the address is not this machine's, or is taken.
    pub(super) fn udp(address: SocketAddr) -> anyhow::Result<(Self, SocketAddr)> {
        let bind = || {
            let socket = UdpSocket::bind(address)?;
            socket.set_read_timeout(Some(LOOK))?;
            let bound = socket.local_addr()?;
            Ok((socket, bound))
        };
        let bound: io::Result<_> = bind();
        let (socket, bound) = bound.with_context(|| format!("cannot take a gaze at {address}"))?;
        Ok((Self::read_by(move |newest| listen(&socket, newest))?, bound))
    }

    fn read_by(read: impl FnOnce(&Weak<Newest>) + Send + 'static) -> anyhow::Result<Self> {
        let live = Self(Arc::default());
        let newest = Arc::downgrade(&live.0);
        thread::Builder::new()
            .name("gaze".to_owned())
            .spawn(move || read(&newest))
            .context("cannot start a thread for the gaze")?;
        Ok(live)
    }

    /// Where is looked now; nowhere once the newest sample is older than it lasts.
    pub(super) fn at(&self, now: Instant) -> Option<Sample> {
        let (came, sample) = (*self.0.lock())?;
        (now.saturating_duration_since(came) <= sample.lasts()).then_some(sample)
    }

    /// How many samples were taken, how many lines were none, and how many samples were passed over: late, or of another sender.
    pub(super) fn counts(&self) -> [u64; 3] {
        let Newest {
            taken,
            refused,
            passed_over,
            ..
        } = &*self.0;
        [taken, refused, passed_over].map(|count| count.load(Relaxed))
    }
}

impl Newest {
    fn lock(&self) -> std::sync::MutexGuard<'_, Option<(Instant, Sample)>> {
        self.sample.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, sample: Sample) {
        *self.lock() = Some((Instant::now(), sample));
        self.taken.fetch_add(1, Relaxed);
    }

    /// What a line says, if it is no heading and no remark: its time, and a sample unless eyes are shut, for which the last gaze stands in. Counts
    /// what is none.
    fn read(&self, line: anyhow::Result<&[u8]>) -> Option<(f64, Option<Sample>)> {
        let said = line.and_then(|line| {
            if is_heading(line) {
                Ok(None)
            } else {
                read(line)
            }
        });
        said.unwrap_or_else(|why| {
            if self.refused.fetch_add(1, Relaxed) == 0 {
                log::warn!("a line of gaze is refused, and others will be without a word: {why:#}");
            }
            None
        })
    }

    /// Takes a datagram's line, if its sender is `followed` and it is not late.
    fn hear(&self, followed: &mut Followed, from: SocketAddr, line: anyhow::Result<&[u8]>) {
        let Some((seconds, sample)) = self.read(line) else {
            return;
        };
        match followed.admit(from, seconds, Instant::now()) {
            Ok(()) => {
                if let Some(sample) = sample {
                    self.take(sample);
                }
            }
            Err(sender) => {
                if self.passed_over.fetch_add(1, Relaxed) == 0 {
                    let why = if from == sender {
                        "it came after a newer one".to_owned()
                    } else {
                        format!("one at a time is followed, and that is {sender}")
                    };
                    log::warn!(
                        "a gaze from {from} is passed over, and others will be without a word: {why}"
                    );
                }
            }
        }
    }
}

/// Takes lines until there are no more of them, or nothing needs them.
fn follow(mut lines: impl BufRead, newest: &Weak<Newest>) {
    let mut line = Vec::with_capacity(LONGEST);
    let mut is_rest = false;
    loop {
        line.clear();
        let read_line = (&mut lines)
            .take(LONGEST as u64)
            .read_until(b'\n', &mut line);
        let Some(newest) = newest.upgrade() else {
            return;
        };
        match read_line {
            Ok(0) => {
                println!("no more gaze comes: standard input has ended");
                return;
            }
            Ok(_) => {}
            Err(error) => {
                log::warn!("no more gaze comes: {error}");
                return;
            }
        }
        let is_cut = line.len() == LONGEST && !line.ends_with(b"\n");
        let is_of_longer = std::mem::replace(&mut is_rest, is_cut);
        if is_of_longer {
            continue;
        }
        let whole = if is_cut {
            Err(too_long())
        } else {
            Ok(&line[..])
        };
        if let Some((_, Some(sample))) = newest.read(whole) {
            newest.take(sample);
        }
    }
}

fn too_long() -> anyhow::Error {
    anyhow::anyhow!("it is longer than {LONGEST} bytes")
}

/// The one whose datagrams are taken, as long as they come: two at once would tear the camera between them.
#[derive(Debug, Clone, Copy)]
struct Sender {
    address: SocketAddr,
    /// Of its last sample, by its own clock.
    seconds: f64,
    heard: Instant,
}

/// Who is followed.
#[derive(Debug, Default)]
struct Followed {
    sender: Option<Sender>,
    /// When it was said last who it is.
    told: Option<Instant>,
}

impl Followed {
    /// Says that nothing comes any more, if that is so since the last look.
    fn note_silence(&mut self, now: Instant) {
        let has_gone = |last: &Sender| now.saturating_duration_since(last.heard) > STUMBLE;
        if let Some(gone) = self.sender.take_if(|last| has_gone(last)) {
            println!(
                "no gaze has come from {} for {} s",
                gone.address,
                STUMBLE.as_secs()
            );
        }
    }

    /// Whether a sample of this sender and time is to be taken: not one that the network delayed behind a newer one, and no other sender's before
    /// this one has been silent for a blink. If not, who is followed.
    fn admit(&mut self, address: SocketAddr, seconds: f64, now: Instant) -> Result<(), SocketAddr> {
        let is_heard = |last: &Sender| now.saturating_duration_since(last.heard) <= BLINK;
        if let Some(last) = self.sender.filter(is_heard)
            && (last.address != address || seconds <= last.seconds)
        {
            return Err(last.address);
        }
        let is_another = self.sender.is_none_or(|last| last.address != address);
        let is_told = (self.told).is_some_and(|told| now.saturating_duration_since(told) < STUMBLE);
        if is_another && !is_told {
            self.told = Some(now);
            println!("the camera follows the gaze from {address}");
        }
        self.sender = Some(Sender {
            address,
            seconds,
            heard: now,
        });
        Ok(())
    }
}

/// Takes datagrams, a line each, until nothing needs them.
fn listen(socket: &UdpSocket, newest: &Weak<Newest>) {
    let mut followed = Followed::default();
    loop {
        let mut awaited = Some(next(socket));
        let Some(newest) = newest.upgrade() else {
            return;
        };
        // It, and those that are there besides.
        for _ in 0..MOST_AT_ONCE {
            match awaited.take().unwrap_or_else(|| at_once(socket)) {
                Ok((from, datagram)) => newest.hear(&mut followed, from, datagram.whole()),
                Err(error) if is_passing(&error) => break,
                Err(error) => {
                    log::warn!("no more gaze comes: {error}");
                    return;
                }
            }
        }
        followed.note_silence(Instant::now());
        thread::sleep(REST);
    }
}

/// What a datagram holds.
struct Datagram {
    bytes: [u8; LONGEST + 1],
    length: usize,
}

impl Datagram {
    fn whole(&self) -> anyhow::Result<&[u8]> {
        let bytes = self.bytes.get(..self.length);
        bytes
            .filter(|_| self.length <= LONGEST)
            .ok_or_else(too_long)
    }
}

/// Waits for a datagram.
fn next(socket: &UdpSocket) -> io::Result<(SocketAddr, Datagram)> {
    let mut bytes = [0; LONGEST + 1];
    let (length, from) = socket.recv_from(&mut bytes)?;
    Ok((from, Datagram { bytes, length }))
}

/// A datagram that is there.
fn at_once(socket: &UdpSocket) -> io::Result<(SocketAddr, Datagram)> {
    socket.set_nonblocking(true)?;
    let came = next(socket);
    socket.set_nonblocking(false)?;
    came
}

/// Whether the next datagram may come all the same.
fn is_passing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock
            | ErrorKind::TimedOut
            | ErrorKind::Interrupted
            | ErrorKind::ConnectionReset
            | ErrorKind::ConnectionRefused
    )
}

#[cfg(test)]
mod tests;
