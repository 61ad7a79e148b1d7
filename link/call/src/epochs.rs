//! The keys of what a server hands on. A sender and each viewer that it hands over agree on a shared key (X25519, RFC
//! 7748; HKDF-SHA256, RFC 5869), by which the viewer gets the key of each *epoch*. The sender begins an epoch when a
//! viewer joins or leaves. A viewer cannot open what was sealed in the epochs before it joined or after it left, and
//! the link's secret opens none of them, even for a server that has recorded all that it handed on.

use crate::CallError;
use data_encoding::BASE64URL_NOPAD;
use link_protocol::{Name, PackageId, RoomLink};
use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, NONCE_LEN, Nonce, UnboundKey};
use ring::agreement::{EphemeralPrivateKey, UnparsedPublicKey, X25519, agree_ephemeral};
use ring::hkdf::{HKDF_SHA256, Salt};
use ring::rand::SystemRandom;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

/// The shortest time from one epoch to the next, and the same as a multiple of what it takes to distribute its key:
/// viewers that join and leave again and again cost no more than that.
const SHORTEST: Duration = Duration::from_secs(1);
const SHORTEST_DISTRIBUTIONS: u32 = 4;

/// Viewers whose keys are in one message, which fits into one packet.
const ENTRIES_PER_MESSAGE: usize = 16;

/// Each viewer's key is sent so many times when an epoch begins, in messages so far apart, within [`LONGEST_ROUNDS`] in
/// all.
const FIRST_ROUNDS: u32 = 3;
const MESSAGE_INTERVAL: Duration = Duration::from_millis(10);
const LONGEST_ROUNDS: Duration = Duration::from_secs(2);

/// After the last of them the networks have so long to carry it before the key is used.
const PROPAGATION: Duration = Duration::from_millis(200);

/// Later a message goes out so often, for viewers that have lost all of the first ones: half of it for those that have
/// joined within [`NEW`] and may have been connecting meanwhile.
const REPEATED: Duration = Duration::from_millis(400);
const NEW: Duration = Duration::from_secs(15);

const KEY_BYTES: usize = 32;
const PUBLIC_BYTES: usize = 32;
const TAG_BYTES: usize = link_protocol::sealed::TAG_BYTES;

/// Of a viewer's public key, what it is found by in a message.
const ID_BYTES: usize = 8;

/// In a message of keys: the epoch, then of each viewer its id and its sealed key.
const EPOCH_BYTES: usize = 4;
const ENTRY_BYTES: usize = ID_BYTES + KEY_BYTES + TAG_BYTES;

/// What an epoch's messages and packets are sealed by, with a salt.
pub(crate) type EpochKey = [u8; KEY_BYTES];

/// One side's half of the agreement, which is used once.
pub(crate) struct Exchange {
    private: EphemeralPrivateKey,
    public: [u8; PUBLIC_BYTES],
}

impl std::fmt::Debug for Exchange {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Exchange").finish_non_exhaustive()
    }
}

impl Exchange {
    /// A new one.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub(crate) fn new() -> Result<Self, CallError> {
        let private = EphemeralPrivateKey::generate(&X25519, &SystemRandom::new());
        let private = private.map_err(|_| getrandom::Error::UNEXPECTED)?;
        let public = private.compute_public_key();
        let public = public.map_err(|_| CallError::NoExchange)?;
        let public = public.as_ref().try_into();
        let public = public.map_err(|_| CallError::NoExchange)?;
        Ok(Self { private, public })
    }

    /// The public key, as an offer has it.
    pub(crate) fn text(&self) -> String {
        BASE64URL_NOPAD.encode(&self.public)
    }

    /// What the sender signs of its `answer` to this exchange.
    pub(crate) fn signed(&self, room: &RoomLink, avatar: PackageId, answer: &str) -> String {
        signed(room, avatar, &self.public, answer)
    }

    /// The viewer's end, by the answer of the sender that hands it over.
    ///
    /// # Errors
    /// [`CallError::NoExchange`] if it is not the answer of one that has the room's link, to this exchange.
    pub(crate) fn accept(
        self,
        answer: &str,
        room: &RoomLink,
        avatar: PackageId,
    ) -> Result<ViewerKeys, CallError> {
        let viewer = self.public;
        let read = || {
            let mut parts = answer.split(' ');
            let sender = of_text(parts.next()?)?;
            let epoch = parts.next()?.parse().ok()?;
            let sealed = of_text::<{ KEY_BYTES + TAG_BYTES }>(parts.next()?)?;
            parts.next().is_none().then_some((sender, epoch, sealed))
        };
        let (sender, epoch, sealed) = read().ok_or(CallError::NoExchange)?;
        let mut keys = ViewerKeys {
            id: id(&viewer),
            shared: agree(self.private, &sender, room, avatar, [&viewer, &sender])?,
            epochs: Vec::new(),
        };
        let is_theirs = keys.open_key(epoch, &sealed);
        is_theirs.then_some(keys).ok_or(CallError::NoExchange)
    }
}

/// The key that the two sides share: of the agreement, the link's secret, which no server has, and all that both know.
fn agree(
    private: EphemeralPrivateKey,
    theirs: &[u8; PUBLIC_BYTES],
    room: &RoomLink,
    avatar: PackageId,
    [viewer, sender]: [&[u8; PUBLIC_BYTES]; 2],
) -> Result<LessSafeKey, CallError> {
    let secret = room.secret().ok_or(CallError::NoLink)?;
    let head = format!("mon3tr exchange 1\n{}\n{avatar}\n", room.room());
    let info = [head.as_bytes(), viewer, sender];
    let theirs = UnparsedPublicKey::new(&X25519, theirs);
    let key = agree_ephemeral(private, &theirs, |agreed| {
        let extracted = Salt::new(HKDF_SHA256, secret.bytes()).extract(agreed);
        let expanded = extracted.expand(&info, &CHACHA20_POLY1305);
        expanded.map(|key| LessSafeKey::new(UnboundKey::from(key)))
    });
    key.and_then(|key| key).map_err(|_| CallError::NoExchange)
}

fn signed(room: &RoomLink, avatar: PackageId, viewer: &[u8; PUBLIC_BYTES], answer: &str) -> String {
    let viewer = BASE64URL_NOPAD.encode(viewer);
    format!("{}\n{avatar}\n{viewer}\n{answer}", room.room())
}

fn of_text<const N: usize>(text: &str) -> Option<[u8; N]> {
    let bytes = BASE64URL_NOPAD.decode(text.as_bytes()).ok()?;
    bytes.try_into().ok()
}

fn id(public: &[u8; PUBLIC_BYTES]) -> [u8; ID_BYTES] {
    let (id, _) = public.split_first_chunk().unwrap_or((&[0; ID_BYTES], &[]));
    *id
}

/// The plaintext under a shared key is the same whenever an epoch's key is sealed, so the epoch may be the nonce.
fn nonce(epoch: u32) -> Nonce {
    let mut nonce = [0; NONCE_LEN];
    nonce[NONCE_LEN - EPOCH_BYTES..].copy_from_slice(&epoch.to_le_bytes());
    Nonce::assume_unique_for_key(nonce)
}

/// What a viewer knows of the epochs.
pub(crate) struct ViewerKeys {
    id: [u8; ID_BYTES],
    shared: LessSafeKey,
    /// The newest first: what was sealed in the one before may still be on its way.
    epochs: Vec<(u32, EpochKey)>,
}

impl std::fmt::Debug for ViewerKeys {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ViewerKeys").finish_non_exhaustive()
    }
}

impl ViewerKeys {
    /// The epochs by whose keys something may be sealed now, and the keys.
    pub(crate) fn newest(&self) -> &[(u32, EpochKey)] {
        &self.epochs
    }

    /// Reads a message of keys; whether one of them is for this viewer.
    pub(crate) fn read_message(&mut self, message: &[u8]) -> bool {
        let Some((epoch, entries)) = message.split_first_chunk() else {
            return false;
        };
        let epoch = u32::from_le_bytes(*epoch);
        let (entries, _) = entries.as_chunks::<ENTRY_BYTES>();
        entries.iter().any(|entry| {
            let (id, sealed) = entry.split_at(ID_BYTES);
            *id == self.id && self.open_key(epoch, sealed)
        })
    }

    /// Opens the key of an epoch, and keeps it if it is newer than those before; whether it is one for this viewer.
    fn open_key(&mut self, epoch: u32, sealed: &[u8]) -> bool {
        let mut bytes = sealed.to_vec();
        let opened = self
            .shared
            .open_in_place(nonce(epoch), Aad::empty(), &mut bytes);
        let Some(key) = opened.ok().and_then(|key| EpochKey::try_from(&*key).ok()) else {
            return false;
        };
        if self.epochs.first().is_none_or(|(last, _)| *last < epoch) {
            self.epochs.insert(0, (epoch, key));
            self.epochs.truncate(2);
        }
        true
    }
}

/// The sender's end. Clones share it.
#[derive(Debug, Clone)]
pub(crate) struct Epochs(Arc<watch::Sender<State>>);

#[derive(Debug)]
struct State {
    /// The number of the newest one; before the first viewer there is none.
    epoch: u32,
    key: EpochKey,
    before: EpochKey,
    begun: Instant,
    /// Until then the key before is used.
    used_from: Instant,
    /// Viewers have joined or left since it began.
    membership_changed: bool,
    viewers: Vec<Viewer>,
}

#[derive(Debug)]
struct Viewer {
    session: Name,
    joined: Instant,
    id: [u8; ID_BYTES],
    shared: LessSafeKey,
}

impl Default for Epochs {
    fn default() -> Self {
        Self(Arc::new(watch::Sender::new(State {
            epoch: 0,
            key: EpochKey::default(),
            before: EpochKey::default(),
            begun: Instant::now(),
            used_from: Instant::now(),
            membership_changed: false,
            viewers: Vec::new(),
        })))
    }
}

impl State {
    /// Messages of one round.
    fn messages(&self) -> u32 {
        let messages = self.viewers.len().div_ceil(ENTRIES_PER_MESSAGE);
        u32::try_from(messages).unwrap_or(u32::MAX / FIRST_ROUNDS)
    }

    /// From one message of the first rounds to the next.
    fn interval(&self) -> Duration {
        MESSAGE_INTERVAL.min(LONGEST_ROUNDS / (self.messages() * FIRST_ROUNDS).max(1))
    }

    /// How long it takes until all viewers know a key.
    fn distribution(&self) -> Duration {
        self.interval() * self.messages() * FIRST_ROUNDS + PROPAGATION
    }

    /// Begins the next epoch if viewers have joined or left and the present one has lasted long enough; whether it
    /// does.
    fn begin_next_if_due(&mut self, now: Instant) -> Result<bool, CallError> {
        let shortest = SHORTEST.max(self.distribution() * SHORTEST_DISTRIBUTIONS);
        let is_first = self.epoch == 0;
        let lasts = !is_first && now.duration_since(self.begun) < shortest;
        if !self.membership_changed || lasts {
            return Ok(false);
        }
        let mut next = EpochKey::default();
        getrandom::fill(&mut next)?;
        self.before = if is_first { next } else { self.key };
        self.key = next;
        self.epoch += 1;
        self.begun = now;
        self.used_from = now + self.distribution();
        self.membership_changed = false;
        Ok(true)
    }

    /// An entry of a message for this viewer.
    fn write_entry(&self, viewer: &Viewer, message: &mut Vec<u8>) {
        if let Ok(sealed) = self.sealed_for(viewer) {
            message.extend(viewer.id);
            message.extend(sealed);
        }
    }

    /// The newest epoch's key for this viewer.
    fn sealed_for(&self, viewer: &Viewer) -> Result<[u8; KEY_BYTES + TAG_BYTES], CallError> {
        let mut sealed = [0; KEY_BYTES + TAG_BYTES];
        let (key, rest) = sealed.split_at_mut(KEY_BYTES);
        key.copy_from_slice(&self.key);
        let shared = &viewer.shared;
        let tag = shared.seal_in_place_separate_tag(nonce(self.epoch), Aad::empty(), key);
        rest.copy_from_slice(tag.map_err(|_| CallError::NoExchange)?.as_ref());
        Ok(sealed)
    }
}

impl Epochs {
    /// Has a viewer, whose offer has `exchange`, know the keys from now on; what it is answered, and what the sender signs
    /// of that.
    ///
    /// # Errors
    /// [`CallError::NoExchange`] if the offer has no key.
    pub(crate) fn admit(
        &self,
        session: &Name,
        exchange: Option<&str>,
        room: &RoomLink,
        avatar: PackageId,
    ) -> Result<[String; 2], CallError> {
        let theirs = exchange.and_then(of_text).ok_or(CallError::NoExchange)?;
        let own = Exchange::new()?;
        let (sender, text) = (own.public, own.text());
        let viewer = Viewer {
            session: session.clone(),
            joined: Instant::now(),
            id: id(&theirs),
            shared: agree(own.private, &theirs, room, avatar, [&theirs, &sender])?,
        };
        let mut answer = Err(CallError::NoExchange);
        self.0.send_modify(|state| {
            state.membership_changed = true;
            answer = state.begin_next_if_due(Instant::now()).and_then(|_| {
                let sealed = state.sealed_for(&viewer)?;
                let sealed = BASE64URL_NOPAD.encode(&sealed);
                Ok(format!("{text} {} {sealed}", state.epoch))
            });
            if answer.is_ok() {
                state.viewers.push(viewer);
            }
        });
        let answer = answer?;
        let signed = signed(room, avatar, &theirs, &answer);
        Ok([answer, signed])
    }

    /// A viewer has left, or has to: it does not learn the keys of the epochs to come.
    pub(crate) fn leave(&self, session: &Name) {
        self.0.send_if_modified(|state| {
            let before = state.viewers.len();
            state.viewers.retain(|viewer| viewer.session != *session);
            let has_left = state.viewers.len() < before;
            state.membership_changed |= has_left;
            has_left
        });
    }

    /// The epoch by whose key is sealed now, and the key; nothing before the first viewer.
    pub(crate) fn now(&self) -> Option<(u32, EpochKey)> {
        let state = self.0.borrow();
        let is_known = Instant::now() >= state.used_from;
        let used = if is_known {
            (state.epoch, state.key)
        } else {
            (state.epoch.saturating_sub(1), state.before)
        };
        (state.epoch > 0).then_some(used)
    }

    /// Distributes the keys to the viewers behind one forwarder.
    pub(crate) fn distribution(&self) -> Distribution {
        Distribution {
            epochs: self.clone(),
            changed: self.0.subscribe(),
            epoch: 0,
            round: Vec::new(),
            sent: 0,
            next: Instant::now(),
        }
    }
}

/// Which message of keys is sent when.
#[derive(Debug)]
pub(crate) struct Distribution {
    epochs: Epochs,
    changed: watch::Receiver<State>,
    /// The epoch whose key is sent, and the sessions of its viewers when it began.
    epoch: u32,
    round: Vec<Name>,
    /// Messages of it that were sent.
    sent: u32,
    next: Instant,
}

impl Distribution {
    /// Waits until a message has to be sent: the epoch, and of some viewers the id and the key that is sealed for them.
    /// May be cancelled. The same one comes again unless it is [`Self::sent`].
    pub(crate) async fn due(&mut self) -> Vec<u8> {
        loop {
            tokio::select! {
                () = sleep_until(self.next) => {}
                _ = self.changed.changed() => {}
            }
            if let Some(message) = self.message(Instant::now()) {
                return message;
            }
        }
    }

    /// The message has been handed to the network.
    pub(crate) fn sent(&mut self) {
        self.sent = self.sent.saturating_add(1);
    }

    fn message(&mut self, now: Instant) -> Option<Vec<u8>> {
        // The distributions to other forwarders have to notice a new epoch, too.
        self.epochs.0.send_if_modified(|state| {
            let begins = state.begin_next_if_due(now);
            begins.unwrap_or_else(|why| {
                log::error!("what the server hands on gets no new key: {why}");
                false
            })
        });
        self.changed.mark_unchanged();
        let state = self.epochs.0.borrow();
        if state.epoch != self.epoch {
            let sessions = state.viewers.iter().map(|viewer| viewer.session.clone());
            self.round = sessions.collect();
            (self.epoch, self.sent, self.next) = (state.epoch, 0, now);
        }
        if now < self.next {
            return None;
        }
        let messages = self.round.len().div_ceil(ENTRIES_PER_MESSAGE);
        let rounds = (self.sent as usize).checked_div(messages);
        let is_first = rounds.is_some_and(|rounds| rounds < FIRST_ROUNDS as usize);
        self.next = now + if is_first { state.interval() } else { REPEATED };
        let mut message = state.epoch.to_le_bytes().to_vec();
        if is_first {
            let at = self.sent as usize % messages.max(1);
            let sessions = self.round.chunks(ENTRIES_PER_MESSAGE).nth(at)?;
            let is_meant = |viewer: &&Viewer| sessions.contains(&viewer.session);
            for viewer in state.viewers.iter().filter(is_meant) {
                state.write_entry(viewer, &mut message);
            }
        } else {
            let new = (state.viewers.iter()).filter(|viewer| now < viewer.joined + NEW);
            let halves = [new.collect::<Vec<_>>(), state.viewers.iter().collect()];
            for half in halves {
                let begin = self.sent as usize * (ENTRIES_PER_MESSAGE / 2);
                let entries = half.len().min(ENTRIES_PER_MESSAGE / 2);
                for at in begin..begin + entries {
                    state.write_entry(half.get(at % half.len())?, &mut message);
                }
            }
        }
        (message.len() > EPOCH_BYTES).then_some(message)
    }
}

#[cfg(test)]
pub(crate) mod tests;
