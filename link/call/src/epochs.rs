//! The keys of what a server hands on. A sender and each viewer whom it hands over agree on a key of their own (X25519,
//! RFC 7748; HKDF-SHA256, RFC 5869), by which the viewer gets the key of each *epoch*. An epoch begins when a viewer
//! comes or leaves: whoever came later, has left, or learns the link afterwards opens nothing of the epochs before and
//! after, though they kept all that passed the server.

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

/// An epoch lasts so long at least, and so many times what it takes to have all viewers know its key: what leaving and
/// coming again and again costs.
const SHORTEST: Duration = Duration::from_secs(1);
const SHORTEST_GRACES: u32 = 4;

/// Viewers whose keys are in one message, which fits into one packet.
const A_MESSAGE: usize = 16;

/// A message of keys is sent so long after the one before, so many times to each viewer at first, within [`SPREAD`] in
/// all; then one every [`AGAIN`], for viewers that have lost all of the first ones.
const APART: Duration = Duration::from_millis(10);
const TIMES: u32 = 2;
const SPREAD: Duration = Duration::from_secs(2);
const AGAIN: Duration = Duration::from_millis(400);

/// From the last of them until the key is used, for networks to carry them.
const ON_THE_WAY: Duration = Duration::from_millis(200);

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
        let private = private.map_err(|_| CallError::NoExchange)?;
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
        let is_theirs = keys.learn(epoch, &sealed);
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

fn of_text<const N: usize>(text: &str) -> Option<[u8; N]> {
    let bytes = BASE64URL_NOPAD.decode(text.as_bytes()).ok()?;
    bytes.try_into().ok()
}

fn id(public: &[u8; PUBLIC_BYTES]) -> [u8; ID_BYTES] {
    let (id, _) = public.split_first_chunk().unwrap_or((&[0; ID_BYTES], &[]));
    *id
}

/// An epoch's key is sealed once for each viewer, so the epoch is nonce enough.
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
    /// The keys by which something may be sealed now.
    pub(crate) fn newest(&self) -> impl Iterator<Item = &EpochKey> {
        self.epochs.iter().map(|(_, key)| key)
    }

    /// Takes a message of keys; whether one of them is for this viewer.
    pub(crate) fn take(&mut self, message: &[u8]) -> bool {
        let Some((epoch, entries)) = message.split_first_chunk() else {
            return false;
        };
        let epoch = u32::from_le_bytes(*epoch);
        let (entries, _) = entries.as_chunks::<ENTRY_BYTES>();
        entries.iter().any(|entry| {
            let (id, sealed) = entry.split_at(ID_BYTES);
            *id == self.id && self.learn(epoch, sealed)
        })
    }

    /// Opens the key of an epoch, and keeps it if it is newer than those before; whether it is one for this viewer.
    fn learn(&mut self, epoch: u32, sealed: &[u8]) -> bool {
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
    known_at: Instant,
    /// Viewers have come or left since it began.
    is_over: bool,
    viewers: Vec<Viewer>,
}

#[derive(Debug)]
struct Viewer {
    session: Name,
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
            known_at: Instant::now(),
            is_over: false,
            viewers: Vec::new(),
        })))
    }
}

impl State {
    fn messages(&self) -> u32 {
        let messages = self.viewers.len().div_ceil(A_MESSAGE);
        u32::try_from(messages).unwrap_or(u32::MAX / TIMES)
    }

    /// From one of the first messages to the next.
    fn apart(&self) -> Duration {
        APART.min(SPREAD / (self.messages() * TIMES).max(1))
    }

    /// How long it takes to have all viewers know a key.
    fn grace(&self) -> Duration {
        self.apart() * self.messages() * TIMES + ON_THE_WAY
    }

    /// Begins the next epoch, if it is time to.
    fn turn(&mut self, now: Instant) -> Result<(), CallError> {
        let shortest = SHORTEST.max(self.grace() * SHORTEST_GRACES);
        let is_first = self.epoch == 0;
        let lasts = !is_first && now.duration_since(self.begun) < shortest;
        if !self.is_over || lasts {
            return Ok(());
        }
        let mut next = EpochKey::default();
        getrandom::fill(&mut next)?;
        self.before = if is_first { next } else { self.key };
        self.key = next;
        self.epoch += 1;
        self.begun = now;
        self.known_at = now + self.grace();
        self.is_over = false;
        Ok(())
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
    /// Has a viewer, whose offer has `exchange`, know the keys from now on; what it is answered.
    ///
    /// # Errors
    /// [`CallError::NoExchange`] if the offer has no key.
    pub(crate) fn admit(
        &self,
        session: &Name,
        exchange: Option<&str>,
        room: &RoomLink,
        avatar: PackageId,
    ) -> Result<String, CallError> {
        let viewer = exchange.and_then(of_text).ok_or(CallError::NoExchange)?;
        let own = Exchange::new()?;
        let (sender, text) = (own.public, own.text());
        let viewer = Viewer {
            session: session.clone(),
            id: id(&viewer),
            shared: agree(own.private, &viewer, room, avatar, [&viewer, &sender])?,
        };
        let mut answer = Err(CallError::NoExchange);
        self.0.send_modify(|state| {
            state.is_over = true;
            answer = state.turn(Instant::now()).and_then(|()| {
                let sealed = state.sealed_for(&viewer)?;
                let sealed = BASE64URL_NOPAD.encode(&sealed);
                Ok(format!("{text} {} {sealed}", state.epoch))
            });
            if answer.is_ok() {
                state.viewers.push(viewer);
            }
        });
        answer
    }

    /// A viewer has left, or has to: it does not learn the keys of the epochs to come.
    pub(crate) fn leave(&self, session: &Name) {
        self.0.send_if_modified(|state| {
            let before = state.viewers.len();
            state.viewers.retain(|viewer| viewer.session != *session);
            let has_left = state.viewers.len() < before;
            state.is_over |= has_left;
            has_left
        });
    }

    /// By what is sealed now; nothing before there was a viewer who could open it.
    pub(crate) fn now(&self) -> Option<EpochKey> {
        let state = self.0.borrow();
        let is_known = Instant::now() >= state.known_at;
        let key = if is_known { state.key } else { state.before };
        (state.epoch > 0).then_some(key)
    }

    /// Tells the viewers behind one forwarder of the keys.
    pub(crate) fn telling(&self) -> TellingKeys {
        TellingKeys {
            epochs: self.clone(),
            changed: self.0.subscribe(),
            epoch: 0,
            told: 0,
            next: Instant::now(),
        }
    }
}

/// Which message of keys is sent when.
#[derive(Debug)]
pub(crate) struct TellingKeys {
    epochs: Epochs,
    changed: watch::Receiver<State>,
    /// The epoch whose key is told, and how many messages of it were.
    epoch: u32,
    told: u32,
    next: Instant,
}

impl TellingKeys {
    /// Waits until a message has to be sent: the epoch, and of some viewers the id and the key that is sealed for them.
    /// May be cancelled.
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

    fn message(&mut self, now: Instant) -> Option<Vec<u8>> {
        self.epochs.0.send_if_modified(|state| {
            if let Err(why) = state.turn(now) {
                log::error!("what the server hands on gets no new key: {why}");
            }
            false
        });
        self.changed.mark_unchanged();
        let state = self.epochs.0.borrow();
        if state.epoch != self.epoch {
            (self.epoch, self.told, self.next) = (state.epoch, 0, now);
        }
        if now < self.next {
            return None;
        }
        let messages = state.messages();
        let is_first = self.told < messages * TIMES;
        self.next = now + if is_first { state.apart() } else { AGAIN };
        let at = self.told.checked_rem(messages)?;
        self.told = self.told.saturating_add(1);
        let mut message = state.epoch.to_le_bytes().to_vec();
        for viewer in state.viewers.chunks(A_MESSAGE).nth(at as usize)? {
            message.extend(viewer.id);
            message.extend(state.sealed_for(viewer).ok()?);
        }
        Some(message)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use link_protocol::LinkSecret;

    fn room(secret: u8) -> RoomLink {
        let server = "http://127.0.0.1:1".parse().expect("an address");
        let room = RoomLink::of(server, "r1", "token").expect("a room");
        room.with_secret(LinkSecret::new([secret; 16]))
    }

    fn avatar() -> PackageId {
        "a".repeat(64).parse().expect("a hash")
    }

    fn session(number: u8) -> Name {
        Name::of_id([number; 16])
    }

    /// A viewer of this session comes.
    pub(crate) fn comes(
        epochs: &Epochs,
        number: u8,
        room: &RoomLink,
        avatar: PackageId,
    ) -> ViewerKeys {
        let viewer = Exchange::new().expect("random");
        let answer = epochs.admit(&session(number), Some(&viewer.text()), room, avatar);
        let answer = answer.expect("admitted");
        viewer.accept(&answer, room, avatar).expect("the answer")
    }

    fn comes_in(epochs: &Epochs, number: u8) -> ViewerKeys {
        comes(epochs, number, &room(1), avatar())
    }

    /// Time passes: the sender's epoch may be over, and its newest key is used.
    fn pass(epochs: &Epochs) {
        epochs.0.send_modify(|state| {
            state.begun -= Duration::from_secs(60);
            state.known_at = state.begun;
        });
    }

    /// All that is told of the newest epoch, once.
    fn told(epochs: &Epochs) -> Vec<Vec<u8>> {
        let mut telling = epochs.telling();
        let mut now = Instant::now();
        let first = telling.message(now);
        let messages = epochs.0.borrow().messages();
        let rest = (1..messages).map(|_| {
            now += SPREAD;
            telling.message(now).expect("one more")
        });
        first.into_iter().chain(rest).collect()
    }

    fn knows(keys: &ViewerKeys, key: EpochKey) -> bool {
        keys.newest().any(|known| *known == key)
    }

    #[test]
    fn who_comes_later_or_has_left_knows_no_key_of_the_epochs_before_and_after() {
        let epochs = Epochs::default();
        assert_eq!(epochs.now(), None, "nobody could open it");
        let mut ada = comes_in(&epochs, 1);
        let first = epochs.now().expect("a key");
        assert!(knows(&ada, first));
        pass(&epochs);
        let mut bob = comes_in(&epochs, 2);
        assert_eq!(epochs.now(), Some(first), "Ada does not know the next yet");
        assert!(!knows(&bob, first), "what was before he came");
        for message in told(&epochs) {
            assert!(ada.take(&message));
            bob.take(&message);
        }
        pass(&epochs);
        let second = epochs.now().expect("a key");
        assert!(second != first && knows(&ada, second) && knows(&bob, second));
        // Bob leaves, and keeps reading what passes.
        epochs.leave(&session(2));
        for message in told(&epochs) {
            assert!(ada.take(&message));
            bob.take(&message);
        }
        pass(&epochs);
        let third = epochs.now().expect("a key");
        assert!(third != second && knows(&ada, third) && !knows(&bob, third));
        // What was said before is of no use to those who learn all that Ada still knows.
        assert!(!knows(&ada, first) && knows(&ada, second));
    }

    #[test]
    fn an_epoch_lasts_a_second_however_many_come_and_go() {
        let epochs = Epochs::default();
        let mut keys = comes_in(&epochs, 0);
        for number in 1..50 {
            comes_in(&epochs, number);
            epochs.leave(&session(number));
        }
        assert_eq!(epochs.0.borrow().epoch, 1);
        assert!(knows(&keys, epochs.now().expect("a key")));
        pass(&epochs);
        let [message] = &told(&epochs)[..] else {
            panic!("one viewer");
        };
        assert_eq!(message.len(), EPOCH_BYTES + ENTRY_BYTES);
        assert_eq!(epochs.0.borrow().epoch, 2, "the next one");
        assert!(keys.take(message));
        pass(&epochs);
        assert!(knows(&keys, epochs.now().expect("a key")));
    }

    #[test]
    fn a_large_audience_is_told_in_messages_of_one_packet_within_seconds() {
        let epochs = Epochs::default();
        let mut all: Vec<_> = (0..200).map(|number| comes_in(&epochs, number)).collect();
        pass(&epochs);
        epochs.leave(&session(199));
        let messages = told(&epochs);
        assert_eq!(messages.len(), 199usize.div_ceil(A_MESSAGE));
        for keys in &mut all {
            for message in &messages {
                keys.take(message);
            }
        }
        assert!(messages.iter().all(|message| message.len() < 1_000));
        assert!(epochs.0.borrow().grace() < Duration::from_secs(3));
        pass(&epochs);
        let key = epochs.now().expect("a key");
        let know = all.iter().filter(|keys| knows(keys, key)).count();
        assert_eq!(know, 199, "all but the one who left");
    }

    #[test]
    fn keys_are_taken_of_the_sender_alone_and_never_an_old_one_again() {
        let epochs = Epochs::default();
        let viewer = Exchange::new().expect("random");
        let text = viewer.text();
        let answer = epochs.admit(&session(1), Some(&text), &room(1), avatar());
        let answer = answer.expect("admitted");
        // Whoever has no link cannot be in between, nor change the answer.
        let refused = |answer: &str, room: &RoomLink| {
            let viewer = Exchange::new().expect("random");
            viewer.accept(answer, room, avatar()).is_err()
        };
        assert!(refused(&answer, &room(1)), "another viewer's");
        assert!(refused("", &room(1)) && refused("x 1 y", &room(1)));
        let other = Exchange::new().expect("random");
        let of_other = epochs.admit(&session(2), Some(&other.text()), &room(2), avatar());
        let of_other = of_other.expect("admitted with another secret");
        assert!(other.accept(&of_other, &room(1), avatar()).is_err());
        for exchange in [None, Some(""), Some("AAAA")] {
            let refused = epochs.admit(&session(3), exchange, &room(1), avatar());
            assert!(refused.is_err(), "{exchange:?}");
        }
        let mut keys = viewer.accept(&answer, &room(1), avatar()).expect("its own");
        pass(&epochs);
        epochs.leave(&session(2));
        let [message] = &told(&epochs)[..] else {
            panic!("one viewer");
        };
        for at in 0..message.len() {
            let mut changed = message.clone();
            changed[at] ^= 1;
            assert!(!keys.take(&changed) && !keys.take(&message[..at]));
            assert_eq!(keys.epochs.len(), 1, "byte {at}");
        }
        assert!(keys.take(message) && keys.take(message));
        assert_eq!(keys.epochs.len(), 2, "once");
    }
}
