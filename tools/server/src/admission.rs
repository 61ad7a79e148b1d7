//! Whom the relay admits: bearers whose tokens hold, from addresses that are not blocked.

use crate::Id;
use crate::blocked::Blocked;
use crate::reread::LOOK;
use crate::revoked::Revoked;
use crate::rooms::Rooms;
use std::net::IpAddr;
use std::sync::Arc;
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;

/// What the server knows of tokens and addresses.
#[derive(Debug)]
pub(crate) struct Admission {
    pub(crate) revoked: Arc<Revoked>,
    pub(crate) blocked: Arc<Blocked>,
    /// Of this instance; a relay in a process of its own has no rooms.
    pub(crate) rooms: Option<Arc<Rooms>>,
}

impl Admission {
    /// Looks every two seconds which tokens are revoked and which addresses are blocked, until `stopping`. Where either
    /// has changed, calls `changed` with whether each has.
    pub(crate) async fn watch(
        self: Arc<Self>,
        stopping: CancellationToken,
        changed: impl Fn(bool, bool),
    ) {
        while stopping.run_until_cancelled(sleep(LOOK)).await.is_some() {
            let looks = Arc::clone(&self);
            let look = move || (looks.revoked.look(), looks.blocked.look());
            match tokio::task::spawn_blocking(look).await {
                Ok((false, false)) => {}
                Ok((revoked, blocked)) => changed(revoked, blocked),
                Err(error) => {
                    log::error!("the lists of tokens and addresses are not read: {error}");
                }
            }
        }
    }
}

impl turn_server::Admission for Admission {
    fn honours(&self, room: &str, tokens: &str) -> bool {
        let mut names = tokens.split('.').filter_map(Id::parse);
        if self.revoked.has_any(names.clone()) {
            return false;
        }
        // A sender may have revoked a guest's own token.
        let sender = (self.rooms.as_ref().zip(Id::parse(room)))
            .and_then(|(rooms, room)| rooms.presence(room));
        !sender.is_some_and(|sender| sender.has_revoked(names.next()))
    }

    fn is_blocked(&self, address: IpAddr) -> bool {
        self.blocked.has(address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Metrics;
    use crate::rooms::RoomLimits;
    use std::time::Duration;
    use turn_server::Admission as _;

    #[test]
    fn credentials_end_with_any_of_their_tokens() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let (revoked, blocked) = (folder.path().join("revoked"), folder.path().join("blocked"));
        let limits = RoomLimits {
            rooms: 1,
            rooms_per_owner: 1,
            waiting_per_room: 1,
            answer_within: Duration::from_secs(1),
        };
        let admission = Admission {
            revoked: Arc::new(Revoked::open(Some(revoked.clone()))?),
            blocked: Arc::new(Blocked::open(Some(blocked.clone()))?),
            rooms: Some(Arc::new(Rooms::new(limits, Arc::new(Metrics::new())))),
        };
        let [room, viewer, owner] = [Id::random()?, Id::random()?, Id::random()?];
        let room = room.to_string();
        let tokens = format!("{viewer}.{owner}");
        assert!(admission.honours(&room, &tokens), "they hold");
        crate::revoke(&revoked, owner)?;
        assert!(admission.revoked.look(), "another name");
        assert!(
            !admission.honours(&room, &tokens),
            "made with a revoked one"
        );
        assert!(admission.honours(&room, &viewer.to_string()), "another's");
        // The server's own forwarder has no token.
        assert!(admission.honours(&room, ""), "no token");
        let address = IpAddr::from([192, 0, 2, 7]);
        assert!(!admission.is_blocked(address), "not yet");
        std::fs::write(&blocked, "192.0.2.0/24\n")?;
        assert!(
            admission.blocked.look() && admission.is_blocked(address),
            "now"
        );
        Ok(())
    }
}
