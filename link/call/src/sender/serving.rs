//! One viewer of a sender: its connection, what it is sent, and what it sends back.

use super::Shared;
use super::hearing::Heard;
use super::watching::Forwards;
use crate::door::Stay;
use crate::introduction;
use crate::path::Path;
use crate::peer::{Peer, PeerEvent, SendOutcome};
use crate::plan::Plan;
use crate::sdp::Description;
use crate::seal::{Sealer, Sealing};
use crate::telling::{Repeated, Telling};
use crate::visitor::Visitor;
use crate::{CallError, answer_bye, is_set, send_bye};
use identity::Purpose;
use link_codec::{Encoder, Micros, MotionFrame};
use link_protocol::data_channel::{Message, Pong, State};
use link_protocol::{Name, Refusal, Rights, RoomLink, sealed};
use link_voice::{Voice, timestamp};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, broadcast, watch};
use tokio::time::{Instant, sleep_until, timeout};

/// From an offer to the open channel.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);

/// A viewer sends feedback at least five times a second; after a silence this long it is dropped.
const SILENCE_TIMEOUT: Duration = Duration::from_secs(4);

/// A viewer's silence after which this side's own way to the server is doubted, too, if enough others are silent
/// ([`Heard`]): its router may have another address now, of which this machine is told nothing. The viewer offers a new
/// connection a little later ([`crate::viewer`]), which has to find this side in the room.
const DOUBT: Duration = Duration::from_millis(600);

/// A viewer's offer.
pub(super) struct Offer {
    pub(super) sdp: String,
    /// It is of the server's forwarder.
    pub(super) forwards: bool,
    /// What the server calls the viewer's token.
    pub(super) token: Option<Name>,
    /// What the server calls the viewer's network.
    pub(super) network: Option<Name>,
}

/// What goes to one viewer: as it is, or sealed for a forwarder to hand on.
struct Outlet<'a> {
    peer: &'a mut Peer,
    sealer: Option<Sealer>,
    session: u32,
    sealed: Vec<u8>,
}

impl Outlet<'_> {
    async fn send(&mut self, message: &[u8]) -> SendOutcome {
        let Some(sealer) = &mut self.sealer else {
            return self.peer.try_send(message).await;
        };
        match sealer.message(self.session, message, &mut self.sealed) {
            Sealing::Sealed => self.peer.try_send(&self.sealed).await,
            Sealing::NoViewer => SendOutcome::Skipped,
            Sealing::Failed => SendOutcome::Closed,
        }
    }

    /// Sends a message of keys, which forwarders hand on; whether it could be sent.
    async fn send_keys(&mut self, keys: &[u8]) -> bool {
        let Some(sealer) = &mut self.sealer else {
            return false;
        };
        sealer.keys(self.session, keys, &mut self.sealed)
            && self.peer.try_send(&self.sealed).await == SendOutcome::Queued
    }

    async fn say(&mut self, Voice { captured, opus }: Voice) -> bool {
        let timestamp = timestamp::from_time(captured);
        let opus = match &mut self.sealer {
            Some(sealer) => sealer.voice(timestamp, &opus),
            None => Some(opus),
        };
        match opus {
            Some(opus) => self.peer.send_voice(timestamp, opus).await,
            None => false,
        }
    }
}

impl Shared {
    /// Decides whether this side or the server serves the side that offers.
    ///
    /// # Errors
    /// If neither does.
    async fn admit(
        &self,
        room: &RoomLink,
        name: &Name,
        offer: &Offer,
    ) -> Result<Admission<Admitted>, CallError> {
        // What is sealed is of no use to a forwarder, so it has nothing to prove.
        let hands_over =
            self.places.forwards.load(Relaxed) && introduction::may_be_handed_over(room);
        if offer.forwards && hands_over {
            let sealer = Sealer::new(room, self.avatar, self.epochs.clone())?;
            return match take(&self.places.forwarders) {
                Some(place) => Ok(Admission::Served(Admitted {
                    offer: Description::read(&offer.sdp)?,
                    visitor: None,
                    place: Some(place),
                    sealer,
                })),
                None => Err(CallError::TooManyViewers),
            };
        }
        let own = self.credentials.as_ref();
        let (visitor, offer_read) = introduction::check_viewer(own, room, &offer.sdp)?;
        if room.is_seat() {
            match self.door.is_seated(&visitor).await {
                Some(true) => {}
                Some(false) => return Err(CallError::Refused(Refusal::Seat)),
                // The server does not answer, which is not the viewer's fault.
                None => return Err(CallError::TooManyViewers),
            }
        }
        (self.door)
            .knock(&visitor, offer.token.as_ref(), crate::now())
            .map_err(CallError::Refused)?;
        // What is handed over is seen and heard whole.
        let may_be_handed_over = visitor.rights() == Rights::ALL;
        let place = if hands_over && may_be_handed_over {
            take(&self.places.viewers).map(Some)
        } else {
            let has_room = self.door.has_room(&visitor, offer.network.as_ref());
            has_room.then_some(None)
        };
        match place {
            Some(place) => Ok(Admission::Served(Admitted {
                offer: offer_read,
                visitor: Some(visitor),
                place,
                sealer: None,
            })),
            None if hands_over && may_be_handed_over => {
                let exchange = offer_read.shown.exchange.as_deref();
                let [answer, signed] = self.epochs.admit(name, exchange, room, self.avatar)?;
                // Before the answer: the viewer may be removed as soon as it is there.
                if !self.door.hand_over(visitor, name.clone()) {
                    self.epochs.leave(name);
                    return Err(CallError::TooManyViewers);
                }
                let shown = introduction::lines(own, room, Purpose::Exchange, &signed);
                let exchange = format!("{}{answer}\r\n{shown}", sealed::EXCHANGE_LINE);
                let answer = Refusal::Full.answer() + &exchange;
                Ok(Admission::HandedOver { answer })
            }
            None => Err(CallError::TooManyViewers),
        }
    }

    /// The same; where this side serves the one that offers, with this side of their connection and the answer.
    async fn prepare(
        &self,
        room: &RoomLink,
        name: &Name,
        offer: &Offer,
        plan: Plan,
    ) -> Result<Admission<(Admitted, Peer, String)>, CallError> {
        let admitted = match self.admit(room, name, offer).await? {
            Admission::Served(admitted) => admitted,
            Admission::HandedOver { answer } => return Ok(Admission::HandedOver { answer }),
        };
        let offer = &admitted.offer;
        let (peer, answer) = Peer::answer(plan, self.channel, offer).await?;
        let own = self.credentials.as_ref();
        let answer = introduction::introduce_sender(own, room, self.avatar, offer, &answer)?;
        Ok(Admission::Served((admitted, peer, answer)))
    }

    /// Answers a viewer that is refused.
    async fn refuse(&self, room: &RoomLink, name: &Name, why: &CallError) {
        let refusal = why.refusal();
        log::debug!("a viewer is refused: {refusal:?}");
        self.decline(room, name, &refusal.answer()).await;
    }

    /// Sends a viewer the answer that this side does not serve it.
    async fn decline(&self, room: &RoomLink, name: &Name, answer: &str) {
        if let Err(error) = self.client.answer(room, name, answer).await {
            log::debug!(
                "the answer to a viewer that is not served here was not delivered: {error}"
            );
            // It waits no longer, so the server does not serve it either.
            self.door.left(name);
            self.epochs.leave(name);
        }
    }
}

/// A place, if one is free.
fn take(places: &Arc<Semaphore>) -> Option<OwnedSemaphorePermit> {
    Arc::clone(places).try_acquire_owned().ok()
}

/// Which side serves the side that offers.
enum Admission<T> {
    Served(T),
    /// The server does, in place of this side.
    HandedOver {
        /// What the viewer is answered, with this side's half of the agreement on the keys.
        answer: String,
    },
}

/// A side that this one serves.
struct Admitted {
    offer: Description,
    /// Who it is, as far as it says so; nothing of the server's forwarder.
    visitor: Option<Visitor>,
    /// Nothing where the server does not forward.
    place: Option<OwnedSemaphorePermit>,
    sealer: Option<Sealer>,
}

/// One viewer from its offer to its end.
pub(super) async fn serve_viewer(
    mut shared: Shared,
    name: &Name,
    offer: Offer,
    mut left: watch::Receiver<bool>,
) -> Result<(), CallError> {
    // Where the offer came from: another seat may be taken meanwhile.
    let room = shared.venue.room();
    let plan = (shared.planner)
        .plan(room.server(), &shared.ice_servers)
        .await;
    let relay = plan.relay.clone();
    let prepared = tokio::select! {
        prepared = shared.prepare(&room, name, &offer, plan) => prepared,
        // It has left, or makes room for newer offers.
        () = is_set(&mut left) => {
            shared.refuse(&room, name, &CallError::TooManyViewers).await;
            return Ok(());
        }
    };
    let (admitted, mut peer, answer) = match prepared {
        Ok(Admission::Served(prepared)) => prepared,
        Ok(Admission::HandedOver { answer }) => {
            shared.decline(&room, name, &answer).await;
            return Ok(());
        }
        Err(why) => {
            shared.refuse(&room, name, &why).await;
            return match why {
                CallError::Refused(Refusal::Seat) => Err(CallError::NotSeated),
                CallError::Refused(Refusal::Link) => Err(why),
                // The viewer has its answer, and the performer decided so before.
                CallError::Refused(_) => Ok(()),
                why => Err(why),
            };
        }
    };
    let Admitted {
        visitor,
        place,
        sealer,
        ..
    } = admitted;
    let Offer {
        forwards, network, ..
    } = offer;
    let introduced = timeout(OPEN_TIMEOUT, async {
        shared.client.answer(&room, name, &answer).await?;
        peer.introduced().await
    });
    let mut stop = shared.stop.clone();
    let session = tokio::select! {
        session = introduced => session.map_err(|_| CallError::NoWay { relay })??,
        () = is_set(&mut left) => return Ok(()),
        () = is_set(&mut stop) => return Ok(()),
    };
    shared.opening.end(name);
    // Before the viewer is counted: its sequences begin at 1 with the first frame captured from now on.
    let before = shared.frames.borrow_and_update().sequence;
    let counts = Arc::clone(&shared.counts);
    counts.viewers.fetch_add(1, Relaxed);
    counts.joined.fetch_add(1, Relaxed);
    let path = peer.path().await;
    let heard = shared.hearing.begin(network.clone());
    let stay = visitor.map(|visitor| shared.door.enter(visitor, network));
    let who = match &stay {
        None => "the server's forwarder".to_owned(),
        Some(_) => "a viewer".to_owned(),
    };
    let known_as = stay.as_ref().map(|stay| format!(", {},", stay.visitor()));
    log::info!(
        "{who} has joined{} (session {session:08x}): {}",
        known_as.unwrap_or_default(),
        Path::told(path.as_ref())
    );
    if let Some(path) = path {
        counts.took(path);
    }
    let outlet = Outlet {
        peer: &mut peer,
        sealer,
        session,
        sealed: Vec::new(),
    };
    let watching = forwards.then(|| shared.watching.begin());
    let why = send_motion(
        &mut shared,
        before,
        outlet,
        place,
        watching,
        &mut left,
        Audience {
            stay: stay.as_ref(),
            heard,
        },
    )
    .await;
    drop(stay);
    counts.viewers.fetch_sub(1, Relaxed);
    log::info!("{who} has left (session {session:08x}): {why}");
    peer.close().await;
    Ok(())
}

/// Who is at the other end.
struct Audience<'a> {
    /// Nothing of the server's forwarder.
    stay: Option<&'a Stay>,
    heard: Heard,
}

/// Sends every frame after `before` until the viewer or this side leaves; returns why it ended.
async fn send_motion(
    shared: &mut Shared,
    before: u32,
    mut outlet: Outlet<'_>,
    mut place: Option<OwnedSemaphorePermit>,
    mut watching: Option<Forwards>,
    left: &mut watch::Receiver<bool>,
    Audience { stay, heard }: Audience<'_>,
) -> &'static str {
    let session = outlet.session;
    let rights = stay.map_or(Rights::ALL, |stay| stay.visitor().rights());
    let mut sent_away = std::pin::pin!(Stay::over(stay));
    let mut encoder = Encoder::new(shared.codec, session);
    let mut out = Vec::with_capacity(1024);
    let mut silent_at = Instant::now() + SILENCE_TIMEOUT;
    let mut doubt_at = Some(Instant::now() + DOUBT);
    let mut last = before;
    // What was said before is over.
    let mut voice = shared.voice.subscribe();
    let mut losses = shared.copies.join(shared.channel);
    let mut telling = Telling::begin(&shared.privacy);
    let mut seals = Repeated::default();
    let mut keys = shared.epochs.distribution();
    loop {
        tokio::select! {
            // In this order: the last frame before the bye, the bye before any flood of the viewer's, and its messages before the
            // silence timeout.
            biased;
            changed = shared.frames.changed() => {
                if changed.is_err() {
                    return "the sender has ended";
                }
                let captured = Arc::clone(&shared.frames.borrow_and_update());
                // Frames captured faster than this task took them.
                let passed_over = captured.sequence.saturating_sub(last.saturating_add(1));
                shared.counts.skipped.fetch_add(passed_over.into(), Relaxed);
                last = captured.sequence;
                if !rights.see {
                    continue;
                }
                let frame = MotionFrame {
                    sequence: captured.sequence.saturating_sub(before),
                    ..MotionFrame::clone(&captured)
                };
                let begun = std::time::Instant::now();
                encoder.encode(&frame, &mut out);
                let took = u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX);
                shared.counts.encoded.fetch_add(1, Relaxed);
                shared.counts.encode_ns.fetch_add(took, Relaxed);
                match outlet.send(&out).await {
                    SendOutcome::Queued => {
                        losses.sent(frame.sequence);
                        shared.counts.sent.fetch_add(1, Relaxed);
                        shared.counts.payload_bytes.fetch_add(out.len() as u64, Relaxed);
                    }
                    SendOutcome::Skipped => {
                        shared.counts.skipped.fetch_add(1, Relaxed);
                    }
                    SendOutcome::Closed => return "its channel is closed",
                }
            }
            said = voice.recv() => match said {
                Ok(_) if !rights.hear => {}
                Ok(said) => {
                    let bytes = said.opus.len() as u64;
                    if outlet.say(said).await {
                        shared.counts.voice_sent.fetch_add(1, Relaxed);
                        shared.counts.voice_bytes.fetch_add(bytes, Relaxed);
                    }
                }
                Err(broadcast::error::RecvError::Lagged(packets)) => {
                    log::debug!("{packets} packets of voice are left out: too much waited");
                }
                Err(broadcast::error::RecvError::Closed) => return "the sender has ended",
            },
            person = telling.due() => {
                let sent = shared.clock.now();
                Message::State(State { person, sent }).write(session, &mut out);
                outlet.send(&out).await;
            }
            () = seals.due(), if outlet.sealer.is_some() => {
                if let Some(sealer) = &outlet.sealer {
                    let lines = sealer.lines(shared.credentials.as_ref());
                    sealed::write_seal(session, &lines, &mut out);
                    outlet.peer.try_send(&out).await;
                }
            }
            message = keys.due(), if outlet.sealer.is_some() => {
                if outlet.send_keys(&message).await {
                    keys.sent();
                }
            }
            () = is_set(left) => return "it left",
            // Without a bye, which would say that the sender hung up: it offers again, and is told why it is not taken.
            why = &mut sent_away => return why,
            () = is_set(&mut shared.stop) => {
                send_bye(outlet.peer, session).await;
                return "the sender hung up";
            }
            event = outlet.peer.next() => {
                let arrived = shared.clock.now();
                let bytes = match event {
                    PeerEvent::Message(bytes) => bytes,
                    PeerEvent::Open | PeerEvent::Voice(_) => continue,
                    PeerEvent::Closed => return "its connection is closed",
                };
                match Message::read(&bytes, session) {
                    Some(Message::Feedback(feedback)) => {
                        silent_at = Instant::now() + SILENCE_TIMEOUT;
                        doubt_at = Some(Instant::now() + DOUBT);
                        heard.is_heard();
                        encoder.acknowledge(feedback.newest, feedback.received);
                        losses.report(feedback);
                        if feedback.sent != Micros(0) {
                            let pong = Pong { asked: feedback.sent, arrived, left: shared.clock.now() };
                            Message::Pong(pong).write(session, &mut out);
                            outlet.peer.try_send(&out).await;
                        }
                    }
                    // Believed of the server's forwarder alone.
                    Some(Message::Watching { viewers }) => {
                        if let Some(watching) = &mut watching {
                            watching.report(viewers);
                        }
                    }
                    Some(Message::Bye) => {
                        answer_bye(outlet.peer, session).await;
                        return "it hung up";
                    }
                    Some(Message::Pong(_) | Message::State(_) | Message::Forwarded { .. }) | None => log::debug!("ignored a message of {} bytes", bytes.len()),
                }
            }
            () = sleep_until(doubt_at.unwrap_or(silent_at)), if doubt_at.is_some() => {
                doubt_at = None;
                // The viewer may come back by another connection before this one is given up.
                drop(place.take());
                if heard.is_silent() {
                    shared.doubt.notify_one();
                }
            }
            () = sleep_until(silent_at) => return "it sent nothing for 4 s",
        }
    }
}
