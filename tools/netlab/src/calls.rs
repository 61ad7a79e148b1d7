//! The calls that go through the lab: each has a relay, which ends when nothing has been sent for long.

use crate::{
    Impairment, NetlabError, Statistics,
    pacer::{Pacer, locked},
    relay::{Direction, Relay, RelayConfig},
};
use std::{
    net::{IpAddr, SocketAddr},
    sync::{Arc, Mutex},
    time::Duration,
};
use tokio::{
    sync::watch,
    task::{AbortHandle, JoinSet},
};

/// A call without a packet for this long is over. Longer than any outage: both sides send during one.
const CALL_IDLE: Duration = Duration::from_secs(60);

/// State shared by the lab's front and its calls.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) upstream: SocketAddr,
    pub(crate) stopped: watch::Sender<bool>,
    pub(crate) ip: IpAddr,
    pub(crate) seed: u64,
    pub(crate) pacer: Arc<Pacer>,
    pub(crate) statistics: Arc<Mutex<Statistics>>,
    pub(crate) network: Mutex<Network>,
    pub(crate) calls: Mutex<Calls>,
}

/// The present impairments, and since when they hold.
#[derive(Debug)]
pub(crate) struct Network {
    pub(crate) down: (Impairment, Duration),
    pub(crate) up: (Impairment, Duration),
}

/// The calls that are open.
#[derive(Debug, Default)]
pub(crate) struct Calls {
    opened: u64,
    pub(crate) tasks: JoinSet<()>,
    pub(crate) open: Vec<(Arc<Relay>, AbortHandle)>,
}

impl Shared {
    /// A new call's sockets.
    pub(crate) fn open_relay(&self) -> Result<Arc<Relay>, NetlabError> {
        let call = {
            let mut calls = locked(&self.calls);
            calls.opened += 1;
            calls.opened
        };
        let config = {
            let network = locked(&self.network);
            let mut seeds = fastrand::Rng::with_seed(self.seed.wrapping_add(call.rotate_left(32)));
            RelayConfig {
                ip: self.ip,
                down: network.down.0.clone(),
                up: network.up.0.clone(),
                down_seed: seeds.u64(..),
                up_seed: seeds.u64(..),
                down_epoch: network.down.1,
                up_epoch: network.up.1,
            }
        };
        let relay =
            Relay::open(config, &self.pacer, self.statistics.clone()).map_err(|source| {
                NetlabError::Bind {
                    address: self.ip,
                    source,
                }
            })?;
        Ok(Arc::new(relay))
    }

    /// Lets a call's packets flow until it falls silent or the lab stops.
    pub(crate) fn carry(&self, relay: Arc<Relay>) {
        // A change of the network between the opening and here is not lost: it holds for this call too.
        let network = locked(&self.network);
        relay.set(Direction::Down, network.down.0.clone(), network.down.1);
        relay.set(Direction::Up, network.up.0.clone(), network.up.1);
        locked(&self.statistics).calls += 1;
        let now = self.pacer.now();
        let mut calls = locked(&self.calls);
        calls.open.retain(|(relay, task)| {
            let is_live = now.saturating_sub(relay.last_heard()) < CALL_IDLE;
            if !is_live {
                task.abort();
            }
            is_live
        });
        while calls.tasks.try_join_next().is_some() {}
        let task = calls.tasks.spawn(relay.clone().carry(self.pacer.clone()));
        calls.open.push((relay, task));
    }

    /// Ends a call that was not established.
    pub(crate) fn close(&self, relay: &Arc<Relay>) {
        locked(&self.calls).open.retain(|(open, task)| {
            let is_it = Arc::ptr_eq(open, relay);
            if is_it {
                task.abort();
            }
            !is_it
        });
    }
}
