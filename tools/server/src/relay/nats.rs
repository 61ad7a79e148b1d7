//! Instances share their rooms through NATS, and use only its core. The instance that a room's sender is connected to subscribes to
//! the room's subject, the others send requests there; without a subscriber NATS answers at once. Nothing is stored, so no room is lost with
//! an instance or a NATS server: the sender connects again.

use crate::rooms::{Presence, RoomReply, RoomRequest};
use crate::{Id, ServerError};
use async_nats::connection::State;
use async_nats::{Client, ConnectOptions, Event, RequestErrorKind, Subscriber};
use futures_util::StreamExt;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;

/// How long NATS may take for requests that need no sender's answer.
const NATS_WITHIN: Duration = Duration::from_secs(2);

/// The connection to the other instances.
#[derive(Debug)]
pub(crate) struct Relay {
    client: Client,
    /// How long another instance may take: a sender's time to answer and NATS's own.
    reply_within: Duration,
    /// Requests at once for one room.
    requests_per_room: usize,
}

impl Relay {
    /// Starts to connect, and goes on trying: a NATS server that is down does not delay the start.
    pub(crate) async fn connect(
        address: &str,
        answer_within: Duration,
        requests_per_room: usize,
    ) -> Result<Self, ServerError> {
        let reply_within = answer_within + NATS_WITHIN;
        let options = ConnectOptions::new()
            .name("mon3tr server")
            .retry_on_initial_connect()
            .max_reconnects(None)
            .connection_timeout(NATS_WITHIN)
            .ping_interval(Duration::from_secs(5))
            .request_timeout(Some(reply_within))
            .reconnect_delay_callback(|attempt| {
                Duration::from_millis(100 * u64::try_from(attempt).unwrap_or(20).min(20))
            })
            .event_callback(|event| async move {
                match event {
                    Event::Connected => log::info!("connected to NATS: rooms are shared"),
                    Event::Disconnected => {
                        log::error!("no connection to NATS: only rooms of this instance are served until it is back");
                    }
                    other => log::warn!("NATS: {other}"),
                }
            });
        // The client's own message may repeat the address, and with it a password.
        let client = options
            .connect(address)
            .await
            .map_err(|e| ServerError::Nats {
                reason: e.kind().to_string(),
            })?;
        Ok(Self {
            client,
            reply_within,
            requests_per_room,
        })
    }

    /// Whether NATS can be reached at this moment.
    pub(crate) fn is_connected(&self) -> bool {
        self.client.connection_state() == State::Connected
    }

    /// Asks the instance that the room's sender is connected to.
    pub(crate) async fn ask(&self, room: Id, request: &RoomRequest) -> RoomReply {
        if !self.is_connected() {
            return RoomReply::Unreachable;
        }
        let Ok(payload) = serde_json::to_vec(request) else {
            return RoomReply::Unreachable;
        };
        let asked = self.client.request(ask_subject(room), payload.into());
        match tokio::time::timeout(self.reply_within, asked).await {
            Ok(Ok(message)) => serde_json::from_slice(&message.payload).unwrap_or_else(|e| {
                log::warn!("the reply of an instance of another version cannot be read: {e}");
                RoomReply::Unreachable
            }),
            Ok(Err(e)) if e.kind() == RequestErrorKind::NoResponders => RoomReply::Absent,
            Ok(Err(e)) if e.kind() == RequestErrorKind::TimedOut => RoomReply::Unanswered,
            Ok(Err(e)) => {
                log::warn!("NATS: {e}");
                RoomReply::Unreachable
            }
            Err(_) => RoomReply::Unanswered,
        }
    }

    /// Answers other instances' requests for a room while its sender is connected here, and tells them that it is: a presence on another
    /// instance is replaced.
    pub(crate) async fn hold(&self, room: Id, presence: Arc<Presence>) {
        let held = async {
            let requests = self.client.subscribe(ask_subject(room)).await.ok()?;
            let others = self.client.subscribe(present_subject(room)).await.ok()?;
            Some((requests, others))
        };
        let Ok(Some((requests, others))) = tokio::time::timeout(NATS_WITHIN, held).await else {
            log::error!(
                "NATS does not take the subscriptions of a room: only this instance serves it"
            );
            return;
        };
        // Without the subscription no other instance can ask; the wait is bounded because NATS may be down.
        let connection = present_id(&presence).into();
        let subscribed = async {
            self.client.flush().await.ok()?;
            self.client
                .publish(present_subject(room), connection)
                .await
                .ok()
        };
        if self.is_connected() && tokio::time::timeout(NATS_WITHIN, subscribed).await.is_err() {
            log::warn!("NATS is slow to take the subscriptions of a room");
        }
        let relay = (self.client.clone(), self.requests_per_room);
        tokio::spawn(listen(relay, requests, others, presence));
    }
}

async fn listen(
    (client, requests_at_once): (Client, usize),
    mut requests: Subscriber,
    mut others: Subscriber,
    presence: Arc<Presence>,
) {
    let gone = presence.gone();
    let places = Arc::new(Semaphore::new(requests_at_once.max(1)));
    loop {
        tokio::select! {
            () = gone.cancelled() => break,
            Some(message) = others.next() => {
                // Its own message comes back as well.
                if message.payload != present_id(&presence) {
                    presence.replace();
                }
            }
            Some(message) = requests.next() => {
                let Some(reply_to) = message.reply else { continue };
                let Ok(request) = serde_json::from_slice::<RoomRequest>(&message.payload) else {
                    log::warn!("the request of an instance of another version cannot be read");
                    continue;
                };
                let place = Arc::clone(&places).try_acquire_owned();
                let (client, presence) = (client.clone(), Arc::clone(&presence));
                tokio::spawn(async move {
                    let reply = match place {
                        Ok(_) => presence.ask(request).await,
                        Err(_) => RoomReply::Busy,
                    };
                    let Ok(payload) = serde_json::to_vec(&reply) else { return };
                    if let Err(e) = client.publish(reply_to, payload.into()).await {
                        log::warn!("NATS does not take an answer: {e}");
                    }
                });
            }
            else => break,
        }
    }
}

fn ask_subject(room: Id) -> String {
    format!("mon3tr.1.room.{room}.ask")
}

fn present_subject(room: Id) -> String {
    format!("mon3tr.1.room.{room}.present")
}

/// The subject that distinguishes a sender's connections.
fn present_id(presence: &Presence) -> Vec<u8> {
    presence.connection().to_string().into_bytes()
}
