//! Who is in the call: asks the server for its seats, tells who comes and goes, and hands each newcomer over with the avatar fetched.

use crate::commands::receive::people::{Person, fetch};
use crate::controls::{Member, Members};
use crate::network::Line;
use crate::stills::load_avatar;
use anyhow::Context;
use app_session::call::CallWatch;
use link_protocol::calls::{Seat, Taken};
use link_protocol::data_channel::PersonState;
use link_protocol::{CallLink, Name, RoomLink};
use link_voice::VoiceQueue;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// Between two questions who is there; a viewer's offer asks at once.
const PAUSE: Duration = Duration::from_millis(500);

/// Between two looks at what is told of people.
const LOOK: Duration = Duration::from_millis(50);

/// A person whose seat is free and of whom nothing has come for so long is gone: without the server a call goes on.
const SILENCE: Duration = Duration::from_secs(5);

/// After a goodbye the seat may seem taken for so long.
const FAREWELL: Duration = Duration::from_secs(3);

/// Follows who is in the call.
pub(super) struct Roster<'a> {
    pub(super) link: CallLink,
    /// One's own seat.
    pub(super) own: RoomLink,
    /// Of the seats, in their order.
    pub(super) voices: Vec<VoiceQueue>,
    pub(super) members: Members,
    /// Is notified when someone wants to see this side.
    pub(super) offers: Arc<Notify>,
    /// The call ends so long after the first of the others was there.
    pub(super) longest: Option<Duration>,
    pub(super) line: &'a Line,
}

/// What is known of a taken seat.
struct Known {
    name: String,
    taken: Taken,
    watch: CallWatch,
    /// What was told last.
    state: PersonState,
    /// When bytes came last, and how many there were.
    heard: (Instant, u64),
    /// Whether the server shows the seat as theirs.
    is_seated: bool,
    /// Since when the call with them is over.
    over: Option<Instant>,
}

/// The seat of a newcomer, with the avatar fetched, or why it could not be.
type Fetched = (Name, anyhow::Result<Person>);

/// When others came.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RosterFigures {
    /// The first of them had their avatar here.
    pub(super) first_member: Option<Instant>,
    /// The first of them was heard.
    pub(super) first_sound: Option<Instant>,
}

impl Roster<'_> {
    /// Hands newcomers to `admit` until the call is over; ends early where it does not take them any more.
    pub(super) fn follow(self, mut admit: impl FnMut(Person) -> bool) -> RosterFigures {
        let mut figures = RosterFigures::default();
        let (fetched, newcomers) = channel();
        let mut known = HashMap::new();
        let mut asked = None;
        let mut troubled = false;
        std::thread::scope(|scope| {
            while !self.line.stop.load(Relaxed) {
                if asked.is_none_or(|asked: Instant| asked.elapsed() >= PAUSE) || self.is_offered()
                {
                    asked = Some(Instant::now());
                    match self.seats() {
                        Ok(seats) => {
                            troubled = false;
                            for (seat, voice) in self.arrivals(&seats, &mut known) {
                                let (name, taken, watch) = seat;
                                let (fetched, this) = (fetched.clone(), &self);
                                scope.spawn(move || {
                                    let person = this.fetch(&name, &taken, watch, voice);
                                    // The roster is over by then, maybe.
                                    let _ = fetched.send((name, person));
                                });
                            }
                        }
                        Err(why) if !std::mem::replace(&mut troubled, true) => {
                            log::warn!("{why:#}: who is there goes on, newcomers have to wait");
                        }
                        Err(_) => {}
                    }
                }
                if !self.take(&newcomers, &known, &mut admit) {
                    break;
                }
                self.look(&mut known);
                self.note(&mut figures);
                std::thread::sleep(LOOK);
            }
        });
        figures
    }

    /// Keeps when others came, and ends the call when its time is over.
    fn note(&self, figures: &mut RosterFigures) {
        let members = self.members.lock();
        if figures.first_member.is_none() && !members.is_empty() {
            figures.first_member = Some(Instant::now());
        }
        let now = self.line.clock.now();
        let is_heard = |member: &Member| member.voice.heard_offset_us(now).is_some();
        if figures.first_sound.is_none() && members.iter().any(is_heard) {
            figures.first_sound = Some(Instant::now());
        }
        let since = figures.first_member.map(|first| first.elapsed());
        if self
            .longest
            .zip(since)
            .is_some_and(|(longest, since)| since >= longest)
        {
            self.line.stop.store(true, Relaxed);
        }
    }

    /// Whether someone has offered a connection since it was asked last.
    fn is_offered(&self) -> bool {
        let offered = self.offers.notified();
        self.line.network.block_on(async {
            tokio::select! {
                biased;
                () = offered => true,
                () = std::future::ready(()) => false,
            }
        })
    }

    fn seats(&self) -> anyhow::Result<Vec<Seat>> {
        let Line {
            network, client, ..
        } = self.line;
        let status = network.block_on(client.call_status(&self.link));
        Ok(status
            .context("the server does not tell who is in the call")?
            .seats)
    }

    /// Compares the seats with who is known; what has to be fetched.
    fn arrivals(
        &self,
        seats: &[Seat],
        known: &mut HashMap<Name, Known>,
    ) -> Vec<((Name, Taken, CallWatch), VoiceQueue)> {
        let mut arrivals = Vec::new();
        for (number, (seat, voice)) in seats.iter().zip(&self.voices).enumerate() {
            if &seat.room == self.own.room() {
                continue;
            }
            let Some(taken) = &seat.taken else {
                if let Some(person) = known.get_mut(&seat.room) {
                    person.is_seated = false;
                }
                continue;
            };
            if let Some(person) = known.get_mut(&seat.room) {
                person.is_seated = true;
                if person.taken.announcement.avatar != taken.announcement.avatar {
                    // Another person, or the same as another avatar.
                    person.watch.leave();
                }
                continue;
            }
            let name = match &taken.person {
                Some(name) => name.to_string(),
                None => format!("person {}", number + 1),
            };
            let watch = CallWatch::default();
            known.insert(
                seat.room.clone(),
                Known {
                    name: name.clone(),
                    taken: taken.clone(),
                    watch: watch.clone(),
                    state: PersonState::default(),
                    heard: (Instant::now(), 0),
                    is_seated: true,
                    over: None,
                },
            );
            log::info!("{name} is in the call: fetching their avatar");
            arrivals.push(((seat.room.clone(), taken.clone(), watch), voice.clone()));
        }
        arrivals
    }

    fn fetch(
        &self,
        room: &Name,
        taken: &Taken,
        watch: CallWatch,
        voice: VoiceQueue,
    ) -> anyhow::Result<Person> {
        let room = self.link.seat(room);
        let (path, download) = fetch(
            &self.line.network,
            &self.line.client,
            &room,
            &taken.announcement,
        )?;
        let (avatar, figures) = load_avatar(&path)?;
        Ok(Person {
            room,
            announced: taken.announcement,
            avatar,
            figures,
            download,
            voice,
            watch,
        })
    }

    /// Hands over who was fetched; whether they are still taken.
    fn take(
        &self,
        newcomers: &Receiver<Fetched>,
        known: &HashMap<Name, Known>,
        admit: &mut impl FnMut(Person) -> bool,
    ) -> bool {
        while let Ok((room, person)) = newcomers.try_recv() {
            let Some(entry) = known.get(&room) else {
                continue;
            };
            match person {
                Ok(person) => {
                    println!("{} has joined", entry.name);
                    self.members.lock().push(Member {
                        name: entry.name.clone(),
                        watch: person.watch.clone(),
                        voice: person.voice.clone(),
                    });
                    if !admit(person) {
                        return false;
                    }
                }
                Err(why) => {
                    log::warn!("{} cannot be shown: {why:#}", entry.name);
                    // Tried again once the seat was free.
                    entry.watch.leave();
                }
            }
        }
        true
    }

    /// Tells of changes, and forgets who is gone.
    fn look(&self, known: &mut HashMap<Name, Known>) {
        known.retain(|_, person| {
            let now = Instant::now();
            let bytes = person.watch.counts().payload_bytes;
            if bytes != person.heard.1 {
                person.heard = (now, bytes);
            }
            let state = person.watch.state();
            let before = std::mem::replace(&mut person.state, state);
            for line in told(&person.name, before, state) {
                println!("{line}");
            }
            if !person.is_seated && person.heard.0.elapsed() > SILENCE {
                person.watch.leave();
            }
            if person.watch.is_over() && person.over.is_none() {
                person.over = Some(now);
                println!("{} has left", person.name);
                let watch = &person.watch;
                self.members
                    .lock()
                    .retain(|member| !member.watch.is_same(watch));
            }
            // After a goodbye the server may still show the seat as taken for a moment.
            let is_forgotten = person
                .over
                .is_some_and(|since| !person.is_seated || since.elapsed() > FAREWELL);
            !is_forgotten
        });
    }
}

/// What has changed of a person, a line each.
fn told(name: &str, before: PersonState, now: PersonState) -> Vec<String> {
    let change = |was: bool, is: bool, begun: &str, ended: &str| {
        (was != is).then(|| format!("{name} {}", if is { begun } else { ended }))
    };
    [
        change(before.muted, now.muted, "is muted", "is no longer muted"),
        change(before.hidden, now.hidden, "is hidden", "is seen again"),
    ]
    .into_iter()
    .flatten()
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_has_changed_is_told() {
        let plain = PersonState::default();
        let muted = PersonState {
            muted: true,
            ..plain
        };
        let both = PersonState {
            muted: true,
            hidden: true,
        };
        assert!(told("Ada", muted, muted).is_empty());
        assert_eq!(told("Ada", plain, muted), ["Ada is muted"]);
        assert_eq!(
            told("Ada", both, plain),
            ["Ada is no longer muted", "Ada is seen again"]
        );
    }
}
