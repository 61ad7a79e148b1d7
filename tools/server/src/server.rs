//! Starting and stopping.

use crate::admission::Admission;
use crate::blocked::Blocked;
use crate::connections::Gate;
use crate::http::{App, Cached, Joined, RateLimit, router};
use crate::ice::Ice;
use crate::metrics::Metrics;
use crate::packages::Packages;
#[cfg(feature = "nats")]
use crate::relay::Relay;
use crate::revoked::Revoked;
use crate::rooms::{RoomLimits, Rooms};
use crate::token::now;
use crate::{Config, ServerError};
use axum_server::Handle;
#[cfg(feature = "tls")]
use axum_server::tls_rustls::{RustlsAcceptor, RustlsConfig};
use hyper_util::rt::TokioTimer;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;
use tokio::task::{JoinError, JoinHandle};
use tokio_util::sync::CancellationToken;
use turn_server::TurnServer;

/// How long requests under way may take when the server stops.
const STOP_WITHIN: Duration = Duration::from_secs(10);
const FORGET_EVERY: Duration = Duration::from_secs(60);
/// A connection's buffer: the longest request head, and what is held of a download besides the chunk under way.
const CONNECTION_BUFFER: usize = 64 << 10;

/// A server that runs until it is stopped. Dropping it ends it at once, with whatever is under way.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    turn: Option<Arc<TurnServer>>,
    handle: Handle<SocketAddr>,
    stopping: CancellationToken,
    serving: JoinHandle<std::io::Result<()>>,
}

impl Server {
    /// Starts a server; when this returns, it takes connections. To be called in a Tokio runtime.
    ///
    /// # Errors
    /// If anything in `config` cannot be used. A NATS server or an S3 store that is merely down is no error: `/readyz`
    /// says so until it is back.
    pub async fn start(config: Config) -> Result<Self, ServerError> {
        // For TLS towards S3 and NATS; an application that has chosen a provider keeps its choice.
        #[cfg(any(feature = "nats", feature = "s3"))]
        let _ = rustls::crypto::ring::default_provider().install_default();
        let stopping = CancellationToken::new();
        #[cfg(feature = "tls")]
        let tls = match &config.tls {
            Some((certificate, key)) => Some(crate::tls::load(certificate, key, &stopping)?),
            None => None,
        };
        let limits = config.limits.clone();
        let metrics = Arc::new(Metrics::new());
        let packages = Packages::open(&config, Arc::clone(&metrics)).await?;
        #[cfg(not(feature = "nats"))]
        let relay = None;
        #[cfg(feature = "nats")]
        let relay = match &config.nats {
            Some(address) => {
                let requests = limits.waiting_per_room + 16;
                Some(Relay::connect(address, limits.answer_within, requests).await?)
            }
            None => None,
        };
        let room_limits = RoomLimits {
            rooms: limits.rooms,
            rooms_per_owner: limits.rooms_per_owner,
            waiting_per_room: limits.waiting_per_room,
            answer_within: limits.answer_within,
        };
        let revoked = Arc::new(Revoked::open(config.revoked.clone())?);
        let blocked = Arc::new(Blocked::open(config.blocked.clone())?);
        let rooms = Arc::new(Rooms::new(room_limits, Arc::clone(&metrics)));
        let admission = Arc::new(Admission {
            revoked: Arc::clone(&revoked),
            blocked: Arc::clone(&blocked),
            rooms: Some(Arc::clone(&rooms)),
        });
        let gate = Gate::new(
            limits.connections,
            if limits.behind_proxy {
                limits.connections
            } else {
                limits.connections_per_address
            },
            limits.pause,
            Arc::clone(&blocked),
            Arc::clone(&metrics),
        );
        let (ice, turn) = Ice::start(
            &config,
            Arc::clone(&admission) as _,
            #[cfg(feature = "tls")]
            tls.clone(),
        )?;
        let app = Arc::new(App {
            secret: config.secret,
            revoked,
            blocked,
            gate: gate.clone(),
            joined: Joined::default(),
            rooms,
            relay,
            ice,
            forwarding: config.forwarding,
            packages,
            member_uploads: Arc::default(),
            metrics,
            rate: RateLimit::new(limits.requests_per_second, limits.request_burst),
            health: Cached::default(),
            stopping: stopping.clone(),
            limits,
        });
        let failed = |source| ServerError::Listen {
            address: config.listen,
            source,
        };
        let listener = TcpListener::bind(config.listen).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let handle = Handle::new();
        let head_within = app.limits.head_within;
        tokio::spawn(housekeep(Arc::downgrade(&app), stopping.clone()));
        let of_lists = Arc::downgrade(&app);
        tokio::spawn(admission.watch(stopping.clone(), move |revoked, blocked| {
            let Some(app) = of_lists.upgrade() else {
                return;
            };
            if revoked {
                app.end_revoked();
            }
            if blocked {
                app.end_blocked();
            }
        }));
        let service = router(app).into_make_service_with_connect_info::<SocketAddr>();
        let server = axum_server::from_tcp(listener)
            .map_err(failed)?
            .handle(handle.clone());
        #[cfg(not(feature = "tls"))]
        let serving = tokio::spawn(bounded(server.acceptor(gate), head_within).serve(service));
        #[cfg(feature = "tls")]
        let serving = match tls {
            None => tokio::spawn(bounded(server.acceptor(gate), head_within).serve(service)),
            Some(tls) => {
                let acceptor = RustlsAcceptor::new(RustlsConfig::from_config(tls))
                    .handshake_timeout(head_within)
                    .acceptor(gate);
                tokio::spawn(bounded(server.acceptor(acceptor), head_within).serve(service))
            }
        };
        log::info!("listening on {address}");
        Ok(Self {
            address,
            turn,
            handle,
            stopping,
            serving,
        })
    }

    /// Where it listens, with the port it was given.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where it relays calls, with the port it was given, over UDP and TCP.
    pub fn turn_address(&self) -> Option<SocketAddr> {
        self.turn.as_ref().map(|turn| turn.address())
    }

    /// Ends the senders' streams and takes no new connections, and waits a while for what is under way.
    pub async fn stop(mut self) {
        self.stopping.cancel();
        self.handle.graceful_shutdown(Some(STOP_WITHIN));
        if let Err(e) = ended((&mut self.serving).await) {
            log::error!("{e}");
        }
    }

    /// Waits for as long as the server runs. Not to be called again after that.
    ///
    /// # Errors
    /// Why it stopped by itself.
    pub async fn wait(&mut self) -> Result<(), ServerError> {
        ended((&mut self.serving).await)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stopping.cancel();
        self.handle.shutdown();
    }
}

/// Sets a server's bounds on what it reads. It comes after the acceptor, whose setting would take `http1_only` back, and
/// only then is a client that sends nothing at all subject to the timeout.
fn bounded<A>(
    server: axum_server::Server<SocketAddr, A>,
    head_within: Duration,
) -> axum_server::Server<SocketAddr, A> {
    let mut server = server.http1_only();
    server
        .http_builder()
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(head_within)
        .max_buf_size(CONNECTION_BUFFER);
    server
}

fn ended(result: Result<std::io::Result<()>, JoinError>) -> Result<(), ServerError> {
    result
        .unwrap_or_else(|e| Err(std::io::Error::other(e)))
        .map_err(|source| ServerError::Stopped { source })
}

/// The server's regular work, until it stops.
async fn housekeep(app: std::sync::Weak<App>, stopping: CancellationToken) {
    let sweep = async {
        let app = app.upgrade()?;
        Some(app.packages.sweep().await)
    };
    match sweep.await {
        Some(Ok(count)) if count > 0 => {
            log::info!("removed {count} packages without an owner");
        }
        Some(Err(e)) => log::error!("the package store cannot be swept: {e}"),
        _ => {}
    }
    loop {
        tokio::select! {
            () = stopping.cancelled() => break,
            () = tokio::time::sleep(FORGET_EVERY) => {}
        }
        match app.upgrade() {
            Some(app) => {
                app.rate.forget_quiet();
                app.member_uploads.forget_over(now());
                app.joined.forget_over(now());
            }
            None => break,
        }
    }
}
