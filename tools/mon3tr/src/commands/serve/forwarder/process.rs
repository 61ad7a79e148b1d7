//! `mon3tr-dev forwarder`: the forwarder's side.

use super::super::{keep_to_oneself, raise_open_files, reachable, watchdog};
use super::wire::{self, MAX_WAITING, ToForwarder, ToServer};
use crate::network::{Network, asked_to_end};
use anyhow::Context;
use link_call::forward::Halls;
use link_call::{CallError, Signaling};
use link_http::rooms::Answer;
use link_protocol::room_link::ServerUrl;
use link_protocol::rooms::RoomStatus;
use link_protocol::{Name, RoomLink};
use std::collections::HashMap;
use std::io::ErrorKind;
use std::net::Ipv4Addr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{interval, timeout};

/// How long the server may take to answer a question: its sender answers an offer within five seconds.
const ANSWER_WITHIN: Duration = Duration::from_secs(8);

/// How often the number of viewers is reported.
const REPORT_EVERY: Duration = Duration::from_secs(1);

/// Options of `forwarder`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The Unix socket on which to wait for `serve --forward-at`; a process that may write to it can act as the server
    #[arg(long, value_name = "SOCKET")]
    listen: PathBuf,
    /// Viewers at most, of all rooms together
    #[arg(long, value_name = "NUMBER", default_value = "500", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    viewers: usize,
}

/// Runs `forwarder`.
///
/// # Errors
/// If the socket cannot be used.
pub fn run(options: &Options) -> anyhow::Result<()> {
    keep_to_oneself();
    raise_open_files();
    // By which this machine's own loopback is never meant.
    let ip = reachable(Ipv4Addr::UNSPECIFIED.into());
    let address: ServerUrl = format!("http://{ip}").parse()?;
    let halls = Halls::new(options.viewers);
    let network = Network::start()?;
    network.spawn(async { match watchdog::report().await {} });
    network.block_on(async {
        let listener = listen(&options.listen)?;
        println!(
            "forwarding to at most {} viewers of `serve --forward-at {}`",
            options.viewers,
            options.listen.display()
        );
        let serving = async {
            loop {
                let (stream, _) = listener
                    .accept()
                    .await
                    .context("cannot take a connection")?;
                let (halls, address) = (halls.clone(), address.clone());
                tokio::spawn(async move {
                    let ended = serve(stream, halls, address).await;
                    log::warn!("the server is gone ({ended}): viewers stay, newcomers wait for it");
                });
            }
        };
        tokio::select! {
            asked = asked_to_end() => asked.map(drop).context("cannot wait for Ctrl-C"),
            failed = serving => failed,
        }
    })
}

/// Waits at `path`, where a process before this one may have left its socket.
fn listen(path: &Path) -> anyhow::Result<UnixListener> {
    let cannot = || format!("cannot listen on {}", path.display());
    if std::os::unix::net::UnixStream::connect(path).is_ok() {
        return Err(std::io::Error::from(ErrorKind::AddrInUse)).with_context(cannot);
    }
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(error).with_context(cannot);
        }
        _ => {}
    }
    let listener = UnixListener::bind(path).with_context(cannot)?;
    // The server may be another user, of the same group.
    let group = std::fs::Permissions::from_mode(0o660);
    std::fs::set_permissions(path, group).with_context(cannot)?;
    Ok(listener)
}

/// Serves one server until its connection ends; why it did.
async fn serve(stream: UnixStream, halls: Halls, address: ServerUrl) -> std::io::Error {
    let (mut read, mut write) = stream.into_split();
    let (out, mut waiting) = mpsc::channel(MAX_WAITING);
    let writing = tokio::spawn(async move {
        while let Some(message) = waiting.recv().await {
            if let Err(error) = wire::write(&mut write, &message).await {
                log::debug!("a message did not reach the server: {error}");
                return;
            }
        }
    });
    let reporting = tokio::spawn(report(halls.clone(), out.clone()));
    let server = ServerLine {
        out,
        asked: Arc::default(),
        next: Arc::default(),
    };
    let ended = loop {
        match wire::read(&mut read).await {
            Ok(ToForwarder::Take {
                viewer,
                room,
                session,
                offer,
                network,
            }) => {
                // There is no token: nothing is asked over HTTP.
                let link = RoomLink::of(address.clone(), room.as_str(), "none");
                let (halls, server) = (halls.clone(), server.clone());
                tokio::spawn(async move {
                    let answer = match link {
                        Ok(link) => {
                            let room = Arc::new(RoomThere {
                                link,
                                viewer,
                                server: server.clone(),
                            });
                            halls.take(room, session, offer, network).await
                        }
                        Err(error) => Err(error.into()),
                    };
                    let answer = answer
                        .inspect_err(|error| log::warn!("a viewer is not forwarded to: {error}"));
                    server.send(ToServer::Taken {
                        viewer,
                        answer: answer.ok(),
                    });
                });
            }
            Ok(ToForwarder::Leave { session }) => halls.leave(&session),
            Ok(ToForwarder::Status { question, status }) => {
                server.answered(question, Reply::Status(status));
            }
            Ok(ToForwarder::Answer { question, answer }) => {
                server.answered(question, Reply::Answer(answer));
            }
            Err(error) => break error,
        }
    };
    reporting.abort();
    writing.abort();
    // Ends the requests that wait for an answer of this server.
    server.locked().clear();
    ended
}

/// Reports how many viewers there are.
async fn report(halls: Halls, out: mpsc::Sender<ToServer>) {
    let mut ticks = interval(REPORT_EVERY);
    loop {
        ticks.tick().await;
        let count = halls.viewers();
        if out.send(ToServer::Viewers { count }).await.is_err() {
            return;
        }
    }
}

/// The server, as rooms ask it.
#[derive(Debug, Clone)]
struct ServerLine {
    out: mpsc::Sender<ToServer>,
    asked: Arc<Mutex<HashMap<u64, oneshot::Sender<Reply>>>>,
    next: Arc<AtomicU64>,
}

/// An answer of the server's.
#[derive(Debug)]
enum Reply {
    Status(Option<RoomStatus>),
    Answer(Option<(Name, String)>),
}

impl ServerLine {
    fn locked(&self) -> MutexGuard<'_, HashMap<u64, oneshot::Sender<Reply>>> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn send(&self, message: ToServer) {
        if self.out.try_send(message).is_err() {
            log::debug!("the server is gone, or reads nothing");
        }
    }

    fn answered(&self, question: u64, reply: Reply) {
        if let Some(waits) = self.locked().remove(&question) {
            // The request may have timed out.
            let _ = waits.send(reply);
        }
    }

    async fn ask(&self, question: impl FnOnce(u64) -> ToServer) -> Option<Reply> {
        let number = self.next.fetch_add(1, Relaxed);
        let (reply, replied) = oneshot::channel();
        self.locked().insert(number, reply);
        self.send(question(number));
        let replied = timeout(ANSWER_WITHIN, replied).await;
        self.locked().remove(&number);
        replied.ok()?.ok()
    }
}

/// A room of the server's.
#[derive(Debug)]
struct RoomThere {
    link: RoomLink,
    /// By which the server knows it.
    viewer: u64,
    server: ServerLine,
}

#[async_trait::async_trait]
impl Signaling for RoomThere {
    fn room(&self) -> &RoomLink {
        &self.link
    }

    async fn status(&self) -> Result<RoomStatus, CallError> {
        let viewer = self.viewer;
        let asked = |question| ToServer::Status { question, viewer };
        match self.server.ask(asked).await {
            Some(Reply::Status(Some(status))) => Ok(status),
            _ => Err(CallError::SenderAbsent),
        }
    }

    async fn offer(&self, sdp: &str) -> Result<Answer, CallError> {
        let (viewer, sdp) = (self.viewer, sdp.to_owned());
        let asked = |question| ToServer::Offer {
            question,
            viewer,
            sdp,
        };
        match self.server.ask(asked).await {
            Some(Reply::Answer(Some((session, sdp)))) => Ok(Answer { sdp, session }),
            _ => Err(CallError::SenderAbsent),
        }
    }

    async fn left(&self, session: &Name) {
        self.server.send(ToServer::Left {
            viewer: self.viewer,
            session: session.clone(),
        });
    }
}

impl Drop for RoomThere {
    fn drop(&mut self) {
        let viewer = self.viewer;
        self.server.send(ToServer::Forget { viewer });
    }
}
