//! Viewers on their way in: whoever has the link may offer as often as they like, and never connect.

use link_protocol::Name;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::time::Instant;

/// Viewers that are being connected at once. One more takes the place of the one that has tried longest, of the network
/// with the most of them: offers that come again and again and never connect keep nobody out.
pub(crate) const MOST_OPENING: usize = 16;

/// Between two lines about viewers who could not join.
const TOLD_APART: Duration = Duration::from_secs(5);

/// Tells of viewers who could not join, but not of any number of them: whoever has the link may try as often as they like.
#[derive(Debug, Clone, Default)]
pub(crate) struct Refusals(Arc<Mutex<Option<Instant>>>);

impl Refusals {
    pub(crate) fn tell(&self, why: &dyn std::fmt::Display) {
        let mut told = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if told.is_none_or(|at| at.elapsed() >= TOLD_APART) {
            *told = Some(Instant::now());
            log::warn!("a viewer could not join: {why}");
        } else {
            log::debug!("another viewer could not join: {why}");
        }
    }
}

/// The viewers that are being connected, the one that has tried longest first.
#[derive(Debug, Clone)]
pub(crate) struct Opening {
    viewers: Arc<Mutex<VecDeque<Viewer>>>,
    most: usize,
}

/// A viewer, and what the server calls its network.
type Viewer = (Name, Option<Name>);

impl Opening {
    /// So many at once.
    pub(crate) fn new(most: usize) -> Self {
        Self {
            viewers: Arc::default(),
            most,
        }
    }

    /// One more, from this network. Which one has to make room for it, if there are too many.
    pub(crate) fn begin(&self, viewer: &Name, network: Option<&Name>) -> Option<Name> {
        let mut opening = self.locked();
        opening.push_back((viewer.clone(), network.cloned()));
        if opening.len() <= self.most {
            return None;
        }
        let mut counts: HashMap<Option<&Name>, usize> = HashMap::new();
        for (_, network) in &*opening {
            *counts.entry(network.as_ref()).or_default() += 1;
        }
        let most = counts.values().copied().max()?;
        let is_of_largest = |(_, network): &Viewer| counts.get(&network.as_ref()) == Some(&most);
        let oldest = opening.iter().position(is_of_largest)?;
        opening.remove(oldest).map(|(name, _)| name)
    }

    /// It is connected, or has failed.
    pub(crate) fn end(&self, viewer: &Name) {
        self.locked().retain(|(other, _)| other != viewer);
    }

    fn locked(&self) -> MutexGuard<'_, VecDeque<Viewer>> {
        self.viewers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_never_connects_makes_room_for_who_does() {
        let opening = Opening::new(MOST_OPENING);
        let viewer = |number: u8| Name::of_id([number; 16]);
        for number in 0..16 {
            assert_eq!(opening.begin(&viewer(number), None), None);
        }
        let begin = |number| opening.begin(&viewer(number), None);
        assert_eq!(begin(16), Some(viewer(0)), "the oldest");
        opening.end(&viewer(5));
        assert_eq!(begin(17), None, "one is connected");
        assert_eq!(begin(18), Some(viewer(1)));
        opening.end(&viewer(0));
        assert_eq!(
            opening.locked().len(),
            16,
            "an end that comes twice changes nothing"
        );
    }

    #[test]
    fn the_network_with_the_most_makes_room() {
        let opening = Opening::new(4);
        let name = |number: u8| Name::of_id([number; 16]);
        let (bob, eve) = (name(100), name(101));
        assert_eq!(opening.begin(&name(0), Some(&bob)), None);
        for number in 1..4 {
            assert_eq!(opening.begin(&name(number), Some(&eve)), None);
        }
        for number in 4..50 {
            let oldest = opening.begin(&name(number), Some(&eve));
            assert_eq!(oldest, Some(name(number - 3)), "hers, and not his");
        }
    }
}
