//! What `send` and `receive` share: the network's threads, the server's certificate, and Ctrl-C.

use crate::ending;
use crate::heap;
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

    /// Runs `task` beside others.
    #[cfg(all(feature = "operator", unix))]
    pub(crate) fn spawn(&self, task: impl Future<Output = ()> + Send + 'static) {
        self.0.spawn(task);
    }

    /// Runs `task` to its end.
    pub fn block_on<T>(&self, task: impl Future<Output = T>) -> T {
        self.0.block_on(task)
    }

    /// Becomes true on Ctrl-C or when the process is asked to end. A second Ctrl-C ends it at once.
    pub fn stop_on_signal(&self) -> Arc<AtomicBool> {
        self.on_signal(|_| {})
    }

    /// The same of a call, which is not waited for: the process ends soon, whatever it does ([`crate::ending`]).
    pub(crate) fn end_on_signal(&self) -> Arc<AtomicBool> {
        self.on_signal(ending::end_soon)
    }

    fn on_signal(&self, asked: fn(i32)) -> Arc<AtomicBool> {
        let stop = Arc::new(AtomicBool::new(false));
        let set = Arc::clone(&stop);
        self.0.spawn(async move {
            match asked_to_end().await {
                Ok(status) => {
                    set.store(true, Relaxed);
                    asked(status);
                }
                Err(error) => {
                    log::warn!("Ctrl-C ends this without goodbye: {error}");
                    return;
                }
            }
            if let Ok(status) = asked_to_end().await {
                ending::end_now(status);
            }
        });
        stop
    }
}

/// Waits for Ctrl-C or SIGTERM; the status that shells give a process which one of them ended.
pub(crate) async fn asked_to_end() -> std::io::Result<i32> {
    const INTERRUPTED: i32 = 130;
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        const TERMINATED: i32 = 143;
        let mut terminate = signal(SignalKind::terminate())?;
        tokio::select! {
            outcome = tokio::signal::ctrl_c() => outcome.map(|()| INTERRUPTED),
            _ = terminate.recv() => Ok(TERMINATED),
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await.map(|()| INTERRUPTED)
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
    /// Plain HTTP will do, across the internet too.
    insecure: bool,
}

impl Line {
    /// Until Ctrl-C, or the process is asked to end; it does so within two seconds.
    pub(crate) fn open(trust: &Trust) -> anyhow::Result<Self> {
        heap::limit_arenas();
        let network = Network::start()?;
        Ok(Self {
            client: trust.client()?,
            clock: Clock::start(),
            stop: network.end_on_signal(),
            network,
            insecure: trust.insecure,
        })
    }

    /// That whoever is on the way to `server` cannot read what is said to it, unless it is wanted so.
    ///
    /// # Errors
    /// If they can, and it is not.
    pub(crate) fn check_protection(&self, server: &ServerUrl) -> anyhow::Result<()> {
        if server.is_unprotected() {
            anyhow::ensure!(
                self.insecure,
                "{server} is reached over the internet without TLS: whoever is on the way could read and use its links and tokens. Ask its operator for https, or give --insecure all the same: motion and voice stay encrypted"
            );
            log::warn!(
                "{server} is reached over the internet without TLS (--insecure): whoever is on the way can read and use its links and tokens"
            );
        } else if server.is_plain() {
            log::warn!(
                "{server} is reached without TLS: whoever is in this network can read and use its links and tokens. Motion and voice stay encrypted"
            );
        }
        Ok(())
    }
}

/// Whose certificates are trusted.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Trust {
    /// A certificate (PEM) to trust beside the system's: for a server with one of its own making
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
    /// Reach the server over the internet by plain HTTP, too: whoever is on the way can read and use its links and tokens
    #[arg(long)]
    insecure: bool,
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
