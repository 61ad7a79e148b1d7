//! The end of viewers whom the server serves in the sender's place.

use super::Shared;
use crate::door::{Door, LOOK};
use crate::{Backoff, is_set, now};
use link_protocol::Name;

/// Has guests leave whom the server serves, once their time is over.
pub(super) async fn end_who_is_over(door: Door) {
    loop {
        tokio::time::sleep(LOOK).await;
        door.end_expired(now());
    }
}

/// Has the server end what it serves to viewers that have to go, however often it has to be asked.
pub(super) async fn end_sessions(shared: Shared, sessions: Vec<Name>) {
    let (room, mut stop) = (shared.venue.room(), shared.stop.clone());
    let mut backoff = Backoff::default();
    for session in sessions {
        while let Err(error) = shared.client.leave(&room, &session).await {
            if error.is_final() {
                log::warn!("the server may still forward to a viewer that has to go: {error}");
                break;
            }
            log::debug!("the server is asked again to end a session: {error}");
            tokio::select! {
                () = is_set(&mut stop) => return,
                () = tokio::time::sleep(backoff.next()) => {}
            }
        }
    }
}
