//! Who is in the call: asks the server for its seats, tells who comes and goes, and hands each newcomer over with the avatar fetched.

use crate::acquaintances::{Acquaintances, Meeting};
use crate::members::{Member, Members};
use crate::seats::{FORGIVEN, FORGOTTEN, Known, Seats, Unshown, called, note_trouble};
use anyhow::Context;
use app_session::call::CallWatch;
use app_session::participant::NetworkContext;
use identity::{KeyHash, PublicKey};
use link_call::{Credentials, Door, Venue, membership};
use link_http::HttpError;
use link_protocol::calls::{CallStatus, Seat, Taken};
use link_protocol::data_channel::PersonState;
use link_protocol::limits::MAX_PEOPLE;
use link_protocol::{Announcement, CallLink, Name, PersonName, RoomLink};
use link_voice::VoiceQueue;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use tokio::task::JoinHandle;

/// Between two questions who is there; a viewer's offer asks at once.
const PAUSE: Duration = Duration::from_millis(500);

/// The shortest time between two questions: whoever offers again and again has nobody ask all the time.
const ASKED_APART: Duration = Duration::from_millis(200);

/// Between two looks at what is told of people.
const LOOK: Duration = Duration::from_millis(50);

/// A person whose seat is free and of whom nothing has come for so long is gone: without the server a call goes on.
const SILENCE: Duration = Duration::from_secs(5);

/// A person who sees this side and is not shown is reported after so long; where they refuse this side's offers, after
/// the longer time: one who has just unlocked the call for themselves is connected again first.
const UNANSWERED: Duration = Duration::from_secs(3);
const REFUSED: Duration = Duration::from_secs(10);

/// After a goodbye the seat may seem taken for so long.
const FAREWELL: Duration = Duration::from_secs(3);

/// Who has not shown a key after so long is not waited for to say whether who opened the call is there.
const SHOWN_WITHIN: Duration = Duration::from_secs(15);

/// Changes of a person's state are told so far apart, at least; the last one is.
const TOLD_APART: Duration = Duration::from_secs(2);

/// Follows who is in the call.
pub struct Roster<'a> {
    /// The call's link.
    pub link: CallLink,
    /// One's own seat.
    pub own: Venue,
    /// Of the seats, in their order.
    pub voices: Vec<VoiceQueue>,
    /// Is kept as people come and go.
    pub members: Members,
    /// Whom this side has met before.
    pub acquaintances: Acquaintances,
    /// Is notified when someone wants to see this side.
    pub offers: Arc<Notify>,
    /// Who is let in; is told who sits in the call.
    pub door: Door,
    /// The call ends so long after the first of the others was there.
    pub longest: Option<Duration>,
    /// How the server is asked.
    pub network: &'a NetworkContext,
    /// It is time to leave.
    pub stop: &'a AtomicBool,
    /// Is told, in a line, of who comes, goes, and changes.
    pub tell: &'a (dyn Fn(&str) + Sync),
}

impl std::fmt::Debug for Roster<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Roster")
            .field("own", &self.own)
            .finish_non_exhaustive()
    }
}

/// A newcomer whose avatar is here: a person of the call, as a session takes them.
#[derive(Debug)]
pub struct Newcomer<A> {
    /// Their seat.
    pub room: RoomLink,
    /// What they announced.
    pub announced: Announcement,
    /// What was fetched of them.
    pub avatar: A,
    /// What they say, to be played.
    pub voice: VoiceQueue,
    /// What is counted and told of the call with them.
    pub watch: CallWatch,
}

/// A newcomer whose avatar is to be fetched.
struct Expected {
    seat: Name,
    taken: Taken,
    watch: CallWatch,
    voice: VoiceQueue,
}

impl Expected {
    fn fetch<A>(
        self,
        link: &CallLink,
        fetch: impl Fn(&RoomLink, &Announcement, &CallWatch) -> anyhow::Result<Option<A>>,
    ) -> anyhow::Result<Option<Newcomer<A>>> {
        let (room, announced) = (link.seat(&self.seat), self.taken.announcement);
        Ok(
            fetch(&room, &announced, &self.watch)?.map(|avatar| Newcomer {
                room,
                announced,
                avatar,
                voice: self.voice,
                watch: self.watch,
            }),
        )
    }
}

/// The seat of a newcomer, with the avatar fetched, or why it could not be; nothing where the call ended before.
type Fetched<A> = (Name, CallWatch, anyhow::Result<Option<Newcomer<A>>>);

/// A question who is there, until it is answered.
type Asking = JoinHandle<Result<CallStatus, HttpError>>;

/// When others came.
#[derive(Debug, Clone, Copy, Default)]
pub struct RosterFigures {
    /// The first of them had their avatar here.
    pub first_member: Option<Instant>,
    /// The first of them was heard.
    pub first_sound: Option<Instant>,
}

impl Roster<'_> {
    /// Hands newcomers to `admit` until the call is over; ends early where it does not take them any more. `fetch` has the avatar that was
    /// announced in a seat; nothing where the call, or the one with them, ended before, with which it has to end, too. It is called from a thread of its
    /// own for each newcomer, for one of a seat at a time.
    pub fn follow<A: Send>(
        mut self,
        fetch: impl Fn(&RoomLink, &Announcement, &CallWatch) -> anyhow::Result<Option<A>> + Sync,
        mut admit: impl FnMut(Newcomer<A>) -> bool,
    ) -> RosterFigures {
        let mut figures = RosterFigures::default();
        let mut acquaintances = std::mem::take(&mut self.acquaintances);
        // One of each seat, at most.
        let (fetched, newcomers) = sync_channel(MAX_PEOPLE);
        let mut seats = Seats::default();
        let mut asking: Option<Asking> = None;
        let mut asked: Option<Instant> = None;
        let mut troubled = false;
        let mut opener = Opener::of(&self);
        std::thread::scope(|scope| {
            while !self.stop.load(Relaxed) {
                let since = asked.map_or(PAUSE, |asked| asked.elapsed());
                let is_offered = || since >= ASKED_APART && self.is_offered();
                if asking.is_none() && (since >= PAUSE || is_offered()) {
                    asked = Some(Instant::now());
                    asking = Some(self.ask());
                }
                match self.answer(&mut asking) {
                    Some(Ok(status)) => {
                        troubled = false;
                        opener.begin();
                        let keys = self.keys(&status.seats);
                        let seated: Vec<_> = keys.iter().copied().flatten().collect();
                        seats.seated = (status.seats.iter().map(|seat| &seat.room).cloned())
                            .zip(&keys)
                            .filter_map(|(seat, key)| Some((seat, (*key)?)))
                            .filter(|(seat, _)| seat != self.own.room().room())
                            .collect();
                        if let Some(asked) = asked {
                            self.door.seat_members(asked, &seated);
                        }
                        for newcomer in self.arrivals(&status.seats, &keys, &mut seats) {
                            let (seat, watch) = (newcomer.seat.clone(), newcomer.watch.clone());
                            let (fetched, fetch, link) = (fetched.clone(), &fetch, &self.link);
                            let (theirs, of) = (seat.clone(), watch.clone());
                            let fetches = move || {
                                // The roster is over by then, maybe.
                                let _ = fetched.send((theirs, of, newcomer.fetch(link, fetch)));
                            };
                            let thread = std::thread::Builder::new().name("newcomer".to_owned());
                            match thread.spawn_scoped(scope, fetches) {
                                Ok(_) => drop(seats.fetching.insert(seat)),
                                Err(why) => {
                                    log::warn!(
                                        "a person cannot be shown: no thread to fetch their avatar: {why}"
                                    );
                                    watch.leave();
                                }
                            }
                        }
                    }
                    Some(Err(why)) if !std::mem::replace(&mut troubled, true) => {
                        log::warn!("{why:#}: who is there goes on, newcomers have to wait");
                    }
                    Some(Err(_)) | None => {}
                }
                if !self.take(&newcomers, &mut seats, &mut admit) {
                    // Who is fetched for nobody need not be.
                    self.stop.store(true, Relaxed);
                    break;
                }
                self.look(&mut seats, &mut acquaintances);
                self.report_unshown(&mut seats);
                self.miss_opener(&seats, &mut opener);
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
        let now = self.network.clock.now();
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
            self.stop.store(true, Relaxed);
        }
    }

    /// Whether someone has offered a connection since it was asked last.
    fn is_offered(&self) -> bool {
        let offered = self.offers.notified();
        self.network.network.block_on(async {
            tokio::select! {
                biased;
                () = offered => true,
                () = std::future::ready(()) => false,
            }
        })
    }

    /// Asks who is there; a server that does not answer keeps nothing waiting.
    fn ask(&self) -> Asking {
        let (client, link) = (self.network.client.clone(), self.link.clone());
        let handle = &self.network.network;
        handle.spawn(async move { client.call_status(&link).await })
    }

    /// The answer, once there is one.
    fn answer(&self, asking: &mut Option<Asking>) -> Option<anyhow::Result<CallStatus>> {
        let answered = asking.take_if(|asking| asking.is_finished())?;
        let answer = self.network.network.block_on(answered);
        let answer = answer
            .map_err(anyhow::Error::from)
            .and_then(|status| Ok(status?));
        Some(answer.context("the server does not tell who is in the call"))
    }

    /// The key of each seat's occupant, as far as they prove that they have it and the call's link.
    fn keys(&self, told: &[Seat]) -> Vec<Option<PublicKey>> {
        let key_of = |taken: &Taken| {
            membership::key_of(&self.link, taken)
                .inspect_err(|why| log::debug!("a member does not prove their key: {why}"))
                .ok()
                .flatten()
        };
        (told.iter())
            .map(|seat| seat.taken.as_ref().and_then(key_of))
            .collect()
    }

    /// Compares the seats, whose occupants have these `keys`, with who is known; who has to be fetched.
    fn arrivals(
        &self,
        told: &[Seat],
        keys: &[Option<PublicKey>],
        seats: &mut Seats,
    ) -> Vec<Expected> {
        let own = self.own.room();
        let mut arrivals = Vec::new();
        let all = told.iter().zip(&self.voices).zip(keys).enumerate();
        for (number, ((seat, voice), key)) in all {
            let known = seats.known.get_mut(&seat.room);
            if &seat.room == own.room() {
                // Taken in place of one that was lost: who sat here before has left, and nobody meets themselves.
                if let Some(former) = known {
                    former.is_seated = false;
                    former.watch.leave();
                }
                continue;
            }
            let Some(taken) = &seat.taken else {
                if let Some(person) = known {
                    person.is_seated = false;
                }
                continue;
            };
            if let Some(person) = known {
                person.is_seated = true;
                // What the server says that they are called is of no account: who it is shows in the connection.
                let is_same_avatar = person.taken.announcement.avatar == taken.announcement.avatar;
                if !is_same_avatar || *key != Some(person.key) {
                    person.watch.leave();
                }
                continue;
            }
            let Some(key) = *key else {
                if seats.unproved.insert(seat.room.clone()) {
                    (self.tell)(&format!(
                        "careful: the occupant of place {} of the call does not prove to have the call's link, and neither sees you nor is shown. Their program may be too old, or their link or yours is wrong: was yours copied whole?",
                        number + 1
                    ));
                }
                continue;
            };
            if !self.door.lets_in(key) {
                continue;
            }
            let trouble = seats.troubles.get(&seat.room);
            let waits = trouble.is_some_and(|trouble| Instant::now() < trouble.again);
            if waits || seats.fetching.contains(&seat.room) {
                continue;
            }
            let watch = CallWatch::default();
            let known = Known::new(number, taken.clone(), key, watch.clone());
            log::info!("{} is in the call: fetching their avatar", known.name);
            seats.known.insert(seat.room.clone(), known);
            arrivals.push(Expected {
                seat: seat.room.clone(),
                taken: taken.clone(),
                watch,
                voice: voice.clone(),
            });
        }
        arrivals
    }

    /// Hands over who was fetched; whether they are still taken.
    fn take<A>(
        &self,
        newcomers: &Receiver<Fetched<A>>,
        Seats {
            known, fetching, ..
        }: &mut Seats,
        admit: &mut impl FnMut(Newcomer<A>) -> bool,
    ) -> bool {
        while let Ok((room, watch, person)) = newcomers.try_recv() {
            fetching.remove(&room);
            // Meanwhile they may have left, and another person may sit there.
            let theirs = known
                .get_mut(&room)
                .filter(|entry| entry.watch.is_same(&watch));
            let Some(entry) = theirs else {
                continue;
            };
            match person {
                Ok(Some(_)) if entry.watch.is_over() => {}
                Ok(Some(person)) => {
                    // It is told once the connection shows that they have the link.
                    entry.joined = Some(Instant::now());
                    self.members.lock().push(Member {
                        name: entry.name.clone(),
                        watch: person.watch.clone(),
                        voice: person.voice.clone(),
                    });
                    if !admit(person) {
                        return false;
                    }
                }
                Ok(None) => {}
                Err(why) => {
                    log::warn!("{} cannot be shown: {why:#}", entry.name);
                    entry.watch.leave();
                }
            }
        }
        true
    }

    /// Tells who has joined, once their name is known.
    fn introduce(&self, person: &mut Known, acquaintances: &mut Acquaintances) {
        person.is_introduced = true;
        let is_theirs = |member: &&mut Member| member.watch.is_same(&person.watch);
        if let Some(member) = self.members.lock().iter_mut().find(is_theirs) {
            member.name.clone_from(&person.name);
        }
        (self.tell)(&format!("{} has joined", person.name));
        (self.tell)(&self.introduction(person, acquaintances));
        if let Some(many) = acquaintances.many_new() {
            (self.tell)(&many.to_string());
        }
    }

    /// Reports each member, once, who sees and hears this side and is not shown, whatever they answer its offers.
    fn report_unshown(&self, seats: &mut Seats) {
        let now = Instant::now();
        for (seat, key) in &seats.seated {
            let person = seats.known.get(seat);
            let is_shown = person.is_some_and(|it| it.is_introduced && it.over.is_none());
            if is_shown || seats.fetching.contains(seat) || !self.door.has_inside(*key) {
                if let Some(unshown) = seats.unshown.get_mut(key) {
                    unshown.since = now;
                }
                continue;
            }
            let unshown = seats.unshown.entry(*key).or_insert_with(|| {
                // They may have unlocked the call for themselves.
                seats.troubles.remove(seat);
                Unshown::from(now)
            });
            let refuses = person.is_none_or(|it| it.watch.waits() || it.watch.is_over());
            let longest = if refuses { REFUSED } else { UNANSWERED };
            if unshown.is_reported || now.duration_since(unshown.since) <= longest {
                continue;
            }
            unshown.is_reported = true;
            let (name, key) = (person.map(|it| it.name.as_str()), key.fingerprint());
            (self.tell)(&format!(
                "careful: {}, the key {key}, sees and hears you and is not shown: you neither see nor hear them; `x {key}` sends them away",
                name.unwrap_or("a member")
            ));
        }
        let Seats {
            unshown, seated, ..
        } = seats;
        unshown.retain(|key, _| seated.iter().any(|(_, it)| it == key));
    }

    /// Who a person is by their key, in a line.
    fn introduction(&self, person: &Known, acquaintances: &mut Acquaintances) -> String {
        let (name, key) = (&person.name, person.key);
        let shown = key.fingerprint();
        let opened = if self.link.key() == Some(key.hash()) {
            ", who opened the call"
        } else {
            ""
        };
        let own = self.network.own.as_ref().map(Credentials::key);
        if own == Some(key) {
            return format!(
                "{name} has your own key ({shown}): it is you on another machine, or someone has a copy of it"
            );
        }
        let Some(signed) = person.watch.person() else {
            return format!("{name} has the key {shown}{opened}");
        };
        match acquaintances.meet(key, &signed) {
            Meeting::New => format!("{name} is new to you: their key is {shown}{opened}"),
            Meeting::Again => format!("{name} is who you have met before ({shown}){opened}"),
            Meeting::Renamed { before } => {
                format!("{name} is who you have met as {before} ({shown}){opened}")
            }
            Meeting::Namesake => {
                format!(
                    "careful: {name} is not the one of that name whom you have met; their key is {shown}{opened}"
                )
            }
        }
    }

    /// Tells, once, that who opened the call is not among those who are there.
    fn miss_opener(&self, seats: &Seats, opener: &mut Opener) {
        let keys = seats.known.values().map(|person| {
            if person.watch.is_over() {
                Some(None)
            } else {
                person.watch.key()
            }
        });
        let keys: Vec<_> = keys
            .map(|shown| shown.map(|key| key.map(|key| key.hash())))
            .collect();
        if opener.is_missed(&keys, Instant::now()) {
            (self.tell)(match keys.len() {
                0 => "who opened the call is not here yet",
                _ => "careful: nobody who is here is who opened the call, by the key in the link",
            });
        }
    }

    /// Tells of changes, and forgets who is gone.
    fn look(&self, seats: &mut Seats, acquaintances: &mut Acquaintances) {
        let Seats {
            known, troubles, ..
        } = seats;
        troubles.retain(|_, trouble| trouble.last.elapsed() <= FORGOTTEN);
        let is_told = |person: &&Known| person.is_introduced && person.over.is_none();
        let mut signed: Vec<PersonName> = (known.values().filter(is_told))
            .filter_map(|person| person.watch.person())
            .collect();
        known.retain(|seat, person| {
            let now = Instant::now();
            let bytes = person.watch.counts().payload_bytes;
            if bytes != person.heard.1 {
                person.heard = (now, bytes);
            }
            if self.door.has_removed(person.key) {
                person.watch.leave();
            }
            match person.watch.key() {
                Some(_) if person.is_introduced || person.watch.is_over() => {}
                Some(Some(key)) if key == person.key => {
                    let theirs = person.watch.person();
                    person.name = called(theirs.as_ref(), person.number, &signed);
                    signed.extend(theirs);
                    self.introduce(person, acquaintances);
                }
                Some(_) => {
                    (self.tell)(&format!(
                        "careful: {} shows another key than the one that sits there, and is not shown",
                        person.name
                    ));
                    person.watch.leave();
                }
                None => {}
            }
            let (state, (before, told_at)) = (person.watch.state(), person.state);
            if state != before && told_at.is_none_or(|at| at.elapsed() >= TOLD_APART) {
                person.state = (state, Some(now));
                for line in told(&person.name, before, state) {
                    (self.tell)(&line);
                }
            }
            if !person.is_seated && person.heard.0.elapsed() > SILENCE {
                person.watch.leave();
            }
            if person.watch.is_over() && person.over.is_none() {
                person.over = Some(now);
                if person.is_introduced {
                    (self.tell)(&format!("{} has left", person.name));
                }
                // Once: the seat is tried again, ever more rarely.
                let is_first = !troubles.contains_key(seat);
                if let Some(why) = person.watch.failure().filter(|_| is_first) {
                    (self.tell)(&format!("{} is not shown: {why}", person.name));
                }
                let watch = &person.watch;
                self.members
                    .lock()
                    .retain(|member| !member.watch.is_same(watch));
            }
            let Some(since) = person.over else {
                return true;
            };
            if person.is_seated && since.elapsed() <= FAREWELL {
                // The server may still show the seat as taken for a moment.
                return true;
            }
            if person.is_seated {
                let stayed = person.joined.map(|joined| since.duration_since(joined));
                if stayed.is_some_and(|stayed| stayed >= FORGIVEN) {
                    troubles.remove(seat);
                }
                note_trouble(troubles, seat, now);
            }
            false
        });
    }
}

/// Who opened the call, as its link says, until it is known whether they are there.
struct Opener {
    /// Nothing where the link tells no key, it is one's own, or all is told.
    key: Option<KeyHash>,
    /// When the server first told who is there.
    since: Option<Instant>,
}

impl Opener {
    fn of(roster: &Roster<'_>) -> Self {
        let own = roster.network.own.as_ref().map(|own| own.key().hash());
        Self {
            key: roster.link.key().filter(|key| Some(*key) != own),
            since: None,
        }
    }

    fn begin(&mut self) {
        self.since.get_or_insert_with(Instant::now);
    }

    /// Whether it is known now that they are not among the people with these `keys`, each nothing as long as it is not known. True once.
    fn is_missed(&mut self, keys: &[Option<Option<KeyHash>>], now: Instant) -> bool {
        let (Some(key), Some(since)) = (self.key, self.since) else {
            return false;
        };
        if keys.contains(&Some(Some(key))) {
            self.key = None;
            return false;
        }
        let is_known = keys.iter().all(Option::is_some);
        let is_missed = is_known || now.duration_since(since) > SHOWN_WITHIN;
        if is_missed {
            self.key = None;
        }
        is_missed
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
    fn who_opened_the_call_is_missed_once_all_who_are_there_have_shown_their_keys() {
        let hash = |seed: u8| {
            let identity = identity::Identity::from_seed(&[seed; 32]);
            identity.expect("a key").public().hash()
        };
        let (theirs, other) = (hash(1), hash(2));
        let begun = Instant::now();
        let opener = |since| Opener {
            key: Some(theirs),
            since,
        };
        let soon = begun + Duration::from_secs(1);
        assert!(!opener(None).is_missed(&[], soon), "nothing is known yet");
        let mut missed = opener(Some(begun));
        assert!(
            !missed.is_missed(&[None, Some(Some(other))], soon),
            "one to come"
        );
        assert!(
            missed.is_missed(&[Some(None), Some(Some(other))], soon),
            "others"
        );
        assert!(!missed.is_missed(&[Some(Some(other))], soon), "told once");
        let late = begun + SHOWN_WITHIN + Duration::from_secs(1);
        assert!(
            opener(Some(begun)).is_missed(&[None], late),
            "not waited for"
        );
        assert!(opener(Some(begun)).is_missed(&[], soon), "nobody");
        let mut here = opener(Some(begun));
        assert!(!here.is_missed(&[Some(Some(theirs)), None], soon), "here");
        assert!(
            !here.is_missed(&[], late),
            "who was here and left is not missed"
        );
    }

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
