//! A viewer's time inside: it ends when they leave, when the performer sends them away, and when a guest's time is over.

use super::{Door, DoorEvent};
use crate::now;
use crate::visitor::Visitor;
use std::time::Duration;
use tokio::sync::watch;

/// Between two looks whether a guest's time is over.
pub(crate) const LOOK: Duration = Duration::from_secs(5);

/// A viewer that is inside, until this is dropped.
#[derive(Debug)]
pub(crate) struct Stay {
    pub(super) door: Door,
    pub(super) number: u32,
    pub(super) visitor: Visitor,
    /// Becomes why they have to go.
    pub(super) leave: watch::Sender<Option<&'static str>>,
}

impl Stay {
    /// Who is inside.
    pub(crate) fn visitor(&self) -> &Visitor {
        &self.visitor
    }

    /// Waits until a viewer has to go, who is a server's forwarder if there is none; why.
    pub(crate) async fn over(stay: Option<&Self>) -> &'static str {
        let Some(Self { visitor, leave, .. }) = stay else {
            return std::future::pending().await;
        };
        let mut sent_away = leave.subscribe();
        let expires = visitor.guest.as_ref().map(|guest| guest.expires);
        let expired = async {
            match expires {
                // A clock that is set meanwhile is followed.
                Some(expires) => {
                    while now() < expires {
                        let left = Duration::from_secs(expires.saturating_sub(now()));
                        tokio::time::sleep(left.min(LOOK)).await;
                    }
                }
                None => std::future::pending().await,
            }
        };
        let sent_away = async {
            // Not what `wait_for` returns, which holds a lock.
            let why = sent_away.wait_for(Option::is_some).await;
            why.map_or(None, |why| *why).unwrap_or("it has gone")
        };
        tokio::select! {
            why = sent_away => why,
            () = expired => "its link has ended",
        }
    }
}

impl Drop for Stay {
    fn drop(&mut self) {
        let mut state = self.door.locked();
        let here = |leave: &watch::Sender<_>| leave.same_channel(&self.leave);
        state.inside.retain(|inside| !here(&inside.leave));
        let (number, visitor) = (self.number, self.visitor.clone());
        state.tell(DoorEvent::Left(number, visitor));
    }
}
