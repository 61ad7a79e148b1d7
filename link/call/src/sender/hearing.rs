//! Whether a sender's own way to the network is in doubt because its viewers are silent: its router may have another
//! address now, of which the machine is not told. One viewer's silence is no reason: it may be made on purpose.

use link_protocol::Name;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The viewers that are connected. Clones share them.
#[derive(Debug, Clone, Default)]
pub(super) struct Hearing(Arc<Mutex<All>>);

#[derive(Debug, Default)]
struct All {
    begun: u64,
    viewers: Vec<Viewer>,
}

#[derive(Debug)]
struct Viewer {
    id: u64,
    network: Option<Name>,
    is_silent: bool,
}

/// One of the viewers, until it is dropped.
#[derive(Debug)]
pub(super) struct Heard {
    all: Hearing,
    id: u64,
}

impl Hearing {
    /// A viewer from this network is connected.
    pub(super) fn begin(&self, network: Option<Name>) -> Heard {
        let mut all = self.locked();
        all.begun += 1;
        let id = all.begun;
        all.viewers.push(Viewer {
            id,
            network,
            is_silent: false,
        });
        Heard {
            all: self.clone(),
            id,
        }
    }

    fn locked(&self) -> MutexGuard<'_, All> {
        // Nothing in here is half-changed after a panic elsewhere.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl All {
    /// Whether at least half of the viewers are silent, and those of more than one network where there is more than
    /// one.
    fn is_in_doubt(&self) -> bool {
        let silent = || self.viewers.iter().filter(|viewer| viewer.is_silent);
        let all: HashSet<_> = self.viewers.iter().map(|it| &it.network).collect();
        let networks: HashSet<_> = silent().map(|it| &it.network).collect();
        2 * silent().count() >= self.viewers.len() && networks.len() >= all.len().min(2)
    }
}

impl Heard {
    /// It has been silent for a while; whether the sender has to doubt its own way.
    pub(super) fn is_silent(&self) -> bool {
        self.set(true);
        self.all.locked().is_in_doubt()
    }

    /// It is heard.
    pub(super) fn is_heard(&self) {
        self.set(false);
    }

    fn set(&self, is_silent: bool) {
        let mut all = self.all.locked();
        if let Some(viewer) = all.viewers.iter_mut().find(|it| it.id == self.id) {
            viewer.is_silent = is_silent;
        }
    }
}

impl Drop for Heard {
    fn drop(&mut self) {
        self.all.locked().viewers.retain(|it| it.id != self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begin(hearing: &Hearing, network: &str) -> Heard {
        hearing.begin(Some(network.parse().expect("a name")))
    }

    #[test]
    fn one_viewers_silence_is_doubted_where_it_is_the_only_one() {
        let hearing = Hearing::default();
        let ada = begin(&hearing, "a");
        assert!(ada.is_silent(), "the only one");
        let bob = begin(&hearing, "b");
        assert!(!ada.is_silent(), "one of two networks");
        assert!(bob.is_silent(), "all");
        ada.is_heard();
        assert!(!bob.is_silent());
        drop(ada);
        assert!(bob.is_silent(), "the only one again");
    }

    #[test]
    fn many_silent_viewers_of_one_network_are_no_reason_where_another_network_is_heard() {
        let hearing = Hearing::default();
        let eve: Vec<_> = (0..30).map(|_| begin(&hearing, "e")).collect();
        let [ada, bob, zoe] = ["a", "b", "z"].map(|network| begin(&hearing, network));
        assert!(eve.iter().all(|viewer| !viewer.is_silent()));
        assert!(ada.is_silent(), "more than half, of two networks");
        assert!(bob.is_silent() && zoe.is_silent());
        eve.iter().for_each(Heard::is_heard);
        assert!(!zoe.is_silent(), "less than half");
    }
}
