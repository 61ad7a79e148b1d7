//! Forwarding within a server, for the rooms whose senders ask it to: a hall for each, which is open while there are viewers in it.

use super::audience::{Reply, Stage};
use super::upstream::Until;
use super::{Source, begin};
use crate::CallError;
use crate::admission::Opening;
use crate::introduction;
use crate::sdp::Description;
use crate::signaling::Signaling;
use link_playout::Clock;
use link_protocol::limits::ANSWER_WITHIN;
use link_protocol::{Announcement, Name};
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{oneshot, watch};
use tokio::time::{MissedTickBehavior, interval, timeout};

/// A hall that is empty for so long is closed.
const EMPTY: Duration = Duration::from_secs(10);
/// How often that is looked at.
const LOOK: Duration = Duration::from_millis(500);

/// Viewers of one hall that are being connected at once. One more takes the place of the one that has tried longest.
const MOST_OPENING: usize = 64;

/// How long a viewer waits for the hall to be opened: it has to be answered a little later.
const JOINED_WITHIN: Duration = Duration::from_secs(3);

/// Sessions that are kept as ended, the newest: those that are ended while the hall is opened for them must not begin then.
const MOST_ENDED: usize = 4096;

/// A sender that is away for so long has left its audience, which then looks for it by itself.
const AWAY: Duration = Duration::from_secs(10);

/// The halls of one server. Clones share them.
#[derive(Debug, Clone)]
pub struct Halls {
    state: Arc<Mutex<State>>,
    /// Viewers at once, of all halls together.
    most: usize,
    clock: Clock,
}

#[derive(Debug, Default)]
struct State {
    open: HashMap<Name, Hall>,
    ended: VecDeque<Name>,
}

struct Hall {
    stage: Stage,
    announced: Announcement,
    opening: Opening,
    /// By session; dropping one makes its viewer's connection end.
    leaving: HashMap<Name, watch::Sender<bool>>,
}

impl std::fmt::Debug for Hall {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hall").finish_non_exhaustive()
    }
}

/// An answer within this process.
struct Here {
    answer: Option<oneshot::Sender<String>>,
    opening: Opening,
    session: Name,
}

/// Ends with the viewer's connecting, however that ends.
impl Drop for Here {
    fn drop(&mut self) {
        self.opening.end(&self.session);
    }
}

#[async_trait::async_trait]
impl Reply for Here {
    async fn answer(
        &mut self,
        _: Announcement,
        _: &Description,
        answer: &str,
    ) -> Result<(), CallError> {
        let answer = introduction::introduce_forwarder(answer);
        let reply = self.answer.take().ok_or(CallError::NotConnected)?;
        // Where the request has ended its viewer is gone.
        reply.send(answer).map_err(|_| CallError::NotConnected)
    }
}

impl Halls {
    /// None is open yet; `most` viewers are taken, in all together, of which one hall gets no more than it leaves free.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self {
            state: Arc::default(),
            most,
            clock: Clock::start(),
        }
    }

    /// Takes a viewer of this room and `network`, whom the sender hands over: the answer to its offer. In tasks of the
    /// current tokio runtime.
    ///
    /// # Errors
    /// [`CallError::TooManyViewers`], [`CallError::SenderAbsent`], or if no connection can be made of the offer.
    pub async fn take(
        &self,
        room: Arc<dyn Signaling>,
        session: Name,
        offer: String,
        network: Name,
    ) -> Result<String, CallError> {
        let offer = Description::read(&offer)?;
        let status = room.status().await?;
        let mut source = self.hall(&room, status.announcement)?;
        // A sender that takes no forwarder is found out before its viewers are.
        let joined = timeout(JOINED_WITHIN, async {
            // Not by `wait_for`, whose result holds a lock.
            while source.borrow_and_update().is_none() {
                source.changed().await.ok()?;
            }
            Some(())
        });
        if !matches!(joined.await, Ok(Some(()))) {
            return Err(CallError::TooManyViewers);
        }
        let (answer, answered) = oneshot::channel();
        {
            let State { open, ended } = &mut *self.locked();
            let begun: usize = open.values().map(Hall::begun).sum();
            if ended.contains(&session) {
                return Err(CallError::NotConnected);
            }
            let hall = open.get_mut(room.room().room());
            let hall = hall.ok_or(CallError::TooManyViewers)?;
            let here = hall.begun();
            if !has_room(here, begun, self.most) {
                log::warn!(
                    "a viewer is refused: of {} places {begun} are taken, {here} of them by its room, which gets no more than it leaves free",
                    self.most
                );
                return Err(CallError::TooManyViewers);
            }
            let place = hall.stage.place().ok_or(CallError::TooManyViewers)?;
            hall.leaving.retain(|_, leave| !leave.is_closed());
            if let Some(oldest) = hall.opening.begin(&session, Some(&network)) {
                hall.leaving.remove(&oldest);
            }
            let (leave, left) = watch::channel(false);
            hall.leaving.insert(session.clone(), leave);
            let mut stage = hall.stage.clone();
            stage.ice_servers = status.ice_servers;
            let reply = Here {
                answer: Some(answer),
                opening: hall.opening.clone(),
                session: session.clone(),
            };
            tokio::spawn(async move {
                if let Err(error) = stage.serve(place, offer, reply, left).await {
                    log::debug!("a viewer could not join: {error}");
                }
                room.left(&session).await;
            });
        }
        let answered = timeout(ANSWER_WITHIN, answered).await;
        let answered = answered.ok().and_then(Result::ok);
        answered.ok_or(CallError::NotConnected)
    }

    /// The source of the room's hall, which is opened if there is none for this announcement.
    fn hall(
        &self,
        room: &Arc<dyn Signaling>,
        announcement: Announcement,
    ) -> Result<watch::Receiver<Option<Source>>, CallError> {
        let open = &mut self.locked().open;
        let name = room.room().room();
        let hall = match open.get(name) {
            // Another sender has come, or the same one as another avatar: who is there is sent to look for it.
            Some(hall) if hall.announced != announcement => {
                open.remove(name);
                None
            }
            hall => hall,
        };
        if let Some(hall) = hall {
            return Ok(hall.stage.source.clone());
        }
        if open.len() >= self.most {
            return Err(CallError::TooManyViewers);
        }
        let hall = self.begin(Arc::clone(room), announcement);
        let source = hall.stage.source.clone();
        open.insert(name.clone(), hall);
        Ok(source)
    }

    /// Lets a viewer go that says by the server that it has left, or whom its sender does not serve any longer.
    pub fn leave(&self, session: &Name) {
        let State { open, ended } = &mut *self.locked();
        if ended.len() == MOST_ENDED {
            ended.pop_front();
        }
        ended.push_back(session.clone());
        for hall in open.values_mut() {
            hall.leaving.remove(session);
        }
    }

    /// Viewers that are forwarded to now.
    #[must_use]
    pub fn viewers(&self) -> usize {
        let open = &self.locked().open;
        let viewers = open.values().map(|hall| &hall.stage.counts.viewers);
        viewers.map(|viewers| viewers.load(Relaxed)).sum()
    }

    /// Opens a hall, which closes itself.
    fn begin(&self, room: Arc<dyn Signaling>, announcement: Announcement) -> Hall {
        let (stop, stopped) = watch::channel(false);
        let name = room.room().room().clone();
        let (stage, mut upstream, _) =
            begin(room, announcement, self.clock, self.most, stopped, true);
        let hall = Hall {
            stage: stage.clone(),
            announced: announcement,
            opening: Opening::new(MOST_OPENING),
            leaving: HashMap::new(),
        };
        let halls = self.clone();
        tokio::spawn(async move {
            log::info!("forwarding begins in room {name}");
            let mut announced = stage.announced.clone();
            let has_hung_up = tokio::select! {
                has_hung_up = upstream.run(Until::Gone(AWAY)) => has_hung_up,
                // Another avatar, say: viewers find it out where they join.
                _ = announced.changed() => false,
                () = halls.emptied(&name, &stage) => false,
            };
            let hall = halls.close(&name, &stage);
            // Who is still there is told goodbye where the sender has said it. Else the connections end, and the viewers join again.
            if has_hung_up {
                stop.send_replace(true);
                let mut looks = interval(LOOK);
                while stage.counts.begun.load(Relaxed) > 0 {
                    looks.tick().await;
                }
            }
            drop(hall);
            log::info!("forwarding has ended in room {name}");
        });
        hall
    }

    /// Closes a hall to newcomers, unless another one is in its place.
    fn close(&self, name: &Name, stage: &Stage) -> Option<Hall> {
        let open = &mut self.locked().open;
        is_open(open, name, stage)
            .then(|| open.remove(name))
            .flatten()
    }

    /// Waits until nobody has been in the hall for long, or it is open no longer, and closes it to newcomers.
    async fn emptied(&self, name: &Name, stage: &Stage) {
        let mut looks = interval(LOOK);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut empty_for = Duration::ZERO;
        loop {
            looks.tick().await;
            // With the lock nobody enters meanwhile.
            let open = &mut self.locked().open;
            if !is_open(open, name, stage) {
                return;
            }
            empty_for = match stage.counts.begun.load(Relaxed) {
                0 => empty_for + LOOK,
                _ => Duration::ZERO,
            };
            if empty_for > EMPTY {
                open.remove(name);
                return;
            }
        }
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        // Every hall is whole after a panic elsewhere.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether the hall of this stage is still the one that newcomers are taken into.
fn is_open(open: &HashMap<Name, Hall>, name: &Name, stage: &Stage) -> bool {
    open.get(name)
        .is_some_and(|hall| Arc::ptr_eq(&hall.stage.counts, &stage.counts))
}

/// Whether a room that has `here` of the `taken` places gets another one of `most`: as long as it leaves at least as many free for other rooms. So one
/// room has half of all at most, a second one a quarter, and there is always one left for a room that has none until all are taken.
fn has_room(here: usize, taken: usize, most: usize) -> bool {
    here < most.saturating_sub(taken)
}

impl Hall {
    /// Viewers from their offers on.
    fn begun(&self) -> usize {
        self.stage.counts.begun.load(Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::has_room;

    #[test]
    fn one_room_leaves_places_for_others() {
        // How many rooms get, one after the other.
        let fill = |most: usize| -> Vec<usize> {
            let mut taken = 0;
            let got = (0..6).map(|_| {
                let mut here = 0;
                while has_room(here, taken, most) {
                    (here, taken) = (here + 1, taken + 1);
                }
                here
            });
            got.collect()
        };
        assert_eq!(fill(500), [250, 125, 63, 31, 16, 8]);
        assert_eq!(fill(8), [4, 2, 1, 1, 0, 0]);
        assert_eq!(fill(1), [1, 0, 0, 0, 0, 0], "the only place");
        assert!(!has_room(0, 9, 8), "more than there are");
    }
}
