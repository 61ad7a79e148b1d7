//! How instances share their rooms: by NATS, and only its core. The instance that has a room's sender listens on the
//! room's subject, any other asks there; where nobody listens, NATS says so at once. Nothing is stored anywhere, so an
//! instance or a NATS server that dies takes no room with it: the sender connects again.

use crate::rooms::{Ask, Presence, Reply};
use crate::{Id, ServerError};
use async_nats::connection::State;
use async_nats::{Client, ConnectOptions, Event, RequestErrorKind, Subscriber};
use futures_util::StreamExt;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;

/// How long NATS may take for what concerns no sender.
const NATS_WITHIN: Duration = Duration::from_secs(2);

/// The way to other instances.
#[derive(Debug)]
pub(crate) struct Relay {
    client: Client,
    /// How long another instance may take: a sender's time to answer and some for the way.
    reply_within: Duration,
    /// Asks under way for one room.
    asks_per_room: usize,
}

impl Relay {
    /// Starts to connect, and goes on trying: a NATS server that is down delays nothing but what needs it.
    pub(crate) async fn connect(
        address: &str,
        answer_within: Duration,
        asks_per_room: usize,
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
        // What the client says may repeat the address, and with it a password.
        let client = options
            .connect(address)
            .await
            .map_err(|e| ServerError::Nats {
                reason: e.kind().to_string(),
            })?;
        Ok(Self {
            client,
            reply_within,
            asks_per_room,
        })
    }

    /// Whether NATS can be reached at this moment.
    pub(crate) fn is_connected(&self) -> bool {
        self.client.connection_state() == State::Connected
    }

    /// Asks whichever instance has the room's sender.
    pub(crate) async fn ask(&self, room: Id, ask: &Ask) -> Reply {
        if !self.is_connected() {
            return Reply::Unreachable;
        }
        let Ok(payload) = serde_json::to_vec(ask) else {
            return Reply::Unreachable;
        };
        let asked = self.client.request(ask_subject(room), payload.into());
        match tokio::time::timeout(self.reply_within, asked).await {
            Ok(Ok(message)) => serde_json::from_slice(&message.payload).unwrap_or_else(|e| {
                log::warn!("an instance answers in another version's way: {e}");
                Reply::Unreachable
            }),
            Ok(Err(e)) if e.kind() == RequestErrorKind::NoResponders => Reply::Absent,
            Ok(Err(e)) if e.kind() == RequestErrorKind::TimedOut => Reply::Unanswered,
            Ok(Err(e)) => {
                log::warn!("NATS: {e}");
                Reply::Unreachable
            }
            Err(_) => Reply::Unanswered,
        }
    }

    /// Answers what other instances ask about a room for as long as its sender is here, and tells them that it is:
    /// where it was before, it is replaced.
    pub(crate) async fn hold(&self, room: Id, presence: Arc<Presence>) {
        let held = async {
            let asks = self.client.subscribe(ask_subject(room)).await.ok()?;
            let others = self.client.subscribe(present_subject(room)).await.ok()?;
            Some((asks, others))
        };
        let Ok(Some((asks, others))) = tokio::time::timeout(NATS_WITHIN, held).await else {
            log::error!(
                "NATS does not take the subscriptions of a room: only this instance serves it"
            );
            return;
        };
        // Until the subscription stands nobody else can ask; the wait is bounded because NATS may be down.
        let stay = present_id(&presence).into();
        let stands = async {
            self.client.flush().await.ok()?;
            self.client.publish(present_subject(room), stay).await.ok()
        };
        if self.is_connected() && tokio::time::timeout(NATS_WITHIN, stands).await.is_err() {
            log::warn!("NATS is slow to take the subscriptions of a room");
        }
        let relay = (self.client.clone(), self.asks_per_room);
        tokio::spawn(listen(relay, asks, others, presence));
    }
}

async fn listen(
    (client, asks_at_once): (Client, usize),
    mut asks: Subscriber,
    mut others: Subscriber,
    presence: Arc<Presence>,
) {
    let gone = presence.gone();
    let places = Arc::new(Semaphore::new(asks_at_once.max(1)));
    loop {
        tokio::select! {
            () = gone.cancelled() => break,
            Some(message) = others.next() => {
                // Its own message comes back, too.
                if message.payload != present_id(&presence) {
                    presence.replace();
                }
            }
            Some(message) = asks.next() => {
                let Some(reply_to) = message.reply else { continue };
                let Ok(ask) = serde_json::from_slice::<Ask>(&message.payload) else {
                    log::warn!("an instance asks in another version's way");
                    continue;
                };
                let place = Arc::clone(&places).try_acquire_owned();
                let (client, presence) = (client.clone(), Arc::clone(&presence));
                tokio::spawn(async move {
                    let reply = match place {
                        Ok(_) => presence.ask(ask).await,
                        Err(_) => Reply::Busy,
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

/// What tells one stay of a sender from another.
fn present_id(presence: &Presence) -> Vec<u8> {
    presence.stay().to_string().into_bytes()
}
