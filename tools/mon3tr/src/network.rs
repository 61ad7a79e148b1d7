//! What `send` and `receive` share: the network's threads, the server's certificate, and Ctrl-C.

use anyhow::Context;
use link_http::Client;
use link_playout::Clock;
use link_protocol::room_link::ServerUrl;
use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// The network's threads: apart from all that draws or deforms, so that neither waits for the other.
#[derive(Debug)]
pub struct Network(tokio::runtime::Runtime);

impl Network {
    /// Two threads: the connection's own work takes a fraction of one.
    pub fn start() -> anyhow::Result<Self> {
        tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("network")
            .enable_all()
            .build()
            .map(Self)
            .context("cannot start the network's threads")
    }

    /// A way to them.
    pub(crate) fn handle(&self) -> tokio::runtime::Handle {
        self.0.handle().clone()
    }

    /// Runs `task` to its end.
    pub fn block_on<T>(&self, task: impl Future<Output = T>) -> T {
        self.0.block_on(task)
    }

    /// Becomes true on Ctrl-C or when the process is asked to end. A second Ctrl-C ends it at once.
    pub fn stop_on_signal(&self) -> Arc<AtomicBool> {
        let stop = Arc::new(AtomicBool::new(false));
        let set = Arc::clone(&stop);
        self.0.spawn(async move {
            if let Err(error) = asked_to_end().await {
                log::warn!("Ctrl-C ends this without goodbye: {error}");
                return;
            }
            set.store(true, Relaxed);
            if asked_to_end().await.is_ok() {
                std::process::exit(130);
            }
        });
        stop
    }
}

/// Waits for Ctrl-C or SIGTERM.
pub(crate) async fn asked_to_end() -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let mut terminate = signal(SignalKind::terminate())?;
        tokio::select! {
            outcome = tokio::signal::ctrl_c() => outcome,
            _ = terminate.recv() => Ok(()),
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await
}

/// Tells where anyone on the way can read and change what is said to the server.
pub(crate) fn warn_if_unprotected(server: &ServerUrl) {
    if server.is_unprotected() {
        log::warn!(
            "{server} is reached over the internet without encryption: anyone on the way can read its links and tokens. Motion and voice stay encrypted. A server with a certificate (https) prevents it"
        );
    }
}

/// Tells where a link does not let either side prove that it has the link; `shows_key` where it tells the other side's key all the same.
pub(crate) fn warn_if_unproved(has_secret: bool, shows_key: bool) {
    if has_secret {
        return;
    }
    let proof = if shows_key {
        "nothing but their key tells who the other side is"
    } else {
        "nothing proves who the other side is, nor that the server is not in between"
    };
    log::warn!(
        "this link has no secret: {proof}, and whoever has a link with one refuses you. What `send` and `call` print has one, after the token: was all of it copied?"
    );
}

/// What a command needs to talk to others.
#[derive(Debug)]
pub(crate) struct Line {
    pub(crate) network: Network,
    pub(crate) client: Client,
    pub(crate) clock: Clock,
    /// It is time to leave.
    pub(crate) stop: Arc<AtomicBool>,
}

impl Line {
    /// Until Ctrl-C, or the process is asked to end.
    pub(crate) fn open(trust: &Trust) -> anyhow::Result<Self> {
        let network = Network::start()?;
        Ok(Self {
            client: trust.client()?,
            clock: Clock::start(),
            stop: network.stop_on_signal(),
            network,
        })
    }
}

/// Whose certificates are trusted.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Trust {
    /// A certificate (PEM) to trust beside the system's: for a server with one of its own making
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
}

impl Trust {
    /// An HTTP client that trusts them.
    pub(crate) fn client(&self) -> anyhow::Result<Client> {
        Ok(Client::new(self.ca.as_deref())?)
    }
}

/// A number of seconds, up to a day.
pub fn parse_seconds(text: &str) -> Result<Duration, String> {
    text.parse::<f64>()
        .ok()
        .filter(|seconds| (0.1..=86_400.0).contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("{text} is not a number of seconds from 0.1 to 86400"))
}
