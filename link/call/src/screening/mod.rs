//! Screens the datagrams of a connection before the WebRTC library reads them.
//!
//! The library (0.21.1, the newest version) hands on DTLS and RTP of every source once a pair of candidates is
//! selected, follows handshake fragments by recursion, keeps empty ones and records of the next epoch without a bound,
//! and keeps a state for each SSRC before it has authenticated the packet; and it keeps what a link's holder opens on
//! SCTP. So a host without a link ended a program by 290 KB of DTLS. The library takes its sockets from a [`Runtime`]
//! and its ciphers from a provider: those here screen what they hand on, in a few hundred lines, where corrected copies
//! of `rtc`, `rtc-dtls`, `rtc-sctp` and `rtc-srtp` would be 100,000 that have to follow each version.
//!
//! The rules are in [`screen`] and [`sctp`]; `docs/security.md` names what they do not cover.

mod crypto;
mod dtls;
mod screen;
mod sctp;
mod stun;

use crypto::ScreenedCrypto;
use rtc::crypto::RTCCryptoProvider;
use screen::Screen;
use sctp::Verdict;
use std::future::Future;
use std::io::{self, IoSliceMut};
use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::pin::Pin;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use webrtc::error::Error;
use webrtc::runtime::{
    AsyncInterval, AsyncTcpListener, AsyncTcpStream, AsyncUdpSocket, JoinHandle, RecvMeta, Runtime,
    TokioRuntime, Transmit,
};

/// The port of multicast DNS: what comes there is no packet of a call.
const MDNS_PORT: u16 = 5353;

/// The screen of one connection, shared by its sockets and ciphers.
#[derive(Debug, Clone)]
pub(crate) struct Screening {
    screen: Arc<Mutex<Screen>>,
    /// Set when the connection has to end.
    failed: watch::Sender<bool>,
}

impl Screening {
    /// For a connection that ends when `failed` is set.
    pub(crate) fn new(failed: watch::Sender<bool>) -> Self {
        let screen = Arc::default();
        Self { screen, failed }
    }

    /// The cryptography for the connection.
    ///
    /// # Errors
    /// If the library has none.
    pub(crate) fn crypto(&self) -> Result<Arc<dyn RTCCryptoProvider>, Error> {
        let provider = rtc::crypto::default_provider();
        Ok(Arc::new(ScreenedCrypto {
            provider: provider.map_err(|error| Error::Crypto(error.to_string()))?,
            screening: self.clone(),
        }))
    }

    /// This side describes its connection by this ICE user fragment: before it is described, no request is genuine.
    pub(crate) fn describe(&self, fragment: &str) {
        self.screen().describe(fragment);
    }

    /// This side sends this SCTP packet.
    fn seals(&self, packet: &[u8]) {
        self.screen().association.sends(packet);
    }

    /// Whether the library is to have an SCTP packet of the other side.
    fn opens(&self, packet: &[u8]) -> bool {
        let verdict = self.screen().association.verdict(packet);
        if verdict == Verdict::Foreign {
            // The library gets nothing more until the connection is closed.
            self.screen().close();
            if !self.failed.send_replace(true) {
                log::warn!(
                    "a connection is closed: its other side uses data channels that a call does not have"
                );
            }
        }
        verdict == Verdict::Passes
    }

    /// The runtime for the connection.
    pub(crate) fn runtime(&self) -> Arc<dyn Runtime> {
        Arc::new(ScreenedRuntime {
            tokio: TokioRuntime,
            screening: self.clone(),
            sockets: AtomicU32::new(0),
        })
    }

    fn screen(&self) -> MutexGuard<'_, Screen> {
        self.screen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Tokio's runtime, but for UDP sockets, which screen what they receive.
#[derive(Debug)]
struct ScreenedRuntime {
    tokio: TokioRuntime,
    screening: Screening,
    /// How many sockets it has made.
    sockets: AtomicU32,
}

impl Runtime for ScreenedRuntime {
    fn wrap_udp_socket(&self, socket: UdpSocket) -> io::Result<Arc<dyn AsyncUdpSocket>> {
        let port = socket.local_addr()?.port();
        let socket = self.tokio.wrap_udp_socket(socket)?;
        if port == MDNS_PORT {
            return Ok(socket);
        }
        Ok(Arc::new(ScreenedSocket {
            socket,
            screening: self.screening.clone(),
            number: self.sockets.fetch_add(1, Relaxed),
        }))
    }

    fn spawn(&self, future: Pin<Box<dyn Future<Output = ()> + Send>>) -> Box<dyn JoinHandle> {
        self.tokio.spawn(future)
    }

    fn spawn_reactor(
        &self,
        reactor_pool_size: usize,
        future: Pin<Box<dyn Future<Output = ()> + Send>>,
    ) -> Box<dyn JoinHandle> {
        self.tokio.spawn_reactor(reactor_pool_size, future)
    }

    fn wrap_tcp_listener(&self, listener: TcpListener) -> io::Result<Arc<dyn AsyncTcpListener>> {
        self.tokio.wrap_tcp_listener(listener)
    }

    fn connect_tcp<'a>(
        &'a self,
        remote: SocketAddr,
    ) -> Pin<Box<dyn Future<Output = io::Result<Arc<dyn AsyncTcpStream>>> + Send + 'a>> {
        self.tokio.connect_tcp(remote)
    }

    fn resolve_host<'a>(
        &'a self,
        host: &'a str,
    ) -> Pin<Box<dyn Future<Output = io::Result<Vec<SocketAddr>>> + Send + 'a>> {
        self.tokio.resolve_host(host)
    }

    fn now(&self) -> Instant {
        self.tokio.now()
    }

    fn sleep(&self, duration: Duration) -> Pin<Box<dyn Future<Output = ()> + Send + 'static>> {
        self.tokio.sleep(duration)
    }

    fn interval(&self, period: Duration) -> Box<dyn AsyncInterval> {
        self.tokio.interval(period)
    }

    fn block_on(&self, future: Pin<Box<dyn Future<Output = ()> + '_>>) {
        self.tokio.block_on(future);
    }

    fn yield_now(&self) -> Pin<Box<dyn Future<Output = ()> + Send + 'static>> {
        self.tokio.yield_now()
    }

    fn name(&self) -> &'static str {
        self.tokio.name()
    }
}

#[derive(Debug)]
struct ScreenedSocket {
    socket: Arc<dyn AsyncUdpSocket>,
    screening: Screening,
    /// Among the connection's.
    number: u32,
}

impl AsyncUdpSocket for ScreenedSocket {
    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    fn poll_send(&self, cx: &mut Context<'_>, transmit: &Transmit<'_>) -> Poll<io::Result<usize>> {
        // Before it is sent: the answer may be here at once.
        let mut screen = self.screening.screen();
        let segment = transmit.segment_size.unwrap_or(transmit.contents.len());
        for datagram in transmit.contents.chunks(segment.max(1)) {
            screen.sends(self.number, transmit.destination, datagram);
        }
        drop(screen);
        self.socket.poll_send(cx, transmit)
    }

    fn poll_recv(
        &self,
        cx: &mut Context<'_>,
        bufs: &mut [IoSliceMut<'_>],
        meta: &mut [RecvMeta],
    ) -> Poll<io::Result<usize>> {
        // Tokio's budget ends this loop in a flood: the socket is then pending, and polled again after other tasks.
        loop {
            let received = ready!(self.socket.poll_recv(cx, bufs, meta))?;
            let mut screen = self.screening.screen();
            let mut remain = false;
            for (buffer, meta) in bufs.iter_mut().zip(&mut *meta).take(received) {
                let source = meta.addr;
                retain(buffer, meta, |datagram| {
                    screen.admits(self.number, source, datagram)
                });
                remain |= meta.len > 0;
            }
            if remain {
                return Poll::Ready(Ok(received));
            }
        }
    }

    fn max_gso_segments(&self) -> usize {
        self.socket.max_gso_segments()
    }

    fn max_gro_segments(&self) -> usize {
        self.socket.max_gro_segments()
    }
}

/// Keeps those datagrams of a buffer that `keep` admits. The kernel may have joined several of one source: each of
/// `stride` bytes, but for the last one, which may be shorter, so those that are kept have the same form.
fn retain(buffer: &mut [u8], meta: &mut RecvMeta, mut keep: impl FnMut(&[u8]) -> bool) {
    let (length, stride) = (meta.len.min(buffer.len()), meta.stride.max(1));
    let (mut start, mut kept) = (0, 0);
    while start < length {
        let end = (start + stride).min(length);
        if buffer.get(start..end).is_some_and(&mut keep) {
            buffer.copy_within(start..end, kept);
            kept += end - start;
        }
        start = end;
    }
    meta.len = kept;
}

#[cfg(test)]
mod tests;
