//! The call that is profiled: a server and a sender, each a process of its own on this machine, and this process as the viewer.

use super::Options;
use crate::children::{LocalServer, Process};
use crate::commands::receive::wait_for_sender;
use crate::network::Network;
use anyhow::Context;
use app_session::call::Call;
use link_call::Viewer;
use link_http::Client;
use link_playout::Clock;
use link_protocol::{Announcement, RoomLink};
use serde_json::Value;
use spmm3::Skeleton;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// A room with a sender in it, which begins to perform when somebody joins.
pub(super) struct Room {
    network: Network,
    client: Client,
    clock: Clock,
    link: RoomLink,
    announced: Announcement,
    /// Becomes true on Ctrl-C.
    pub(super) stop: Arc<AtomicBool>,
    sender: Process,
    server: LocalServer,
    sent: PathBuf,
    // Last: the others write into it.
    _folder: TempDir,
}

impl Room {
    /// Starts a server and a sender of the avatar `package`; nothing if it is time to leave before they are there.
    pub(super) fn open(options: &Options, package: &Path) -> anyhow::Result<Option<Self>> {
        let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
        let server = LocalServer::start(folder.path())?;
        let network = Network::start()?;
        let client = Client::new(None)?;
        let clock = Clock::start();
        let stop = network.stop_on_signal();
        let (sender_link, link) = network.block_on(server.open_room(&client))?;
        let sent = folder.path().join("sent.json");
        let mut arguments: Vec<OsString> = vec![
            "--room".into(),
            sender_link.to_string().into(),
            "--rate".into(),
            options.rate.to_string().into(),
            "--avatar".into(),
            package.into(),
            "--json".into(),
            sent.clone().into(),
        ];
        arguments.extend(options.motion.arguments());
        let sender = Process::start_sender(arguments, &server.owner_token)?;
        let announced = network.block_on(wait_for_sender(&client, &link, &stop))?;
        Ok(announced.map(|announced| Self {
            network,
            client,
            clock,
            link,
            announced,
            stop,
            sender,
            server,
            sent,
            _folder: folder,
        }))
    }

    /// Joins as a viewer of a person with this `skeleton`: the performance begins.
    pub(super) fn join(&self, skeleton: &Skeleton) -> Call {
        let (client, link) = (self.client.clone(), self.link.clone());
        let viewer = self
            .network
            .block_on(async { Viewer::join(client, link, self.clock) });
        Call::new(viewer, self.announced, skeleton, self.clock)
    }

    /// Ends the call and everybody in it, and returns what the sender measured.
    pub(super) fn close(self, call: Call) -> anyhow::Result<Value> {
        self.network.block_on(call.hang_up());
        self.sender.stop()?;
        self.server.stop()?;
        let text = std::fs::read(&self.sent).context("cannot read the sender's figures")?;
        serde_json::from_slice(&text).context("cannot read the sender's figures")
    }
}
