//! A relay for TCP with the delay and rate of a long way, for downloads. Bytes are not lost: TCP would send them again.
//!
//! It models a download's path: a connection takes one round trip to be made, all connections share the rate (headers and all, Ethernet's usual
//! segment), each delays, and what is under way unacknowledged is bounded by a window that starts small and doubles every round trip (slow
//! start, RFC 5681 and 6928) up to twice the path's bandwidth-delay product. So many short connections cost here what they cost on a real path.

use std::{
    io,
    net::SocketAddr,
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{
        TcpListener, TcpStream,
        tcp::{OwnedReadHalf, OwnedWriteHalf},
    },
    sync::{Semaphore, mpsc},
    task::{JoinHandle, JoinSet},
};

use crate::{
    BitRate, NetlabError,
    pacer::{Pacer, locked},
};

/// What a full segment carries, and what IPv4 and TCP with timestamps put around it.
const SEGMENT: usize = 1448;
const SEGMENT_HEADERS: usize = 52;
/// RFC 6928: ten segments may go before the first acknowledgement.
const FIRST_WINDOW: usize = 10 * SEGMENT;
const MAX_CHUNK: usize = 64 * 1024;

/// One direction of a TCP path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TcpPath {
    /// Every byte's.
    pub delay: Duration,
    /// Of all connections together; unlimited if `None`.
    pub rate: Option<BitRate>,
}

/// Both directions of a TCP path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TcpImpairment {
    /// From the server.
    pub down: TcpPath,
    /// To the server.
    pub up: TcpPath,
}

impl TcpImpairment {
    /// The same both ways: half the round trip each.
    pub fn symmetric(round_trip: Duration, rate: Option<BitRate>) -> Self {
        let path = TcpPath {
            delay: round_trip / 2,
            rate,
        };
        Self {
            down: path,
            up: path,
        }
    }

    fn round_trip(&self) -> Duration {
        self.down.delay + self.up.delay
    }
}

/// A running relay in front of a TCP server. Dropping it breaks all its connections.
#[derive(Debug)]
pub struct TcpRelay {
    address: SocketAddr,
    accepting: JoinHandle<()>,
}

impl TcpRelay {
    /// Starts a relay on the current runtime that listens at one address (port 0: any) and leads to another.
    ///
    /// # Errors
    /// [`NetlabError::Bind`].
    pub async fn start(
        listen: SocketAddr,
        upstream: SocketAddr,
        impairment: TcpImpairment,
    ) -> Result<Self, NetlabError> {
        let bind = |source| NetlabError::Bind {
            address: listen.ip(),
            source,
        };
        let listener = TcpListener::bind(listen).await.map_err(bind)?;
        let address = listener.local_addr().map_err(bind)?;
        let pacer = Arc::new(Pacer::start().map_err(bind)?);
        let round_trip = impairment.round_trip();
        let down = Arc::new(Way::new(impairment.down, round_trip));
        let up = Arc::new(Way::new(impairment.up, round_trip));
        let accepting = tokio::spawn(async move {
            let mut connections = JoinSet::new();
            loop {
                let client = match listener.accept().await {
                    Ok((client, _)) => client,
                    Err(error) => {
                        // Out of file handles, as a rule: let some close.
                        log::warn!("netlab: accepting a connection: {error}");
                        tokio::time::sleep(Duration::from_millis(50)).await;
                        continue;
                    }
                };
                while connections.try_join_next().is_some() {}
                let (pacer, down, up) = (pacer.clone(), down.clone(), up.clone());
                connections.spawn(async move {
                    if let Err(error) = connection(client, upstream, &pacer, &down, &up).await {
                        log::debug!("netlab: a connection to {upstream} broke: {error}");
                    }
                });
            }
        });
        Ok(Self { address, accepting })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for TcpRelay {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

/// One direction, shared by all connections.
#[derive(Debug)]
struct Way {
    path: TcpPath,
    /// The way back of acknowledgements.
    back: Duration,
    busy_until: Mutex<Duration>,
    max_window: usize,
    chunk: usize,
}

impl Way {
    fn new(path: TcpPath, round_trip: Duration) -> Self {
        let held = |time: Duration| {
            path.rate.map(|rate| {
                let bytes = u128::from(rate.bits_per_second()) * time.as_nanos() / 8_000_000_000;
                usize::try_from(bytes).unwrap_or(usize::MAX)
            })
        };
        Self {
            path,
            back: round_trip - path.delay,
            busy_until: Mutex::default(),
            max_window: held(round_trip)
                .map_or(usize::MAX, |bytes| bytes.saturating_mul(2))
                .clamp(64 * 1024, 16 * 1024 * 1024),
            chunk: held(Duration::from_millis(1))
                .unwrap_or(MAX_CHUNK)
                .clamp(SEGMENT, MAX_CHUNK),
        }
    }

    /// When so many bytes that are offered now will have arrived.
    fn arrival(&self, now: Duration, bytes: usize) -> Duration {
        let with_headers = bytes + bytes.div_ceil(SEGMENT) * SEGMENT_HEADERS;
        let departs = self.path.rate.map_or(now, |rate| {
            let mut busy_until = locked(&self.busy_until);
            *busy_until = now.max(*busy_until) + rate.time_for(with_headers as u64);
            *busy_until
        });
        departs + self.path.delay
    }
}

async fn connection(
    client: TcpStream,
    upstream: SocketAddr,
    pacer: &Arc<Pacer>,
    down: &Arc<Way>,
    up: &Arc<Way>,
) -> io::Result<()> {
    // The system has already connected the client; the round trip of connecting is added here.
    pacer
        .wait_until(pacer.now() + up.path.delay + up.back)
        .await;
    let server = TcpStream::connect(upstream).await?;
    client.set_nodelay(true)?;
    server.set_nodelay(true)?;
    let (from_client, to_client) = client.into_split();
    let (from_server, to_server) = server.into_split();
    tokio::try_join!(
        one_way(from_client, to_server, pacer, up),
        one_way(from_server, to_client, pacer, down),
    )?;
    Ok(())
}

/// Carries one direction until its end, which it passes on.
async fn one_way(
    mut from: OwnedReadHalf,
    mut to: OwnedWriteHalf,
    pacer: &Arc<Pacer>,
    way: &Arc<Way>,
) -> io::Result<()> {
    // Bounded by the window: what is in the channel has taken its bytes' permits.
    let (under_way, mut arriving) = mpsc::unbounded_channel::<(Duration, Vec<u8>)>();
    let window = Arc::new(Window::new(way.max_window));
    let reading = async {
        loop {
            let room = window.take(way.chunk).await;
            let mut bytes = vec![0; room];
            let count = from.read(&mut bytes).await?;
            window.give_back(room - count);
            if count == 0 {
                break;
            }
            bytes.truncate(count);
            let at = way.arrival(pacer.now(), count);
            if under_way.send((at, bytes)).is_err() {
                break;
            }
        }
        // The end of the stream is delayed like the bytes.
        let _ = under_way.send((way.arrival(pacer.now(), 0), Vec::new()));
        Ok::<_, io::Error>(())
    };
    let writing = async {
        while let Some((at, bytes)) = arriving.recv().await {
            pacer.wait_until(at).await;
            if bytes.is_empty() {
                break;
            }
            to.write_all(&bytes).await?;
            let (window, count) = (window.clone(), bytes.len());
            pacer.at(pacer.now() + way.back, move || window.acknowledge(count));
        }
        to.shutdown().await
    };
    tokio::try_join!(reading, writing)?;
    Ok(())
}

/// How much may be under way unacknowledged, in bytes.
#[derive(Debug)]
struct Window {
    room: Semaphore,
    size: AtomicUsize,
    max: usize,
}

impl Window {
    fn new(max: usize) -> Self {
        let first = FIRST_WINDOW.min(max);
        Self {
            room: Semaphore::new(first),
            size: AtomicUsize::new(first),
            max,
        }
    }

    /// Waits for room for a segment and takes what there is, at most so much.
    async fn take(&self, at_most: usize) -> usize {
        // Neither count comes near u32's end, nor is the semaphore ever closed.
        let least = SEGMENT.min(at_most);
        if let Ok(permits) = self
            .room
            .acquire_many(u32::try_from(least).unwrap_or(1))
            .await
        {
            permits.forget();
        }
        let more = self.room.available_permits().min(at_most - least);
        match self.room.try_acquire_many(u32::try_from(more).unwrap_or(0)) {
            Ok(permits) => {
                permits.forget();
                least + more
            }
            Err(_) => least,
        }
    }

    fn give_back(&self, bytes: usize) {
        self.room.add_permits(bytes);
    }

    /// Slow start: the window grows by what is acknowledged, until it is full-grown.
    fn acknowledge(&self, bytes: usize) {
        let size = self.size.load(Ordering::Relaxed);
        let growth = bytes.min(self.max - size);
        self.size.store(size + growth, Ordering::Relaxed);
        self.room.add_permits(bytes + growth);
    }
}
