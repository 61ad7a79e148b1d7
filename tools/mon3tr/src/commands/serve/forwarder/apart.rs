//! The server's side: hands viewers to the forwarder's process, and answers what that asks of their rooms.

use super::wire::{self, MAX_WAITING, ToForwarder, ToServer};
use link_protocol::Name;
use link_protocol::rooms::RoomStatus;
use server::{Forwarding, HandedOver, SendersRoom};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

/// How long the forwarder may take to accept a connection, and to answer a viewer's offer: it joins the sender first.
/// With the sender's own time for an answer that is less than a request may take.
const CONNECT_WITHIN: Duration = Duration::from_secs(1);
const TAKE_WITHIN: Duration = Duration::from_secs(8);

/// A forwarder in another process, which may end and come back.
#[derive(Debug)]
pub(in super::super) struct Apart {
    socket: PathBuf,
    connection: Arc<tokio::sync::Mutex<Option<Connection>>>,
    /// The forwarder could not be reached, which has been logged.
    is_missing: AtomicBool,
    viewers: Arc<AtomicUsize>,
    next: AtomicU64,
}

/// A connection to it.
#[derive(Debug, Clone)]
struct Connection {
    out: mpsc::Sender<ToForwarder>,
    taken: Arc<Mutex<HashMap<u64, Taken>>>,
}

/// A viewer that the forwarder was given.
#[derive(Debug)]
struct Taken {
    room: Arc<dyn SendersRoom>,
    session: Name,
    /// Where its answer is awaited.
    answer: Option<oneshot::Sender<Option<String>>>,
}

impl Apart {
    /// The one that listens at `socket`, now or later.
    pub(in super::super) fn new(socket: PathBuf) -> Self {
        Self {
            socket,
            connection: Arc::default(),
            is_missing: AtomicBool::default(),
            viewers: Arc::default(),
            next: AtomicU64::default(),
        }
    }

    /// The connection, which is opened if there is none.
    async fn connection(&self) -> Option<Connection> {
        let mut kept = self.connection.lock().await;
        if let Some(open) = kept.as_ref().filter(|open| !open.out.is_closed()) {
            return Some(open.clone());
        }
        let connecting = timeout(CONNECT_WITHIN, UnixStream::connect(&self.socket));
        let connected = connecting.await.unwrap_or_else(|late| Err(late.into()));
        let stream = connected
            .inspect_err(|error| {
                // Once: each viewer that a sender hands over asks for it.
                if !self.is_missing.swap(true, Relaxed) {
                    log::warn!(
                        "the forwarder at {} cannot be reached ({error}): `mon3tr-dev forwarder` has to run there",
                        self.socket.display()
                    );
                }
            })
            .ok()?;
        self.is_missing.store(false, Relaxed);
        let (out, waiting) = mpsc::channel(MAX_WAITING);
        let open = Connection {
            out,
            taken: Arc::default(),
        };
        let (read, write) = stream.into_split();
        let writing = tokio::spawn(write_all(write, waiting));
        let (reading, viewers) = (open.clone(), Arc::clone(&self.viewers));
        tokio::spawn(async move {
            let error = reading.read_all(read, &viewers).await;
            log::error!("the forwarder is gone ({error}): its viewers join again once it is back");
            writing.abort();
            viewers.store(0, Relaxed);
            reading.end().await;
        });
        *kept = Some(open.clone());
        Some(open)
    }
}

#[async_trait::async_trait]
impl Forwarding for Apart {
    async fn take(&self, viewer: HandedOver) -> Option<String> {
        let HandedOver {
            room,
            session,
            offer,
            network,
        } = viewer;
        let open = self.connection().await?;
        let number = self.next.fetch_add(1, Relaxed);
        let take = ToForwarder::Take {
            viewer: number,
            room: room.name(),
            session: session.clone(),
            offer,
            network,
        };
        let (answer, answered) = oneshot::channel();
        let taken = Taken {
            room: room.into(),
            session,
            answer: Some(answer),
        };
        open.locked().insert(number, taken);
        if open.out.try_send(take).is_err() {
            open.locked().remove(&number);
            return None;
        }
        timeout(TAKE_WITHIN, answered).await.ok()?.ok()?
    }

    fn leave(&self, session: &Name) {
        // In a task of its own: it is said once, and must not be lost while a connection is made or the queue is full.
        let (kept, session) = (Arc::clone(&self.connection), session.clone());
        tokio::spawn(async move {
            let open = kept.lock().await.clone();
            if let Some(open) = open {
                let _ = open.out.send(ToForwarder::Leave { session }).await;
            }
        });
    }

    fn viewers(&self) -> usize {
        self.viewers.load(Relaxed)
    }
}

impl Connection {
    fn locked(&self) -> MutexGuard<'_, HashMap<u64, Taken>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn room(&self, viewer: u64) -> Option<Arc<dyn SendersRoom>> {
        let taken = self.locked();
        taken.get(&viewer).map(|taken| Arc::clone(&taken.room))
    }

    /// Does what the forwarder asks for until the connection ends; why it did.
    async fn read_all(&self, mut stream: OwnedReadHalf, viewers: &AtomicUsize) -> std::io::Error {
        loop {
            let message = match wire::read(&mut stream).await {
                Ok(message) => message,
                Err(error) => return error,
            };
            match message {
                ToServer::Taken { viewer, answer } => {
                    let mut taken = self.locked();
                    let waits = taken.get_mut(&viewer).and_then(|one| one.answer.take());
                    // A request that has ended waits no longer.
                    let _ = waits.map(|waits| waits.send(answer));
                }
                ToServer::Forget { viewer } => {
                    self.locked().remove(&viewer);
                }
                ToServer::Viewers { count } => viewers.store(count, Relaxed),
                ToServer::Status { question, viewer } => {
                    let room = self.room(viewer);
                    self.answer(async move {
                        let status = match &room {
                            Some(room) => {
                                room.announcement().await.map(|announcement| RoomStatus {
                                    announcement,
                                    ice_servers: room.ice_servers(),
                                })
                            }
                            None => None,
                        };
                        ToForwarder::Status { question, status }
                    });
                }
                ToServer::Offer {
                    question,
                    viewer,
                    sdp,
                } => {
                    let room = self.room(viewer);
                    self.answer(async move {
                        let answer = match &room {
                            Some(room) => room.offer(&sdp).await,
                            None => None,
                        };
                        ToForwarder::Answer { question, answer }
                    });
                }
                ToServer::Left { viewer, session } => {
                    if let Some(room) = self.room(viewer) {
                        tokio::spawn(async move { room.left(&session).await });
                    }
                }
            }
        }
    }

    /// Sends an answer once it is known.
    fn answer(&self, answer: impl Future<Output = ToForwarder> + Send + 'static) {
        let out = self.out.clone();
        tokio::spawn(async move {
            let _ = out.send(answer.await).await;
        });
    }

    /// Tells the senders that their viewers are served no longer.
    async fn end(self) {
        let taken: Vec<Taken> = self.locked().drain().map(|(_, taken)| taken).collect();
        for Taken { room, session, .. } in taken {
            room.left(&session).await;
        }
    }
}

/// Writes what waits, until the connection ends.
async fn write_all(mut stream: OwnedWriteHalf, mut waiting: mpsc::Receiver<ToForwarder>) {
    while let Some(message) = waiting.recv().await {
        if let Err(error) = wire::write(&mut stream, &message).await {
            log::debug!("a message did not reach the forwarder: {error}");
            // One that is too long has not been begun.
            if error.kind() != std::io::ErrorKind::InvalidInput {
                return;
            }
        }
    }
}
