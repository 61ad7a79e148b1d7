//! The lab as a whole: a front for a real server, and the network between the sender and viewers that meet there.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, SocketAddr},
    sync::{Arc, Mutex},
    time::Duration,
};

use axum::serve::ListenerExt as _;
use tokio::{net::TcpListener, sync::watch, task::JoinHandle};

use crate::{
    Impairment, NetlabError, Statistics, TcpImpairment, TcpRelay,
    calls::{Network, Shared},
    pacer::{Pacer, locked},
    proxy,
    relay::Direction,
};

/// What a lab is made of.
#[derive(Debug, Clone)]
pub struct LabConfig {
    /// The real server, which speaks HTTP (without TLS).
    pub upstream: SocketAddr,
    /// Where the lab listens and receives packets; [`Ipv4Addr::LOCALHOST`] by default. An address of a network
    /// card lets in clients that do not use the loopback.
    pub ip: IpAddr,
    /// The port for HTTP; 0 (the default) for any free port.
    pub port: u16,
    /// From the sender to each viewer.
    pub down: Impairment,
    /// From each viewer to the sender.
    pub up: Impairment,
    /// Same seed, same packets: same chances. Every call has its own sequences.
    pub seed: u64,
    /// The impairment of HTTP (signaling and packages); none by default.
    pub http: Option<TcpImpairment>,
}

impl LabConfig {
    /// A perfect network in front of a server.
    pub fn new(upstream: SocketAddr) -> Self {
        Self {
            upstream,
            ip: IpAddr::V4(Ipv4Addr::LOCALHOST),
            port: 0,
            down: Impairment::default(),
            up: Impairment::default(),
            seed: 1,
            http: None,
        }
    }
}

/// A running network. Dropping it stops it.
#[derive(Debug)]
pub struct Lab {
    shared: Arc<Shared>,
    address: SocketAddr,
    front: JoinHandle<io::Result<()>>,
    tcp: Option<TcpRelay>,
}

impl Lab {
    /// Starts a lab on the current runtime.
    ///
    /// # Errors
    /// [`NetlabError::Bind`].
    pub async fn start(config: LabConfig) -> Result<Self, NetlabError> {
        let bind = |source| NetlabError::Bind {
            address: config.ip,
            source,
        };
        // With HTTP impaired the requested port is the relay's, in front of the lab's own.
        let front_port = if config.http.is_some() {
            0
        } else {
            config.port
        };
        let listener = TcpListener::bind((config.ip, front_port))
            .await
            .map_err(bind)?;
        let front = listener.local_addr().map_err(bind)?;
        let pacer = Arc::new(Pacer::start().map_err(bind)?);
        let tcp = match config.http {
            Some(http) => {
                Some(TcpRelay::start((config.ip, config.port).into(), front, http).await?)
            }
            None => None,
        };
        let address = tcp.as_ref().map_or(front, TcpRelay::address);
        let now = pacer.now();
        let shared = Arc::new(Shared {
            upstream: config.upstream,
            stopped: watch::Sender::new(false),
            ip: config.ip,
            seed: config.seed,
            pacer,
            statistics: Arc::default(),
            network: Mutex::new(Network {
                down: (config.down, now),
                up: (config.up, now),
            }),
            calls: Mutex::default(),
        });
        let listener = listener.tap_io(|stream| {
            if let Err(error) = stream.set_nodelay(true) {
                log::debug!("netlab: {error}");
            }
        });
        let mut stopped = shared.stopped.subscribe();
        let front = axum::serve(listener, proxy::router(shared.clone())).with_graceful_shutdown(
            async move {
                let _ = stopped.wait_for(|&stopped| stopped).await;
            },
        );
        Ok(Self {
            shared,
            address,
            front: tokio::spawn(front.into_future()),
            tcp,
        })
    }

    /// Where viewers find the server by way of the lab: `http://ADDRESS/rooms/ROOM#TOKEN`.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Changes the network in one direction, for calls under way and to come. Times in the impairment count from now.
    pub fn set(&self, direction: Direction, impairment: Impairment) {
        let now = self.shared.pacer.now();
        let mut network = locked(&self.shared.network);
        for (relay, _) in &locked(&self.shared.calls).open {
            relay.set(direction, impairment.clone(), now);
        }
        match direction {
            Direction::Down => network.down = (impairment, now),
            Direction::Up => network.up = (impairment, now),
        }
    }

    /// Starts an outage of both directions now; all else stays as it is.
    pub fn cut(&self, length: Duration) {
        let now = self.shared.pacer.now();
        let mut network = locked(&self.shared.network);
        let Network { down, up } = &mut *network;
        for ((impairment, epoch), direction) in [(down, Direction::Down), (up, Direction::Up)] {
            // Kept epoch: a trace goes on where it is.
            impairment.outages.push(crate::Outage {
                at: now.saturating_sub(*epoch),
                length,
            });
            for (relay, _) in &locked(&self.shared.calls).open {
                relay.set(direction, impairment.clone(), *epoch);
            }
        }
    }

    /// The statistics until now.
    pub fn statistics(&self) -> Statistics {
        let mut statistics = locked(&self.shared.statistics).clone();
        statistics.punctuality = self.shared.pacer.punctuality();
        statistics
    }

    /// Time since the lab was started: the clock of [`Statistics`]'s seconds.
    pub fn elapsed(&self) -> Duration {
        self.shared.pacer.now()
    }

    /// Ends every call and connection, and returns the statistics.
    pub async fn stop(mut self) -> Statistics {
        self.shared.stopped.send_replace(true);
        drop(self.tcp.take());
        // Connections that would not end by themselves end with the task.
        let _ = tokio::time::timeout(Duration::from_secs(1), &mut self.front).await;
        self.statistics()
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        self.shared.stopped.send_replace(true);
        self.front.abort();
        let mut calls = locked(&self.shared.calls);
        calls.open.clear();
        calls.tasks.abort_all();
    }
}
