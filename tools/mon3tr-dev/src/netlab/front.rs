//! `netlab --before`: a network of this quality in front of a server that runs, for calls whose other end is a device of its own.

use super::Options;
use anyhow::{Context, ensure};
use mon3tr::network::Network;
use netlab::{Lab, LabConfig};
use std::net::SocketAddr;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

/// How often to look whether it is time to end.
const LOOK: Duration = Duration::from_millis(100);

/// Holds it until Ctrl-C, then prints what became of the packets.
pub(super) fn hold(options: &Options, server: SocketAddr) -> anyhow::Result<()> {
    let mut conditions = options.shape.conditions()?;
    let condition = conditions.pop().context("no network was asked for")?;
    ensure!(
        conditions.is_empty(),
        "--before needs to know what the network is like: --loss, --delay and the like"
    );
    ensure!(
        condition.outage.is_none(),
        "--outage counts from the begin of a call, which --before does not know"
    );
    let network = Network::start()?;
    let lab = network.block_on(Lab::start(LabConfig {
        seed: options.seed,
        down: condition.down,
        up: condition.up,
        // The server's own: whoever reaches it reaches this.
        ip: server.ip(),
        ..LabConfig::new(server)
    }))?;
    println!(
        "a network of {} before http://{server}: viewers join at http://{}",
        condition.name,
        lab.address()
    );
    let stop = network.stop_on_signal();
    while !stop.load(Relaxed) {
        std::thread::sleep(LOOK);
    }
    let statistics = network.block_on(lab.stop());
    println!("{}", serde_json::to_string_pretty(&statistics)?);
    Ok(())
}
