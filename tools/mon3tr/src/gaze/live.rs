//! Gaze as it happens: [samples](super::sample) from standard input, or by UDP; the newest wins. A sample's seconds are by any clock of its source's.

use super::BLINK;
use super::sample::{Sample, is_heading, read};
use anyhow::Context;
use std::io::{BufRead, ErrorKind, Read};
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

/// Bytes of a line at most, and of a datagram.
const LONGEST: usize = 1024;

/// Between two looks whether anything still needs the gaze.
const LOOK: Duration = Duration::from_millis(200);

/// After the newest datagram was taken, so that a flood of them costs little: no display shows more than one gaze in it.
const REST: Duration = Duration::from_millis(2);

/// Datagrams that are passed over at once for a newer one.
const MOST_PASSED: usize = 64;

/// The newest sample. Copies are the same one.
#[derive(Debug, Clone)]
pub(super) struct Live(Arc<Newest>);

#[derive(Debug, Default)]
struct Newest {
    sample: Mutex<Option<(Instant, Sample)>>,
    taken: AtomicU64,
    refused: AtomicU64,
}

impl Live {
    /// Of this machine's standard input.
    ///
    /// # Errors
    /// If there is no thread for it.
    pub(super) fn stdin() -> anyhow::Result<Self> {
        Self::read_by(|newest| follow(std::io::stdin().lock(), newest))
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
        let bound: std::io::Result<_> = bind();
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

    /// How many samples were taken, and how many lines were none.
    pub(super) fn counts(&self) -> [u64; 2] {
        [&self.0.taken, &self.0.refused].map(|count| count.load(Relaxed))
    }
}

impl Newest {
    fn lock(&self) -> std::sync::MutexGuard<'_, Option<(Instant, Sample)>> {
        self.sample.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes what was read of a line. While eyes are shut the last gaze stands in for them.
    fn take(&self, read: anyhow::Result<Option<Sample>>) {
        match read {
            Ok(Some(sample)) => {
                *self.lock() = Some((Instant::now(), sample));
                self.taken.fetch_add(1, Relaxed);
            }
            Ok(None) => {}
            Err(why) => {
                if self.refused.fetch_add(1, Relaxed) == 0 {
                    log::warn!(
                        "a line of gaze is none and is passed over, as the next of its kind will be: {why:#}"
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
            Ok(0) => return,
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
        newest.take(if is_cut {
            Err(too_long())
        } else if is_heading(&line) {
            Ok(None)
        } else {
            read(&line).map(|line| line.and_then(|(_, sample)| sample))
        });
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

/// Takes datagrams, a line each, until nothing needs them.
fn listen(socket: &UdpSocket, newest: &Weak<Newest>) {
    let mut bytes = [0; LONGEST + 1];
    let mut sender: Option<Sender> = None;
    loop {
        let received = receive(socket, &mut bytes, sender.map(|sender| sender.address));
        let Some(newest) = newest.upgrade() else {
            return;
        };
        let (length, from) = match received {
            Ok(received) => received,
            Err(error) if is_passing(&error) => continue,
            Err(error) => {
                log::warn!("no more gaze comes: {error}");
                return;
            }
        };
        let now = Instant::now();
        let last = sender.filter(|sender| now.saturating_duration_since(sender.heard) <= BLINK);
        if last.is_some_and(|last| last.address != from) {
            continue;
        }
        let line = bytes.get(..length).filter(|_| length <= LONGEST);
        newest.take(line.ok_or_else(too_long).and_then(read).map(|line| {
            let (seconds, sample) = line?;
            // The network may change their order.
            if last.is_some_and(|last| seconds <= last.seconds) {
                return None;
            }
            sender = Some(Sender {
                address: from,
                seconds,
                heard: now,
            });
            sample
        }));
        thread::sleep(REST);
    }
}

/// Waits for a datagram, and takes the newest of those that are there, of `sender` if there is one of theirs.
fn receive(
    socket: &UdpSocket,
    bytes: &mut [u8; LONGEST + 1],
    sender: Option<SocketAddr>,
) -> std::io::Result<(usize, SocketAddr)> {
    let mut received = socket.recv_from(bytes)?;
    socket.set_nonblocking(true)?;
    let mut next = [0; LONGEST + 1];
    for _ in 0..MOST_PASSED {
        let Ok((length, from)) = socket.recv_from(&mut next) else {
            break;
        };
        if sender.is_none_or(|sender| sender == from || sender != received.1) {
            received = (length, from);
            *bytes = next;
        }
    }
    socket.set_nonblocking(false)?;
    Ok(received)
}

/// Whether the next datagram may come all the same.
fn is_passing(error: &std::io::Error) -> bool {
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
