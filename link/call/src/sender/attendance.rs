//! A sender's presence in its room, kept up through outages. Where the stream may be dead another one is opened before
//! it is dropped: the room is never empty meanwhile, and nobody else takes a seat.

use super::Shared;
use crate::{Backoff, CallError};
use link_http::HttpError;
use link_http::presence::Presence;
use link_protocol::calls::EnterRoom;
use link_protocol::presence::PresenceEvent;
use std::time::Duration;
use tokio::task::JoinSet;

/// The stream that is read, and the one that is being opened.
pub(super) struct Attendance {
    presence: Option<Presence>,
    /// One attempt at most.
    opening: JoinSet<Result<Presence, CallError>>,
    /// Another stream is wanted although there is one.
    renews: bool,
    backoff: Backoff,
    is_told: bool,
    /// The room has expired.
    is_over: bool,
}

impl Attendance {
    pub(super) fn new(presence: Presence) -> Self {
        Self {
            presence: Some(presence),
            opening: JoinSet::new(),
            renews: false,
            backoff: Backoff::default(),
            is_told: false,
            is_over: false,
        }
    }

    /// Has the room entered again, as `entering` says: the stream may have begun at an address that is gone, and would
    /// be silent for long.
    pub(super) fn renew(&mut self, why: &str, shared: &Shared, entering: &EnterRoom) {
        log::info!("{why}: entering the room again");
        self.backoff.reset();
        self.renews = true;
        self.opening.abort_all();
        self.opening = JoinSet::new();
        self.open(shared, entering, Duration::ZERO);
    }

    /// The stream has ended.
    pub(super) fn lose(&mut self) {
        self.presence = None;
    }

    fn open(&mut self, shared: &Shared, entering: &EnterRoom, after: Duration) {
        let (venue, client) = (shared.venue.clone(), shared.client.clone());
        let entering = entering.clone();
        self.opening.spawn(async move {
            tokio::time::sleep(after).await;
            venue.come_back(&client, &entering).await
        });
    }

    /// The next event, after as many new streams as it takes. May be cancelled, in `select!`, without losing one.
    pub(super) async fn next(&mut self, shared: &Shared, entering: &EnterRoom) -> PresenceEvent {
        loop {
            let is_wanted = self.presence.is_none() || self.renews;
            if is_wanted && self.opening.is_empty() && !self.is_over {
                let pause = self.backoff.next();
                self.open(shared, entering, pause);
            }
            let event = async {
                match &mut self.presence {
                    Some(presence) => presence.next().await,
                    None => std::future::pending().await,
                }
            };
            let opened = async {
                match self.opening.join_next().await {
                    Some(opened) => opened,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                event = event => match event {
                    // By this side's own next stream.
                    Ok(PresenceEvent::Replaced) if !self.opening.is_empty() => self.lose(),
                    Ok(event) => return event,
                    Err(error) => {
                        log::warn!("the server cannot be reached ({error}): calls go on, trying again");
                        self.lose();
                    }
                },
                opened = opened => match opened {
                    Ok(Ok(presence)) => {
                        log::info!("in the room again");
                        // Another instance, or a server that was started otherwise.
                        shared.places.without_forwarder();
                        self.backoff.reset();
                        (self.renews, self.is_told) = (false, false);
                        self.presence = Some(presence);
                    }
                    Ok(Err(error)) => self.failed(&error),
                    Err(error) => log::error!("a task of the call failed: {error}"),
                },
            }
        }
    }

    /// An attempt to come back has failed.
    fn failed(&mut self, error: &CallError) {
        match error {
            CallError::Http(HttpError::Unauthorized { .. }) => {
                log::warn!(
                    "the room has expired, or its token was taken back: calls go on, but no other viewer can join; open another room"
                );
                self.is_over = true;
            }
            CallError::Http(HttpError::NotFound { .. }) if !self.is_told => {
                self.is_told = true;
                log::warn!(
                    "the server has this avatar no longer ({error}): calls go on, but no other viewer can join; leave, and come back, which puts it there again"
                );
            }
            CallError::Http(error) if error.is_final() && !self.is_told => {
                self.is_told = true;
                log::warn!("{error}: calls go on, but no other viewer can join");
            }
            error => log::debug!("not in the room: {error}"),
        }
    }
}
