//! Counts connections, and closes those whose client reads nothing for too long, or that have to make room for others.
//!
//! Requests have their own timeouts; this works below them, on the socket.

mod open;

use crate::blocked::Blocked;
use crate::metrics::Metrics;
use axum_server::accept::Accept;
use open::{Open, Place};
use std::future::{Ready, ready};
use std::io::{self, ErrorKind, IoSlice};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::Sleep;
use tokio_util::sync::WaitForCancellationFutureOwned;

/// Admits a number of connections in all, and a number from one address.
#[derive(Clone, Debug)]
pub(crate) struct Gate {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    stall: Duration,
    begun: Instant,
    open: Mutex<Open>,
    blocked: Arc<Blocked>,
    metrics: Arc<Metrics>,
}

impl Inner {
    fn open(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Milliseconds since the server's start.
    fn now(&self) -> u64 {
        u64::try_from(self.begun.elapsed().as_millis()).unwrap_or(u64::MAX)
    }

    fn count(&self, open: &Open) {
        let connections = i64::try_from(open.len()).unwrap_or(i64::MAX);
        self.metrics.connections.set(connections);
    }
}

impl Gate {
    pub(crate) fn new(
        total: usize,
        per_address: usize,
        stall: Duration,
        blocked: Arc<Blocked>,
        metrics: Arc<Metrics>,
    ) -> Self {
        Self {
            inner: Arc::new(Inner {
                stall,
                begun: Instant::now(),
                open: Mutex::new(Open::new(total, per_address)),
                blocked,
                metrics,
            }),
        }
    }

    fn enter(&self, stream: TcpStream) -> io::Result<Guarded> {
        let client = stream.peer_addr()?;
        if self.inner.blocked.has(client.ip()) {
            self.inner.metrics.blocked.inc();
            return Err(refused("the address is blocked"));
        }
        stream.set_nodelay(true)?;
        // A machine that vanished never closes its connection; only the missing acknowledgements show it.
        #[cfg(target_os = "linux")]
        socket2::SockRef::from(&stream).set_tcp_user_timeout(Some(self.inner.stall))?;
        let mut open = self.inner.open();
        let Ok(entered) = open.enter(client, self.inner.now()) else {
            self.inner.metrics.connections_refused.inc();
            return Err(refused("too many connections"));
        };
        self.inner.count(&open);
        if entered.has_replaced {
            self.inner.metrics.connections_replaced.inc();
        }
        Ok(Guarded {
            stream,
            stalled: None,
            closed: Box::pin(entered.place.closed.clone().cancelled_owned()),
            guard: ConnectionGuard {
                gate: Arc::clone(&self.inner),
                place: entered.place,
            },
            stall: self.inner.stall,
        })
    }

    /// A request of this client has succeeded with a valid token: its connection is not closed in favour of those of
    /// strangers.
    pub(crate) fn trust(&self, client: &SocketAddr) {
        self.inner.open().trust(client);
    }

    /// Closes the connections of addresses that are blocked now.
    pub(crate) fn close_blocked(&self) {
        let mut open = self.inner.open();
        open.close_those(|address| self.inner.blocked.has(address));
        self.inner.count(&open);
    }
}

fn refused(why: &'static str) -> io::Error {
    io::Error::new(ErrorKind::ConnectionRefused, why)
}

impl<S> Accept<TcpStream, S> for Gate {
    type Stream = Guarded;
    type Service = S;
    type Future = Ready<io::Result<(Guarded, S)>>;

    fn accept(&self, stream: TcpStream, service: S) -> Self::Future {
        ready(self.enter(stream).map(|stream| (stream, service)))
    }
}

/// Counts a connection until it is dropped, or closed for another one.
#[derive(Debug)]
struct ConnectionGuard {
    gate: Arc<Inner>,
    place: Place,
}

impl ConnectionGuard {
    /// Bytes have passed.
    fn is_used(&self) {
        self.place.used.store(self.gate.now(), Relaxed);
    }
}

impl Drop for ConnectionGuard {
    fn drop(&mut self) {
        let mut open = self.gate.open();
        open.leave(self.place.number);
        self.gate.count(&open);
    }
}

/// A connection that fails when its client takes nothing for too long, or when it is closed for another one.
#[derive(Debug)]
pub(crate) struct Guarded {
    stream: TcpStream,
    stall: Duration,
    stalled: Option<Pin<Box<Sleep>>>,
    closed: Pin<Box<WaitForCancellationFutureOwned>>,
    guard: ConnectionGuard,
}

impl Guarded {
    /// Passes a write's outcome on; while it is pending the clock runs.
    fn timed<T>(
        &mut self,
        context: &mut Context<'_>,
        outcome: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if outcome.is_ready() {
            self.stalled = None;
            self.guard.is_used();
            return outcome;
        }
        if self.closed.as_mut().poll(context).is_ready() {
            return Poll::Ready(Err(ErrorKind::ConnectionAborted.into()));
        }
        let stall = self.stall;
        let clock = self
            .stalled
            .get_or_insert_with(|| Box::pin(tokio::time::sleep(stall)));
        ready!(clock.as_mut().poll(context));
        Poll::Ready(Err(ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Guarded {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.closed.as_mut().poll(context).is_ready() {
            return Poll::Ready(Err(ErrorKind::ConnectionAborted.into()));
        }
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        if read.is_ready() {
            self.guard.is_used();
        }
        read
    }
}

impl AsyncWrite for Guarded {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.timed(context, outcome)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let outcome = Pin::new(&mut self.stream).poll_write_vectored(context, bytes);
        self.timed(context, outcome)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
