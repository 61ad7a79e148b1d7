//! The call that is profiled: a server and a sender, each a process of its own on this machine, and this process as the viewer.

use super::Options;
use crate::children::{LocalServer, Process};
use crate::commands::receive::wait_for_sender;
use crate::network::Network;
use anyhow::Context;
use app_session::call::CallWatch;
use app_session::participant::{NetworkContext, Origin, Participant};
use link_http::Client;
use link_playout::Clock;
use link_protocol::{Announcement, RoomLink};
use link_voice::VoiceQueue;
use serde_json::Value;
use spmm3::Avatar;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// A room with a sender in it, which begins to perform when a viewer joins.
pub(super) struct Room {
    // Before the threads end that hang up on it.
    _network: Network,
    context: NetworkContext,
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
            context: NetworkContext {
                network: network.handle(),
                client,
                own: None,
                clock: Clock::start(),
            },
            _network: network,
            link,
            announced,
            stop,
            sender,
            server,
            sent,
            _folder: folder,
        }))
    }

    /// The sender, as a session takes it: the performance begins when the session joins.
    pub(super) fn participant(&self, avatar: &Arc<Avatar>) -> Participant {
        Participant {
            avatar: Arc::clone(avatar),
            sits: false,
            origin: Origin::Room {
                link: self.link.clone(),
                announced: self.announced,
                network: self.context.clone(),
                voice: VoiceQueue::default(),
                watch: CallWatch::default(),
            },
        }
    }

    /// Ends the sender and the server, and returns what the sender measured.
    pub(super) fn close(self) -> anyhow::Result<Value> {
        self.sender.stop()?;
        self.server.stop()?;
        let text = std::fs::read(&self.sent).context("cannot read the sender's figures")?;
        serde_json::from_slice(&text).context("cannot read the sender's figures")
    }
}
