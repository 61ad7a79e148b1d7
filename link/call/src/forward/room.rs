//! The room of a forwarder's own, in which its audience meets it.

use super::audience::{Reply, Stage};
use crate::introduction::{self, Credentials};
use crate::sdp::Description;
use crate::{Backoff, CallError, is_set};
use identity::{Keyring, Permit, PublicKey};
use link_http::presence::Presence;
use link_http::{Client, HttpError};
use link_protocol::calls::EnterRoom;
use link_protocol::presence::PresenceEvent;
use link_protocol::{Announcement, Name, Refusal, RoomLink};
use std::collections::HashMap;
use std::sync::Arc;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::sleep;

/// The room, and what the forwarder shows of itself there.
#[derive(Clone)]
pub(super) struct AudienceRoom {
    pub(super) client: Client,
    pub(super) link: RoomLink,
    /// This side's own key and the permits for it.
    pub(super) keys: Option<(Keyring, Arc<[Permit]>)>,
    /// Who the sender is, where it says so.
    pub(super) sender: watch::Receiver<Option<PublicKey>>,
}

/// An answer that goes by the server.
struct OverHttp {
    room: AudienceRoom,
    session: Name,
}

#[async_trait::async_trait]
impl Reply for OverHttp {
    async fn answer(
        &mut self,
        announced: Announcement,
        offer: &Description,
        answer: &str,
    ) -> Result<(), CallError> {
        let room = &self.room;
        let sender = *room.sender.borrow();
        let own = (room.keys.as_ref())
            .map(|(keys, permits)| Credentials::of_forwarder(keys, permits, sender));
        let avatar = announced.avatar.sha256;
        let answer =
            introduction::introduce_sender(own.as_ref(), &room.link, avatar, offer, answer)?;
        Ok((room.client.answer(&room.link, &self.session, &answer)).await?)
    }
}

impl AudienceRoom {
    /// Keeps up the presence in the audience's room, and has a task for every viewer.
    pub(super) async fn attend(
        self,
        mut stage: Stage,
        mut entering: EnterRoom,
        presence: Presence,
    ) {
        let mut presence = Some(presence);
        let mut viewers = JoinSet::new();
        let mut leaving: HashMap<Name, watch::Sender<bool>> = HashMap::new();
        let mut backoff = Backoff::default();
        let mut stop = stage.stop.clone();
        let mut announced = stage.announced.clone();
        loop {
            let event = tokio::select! {
                () = is_set(&mut stop) => break,
                Ok(()) = announced.changed() => {
                    // The sender is back with another avatar, say: viewers read that where they join.
                    entering = EnterRoom::from(*announced.borrow_and_update());
                    presence = None;
                    for (_, leave) in leaving.drain() {
                        leave.send_replace(true);
                    }
                    continue;
                }
                Some(_) = viewers.join_next(), if !viewers.is_empty() => {
                    leaving.retain(|_, leave| !leave.is_closed());
                    continue;
                }
                event = self.next_event(&entering, &mut presence, &mut backoff) => event,
            };
            match event {
                PresenceEvent::Offer {
                    session,
                    sdp,
                    forwards,
                    ..
                } => {
                    // A server's forwarder would need what is sealed, which this one does not do.
                    let place = (!forwards).then(|| stage.place()).flatten();
                    let Some(place) = place else {
                        log::warn!("a viewer is refused: there are {} already", stage.most);
                        self.refuse(session, Refusal::Full);
                        continue;
                    };
                    let (leave, left) = watch::channel(false);
                    leaving.insert(session.clone(), leave);
                    let (stage, room) = (stage.clone(), self.clone());
                    viewers.spawn(async move {
                        let served = async {
                            let (_, offer) = introduction::check_viewer(None, &room.link, &sdp)?;
                            let (room, session) = (room.clone(), session.clone());
                            let reply = OverHttp { room, session };
                            stage.serve(place, offer, reply, left).await
                        };
                        if let Err(error) = served.await {
                            log::debug!("a viewer could not join: {error}");
                            // One that has its answer already does not wait for another.
                            room.refuse(session, error.refusal());
                        }
                    });
                }
                PresenceEvent::IceServers(servers) => stage.ice_servers = servers,
                // This side forwards itself.
                PresenceEvent::Forwards => {}
                PresenceEvent::Leave { session } => {
                    if let Some(leave) = leaving.remove(&session) {
                        leave.send_replace(true);
                    }
                }
                PresenceEvent::Replaced => {
                    log::warn!("another one forwards to this audience now: new viewers go there");
                    is_set(&mut stop).await;
                    break;
                }
            }
        }
        drop(presence);
        while viewers.join_next().await.is_some() {}
    }

    /// Tells a viewer that it is not taken.
    fn refuse(&self, session: Name, why: Refusal) {
        let room = self.clone();
        tokio::spawn(async move {
            let answer = why.answer();
            if let Err(error) = room.client.answer(&room.link, &session, &answer).await {
                log::debug!("a viewer was not told why it is not taken: {error}");
            }
        });
    }

    /// The presence's next event, after as many new presences as it takes.
    async fn next_event(
        &self,
        entering: &EnterRoom,
        presence: &mut Option<Presence>,
        backoff: &mut Backoff,
    ) -> PresenceEvent {
        loop {
            if let Some(open) = presence {
                match open.next().await {
                    Ok(event) => return event,
                    Err(error) => {
                        log::warn!(
                            "the server cannot be reached ({error}): viewers stay, trying again"
                        );
                        *presence = None;
                    }
                }
            }
            sleep(backoff.next()).await;
            match self.client.open_presence(&self.link, entering).await {
                Ok(open) => {
                    backoff.reset();
                    *presence = Some(open);
                }
                Err(HttpError::Unauthorized { .. }) => {
                    log::warn!(
                        "the audience's room has expired: viewers stay, no other one can join"
                    );
                    return std::future::pending().await;
                }
                Err(error) => log::debug!("not in the audience's room: {error}"),
            }
        }
    }
}
