//! The viewers that wait for a sender's answer. Where all places are taken, the network that has the most of them makes
//! room: offers from one network keep those of no other network out.

use crate::Id;
use std::collections::HashMap;
use tokio::sync::oneshot;

/// The viewers that wait for one sender.
#[derive(Debug)]
pub(super) struct Waiting {
    most: usize,
    /// Viewers that have begun to wait so far.
    begun: u64,
    viewers: HashMap<Id, Viewer>,
}

#[derive(Debug)]
struct Viewer {
    answer: oneshot::Sender<String>,
    /// Nothing of the server's own forwarder.
    network: Option<Id>,
    /// The value of [`Waiting::begun`] when it began.
    order: u64,
}

impl Waiting {
    /// `most` at once.
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            begun: 0,
            viewers: HashMap::new(),
        }
    }

    /// One more, from this network; nothing if no place is free for it. A viewer that makes room sees its channel
    /// closed.
    pub(super) fn begin(
        &mut self,
        session: Id,
        network: Option<Id>,
    ) -> Option<oneshot::Receiver<String>> {
        if self.viewers.len() >= self.most {
            let oldest = self.to_make_room_for(network)?;
            self.viewers.remove(&oldest);
        }
        self.begun += 1;
        let (answer, answered) = oneshot::channel();
        let viewer = Viewer {
            answer,
            network,
            order: self.begun,
        };
        self.viewers.insert(session, viewer);
        Some(answered)
    }

    /// The viewer that has waited longest, of the network that has the most; nothing if a viewer of `network` has no
    /// better right to the place.
    fn to_make_room_for(&self, network: Option<Id>) -> Option<Id> {
        let mut counts: HashMap<Option<Id>, usize> = HashMap::new();
        for viewer in self.viewers.values() {
            *counts.entry(viewer.network).or_default() += 1;
        }
        let own = counts.get(&network).copied().unwrap_or(0);
        let (largest, count) = counts.into_iter().max_by_key(|(_, count)| *count)?;
        // Otherwise two networks would take turns, and neither would be answered.
        if own + 1 >= count {
            return None;
        }
        let theirs = self.viewers.iter();
        let theirs = theirs.filter(|(_, viewer)| viewer.network == largest);
        theirs
            .min_by_key(|(_, viewer)| viewer.order)
            .map(|(session, _)| *session)
    }

    /// It waits no longer; to where its answer goes.
    pub(super) fn end(&mut self, session: Id) -> Option<oneshot::Sender<String>> {
        self.viewers.remove(&session).map(|viewer| viewer.answer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u8) -> Id {
        Id::from_bytes([number; 16])
    }

    #[test]
    fn a_network_that_takes_all_places_makes_room_for_others_and_not_for_itself() {
        let mut waiting = Waiting::new(4);
        let hers = id(100);
        let mut eve: Vec<_> = (0..4)
            .map(|session| waiting.begin(id(session), Some(hers)).expect("free"))
            .collect();
        assert!(
            waiting.begin(id(4), Some(hers)).is_none(),
            "her own places are taken"
        );
        let mut bob = waiting.begin(id(5), Some(id(101))).expect("room is made");
        assert!(eve[0].try_recv().is_err_and(|it| it == closed()), "oldest");
        let mut forwarder = waiting.begin(id(6), None).expect("room is made");
        assert!(eve[1].try_recv().is_err_and(|it| it == closed()), "next");
        // Two, one and one: hers keeps one, as each network does.
        assert!(waiting.begin(id(7), Some(id(102))).is_some(), "a third one");
        assert!(
            eve[2].try_recv().is_err_and(|it| it == closed()),
            "her third"
        );
        // One each: a fourth network has no better right than any of them.
        assert!(
            waiting.begin(id(9), Some(id(103))).is_none(),
            "a fourth one"
        );
        let answer = waiting.end(id(5)).expect("he waits");
        answer.send("v=0".to_owned()).expect("he listens");
        assert_eq!(bob.try_recv().as_deref(), Ok("v=0"));
        assert!(waiting.begin(id(8), Some(hers)).is_some(), "one is free");
        assert!(
            forwarder.try_recv().is_err_and(|it| it != closed()),
            "it waits still"
        );
    }

    fn closed() -> oneshot::error::TryRecvError {
        oneshot::error::TryRecvError::Closed
    }
}
