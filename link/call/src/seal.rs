//! What a sender seals so that a server can hand it on to many viewers and not read or change it: every frame, state and
//! packet of voice by ChaCha20-Poly1305 (RFC 8439), with the key of the epoch ([`crate::epochs`]) and a salt of the
//! connection; the keys of epochs with one that is derived from the link's secret, which no server has. Who seals, the
//! sender shows by the same lines as in an answer; their text has the time, so that what was recorded is of no use
//! later.
//!
//! All viewers have the same keys. One of them that works together with the server could make up what the others see;
//! `docs/security.md` says so.

use crate::CallError;
use crate::epochs::{EpochKey, Epochs, ViewerKeys};
use crate::introduction::{self, Authentication, Credentials};
use crate::voice_track::VoicePacket;
use bytes::Bytes;
use data_encoding::BASE64URL_NOPAD;
use identity::{PublicKey, Purpose};
use link_protocol::sealed::{Header, TAG_BYTES};
use link_protocol::{PackageId, RoomLink};
use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, NONCE_LEN, Nonce, UnboundKey};
use ring::hmac;

/// How the lines begin: `SALT TIME MESSAGES PACKETS`; the salt in base64url, the time in Unix seconds, and the counters that were last used.
const SEAL_LINE: &str = "a=mon3tr-seal:";

const SALT_BYTES: usize = 16;

/// How far the clocks of a sender and a viewer may be apart, and how long after it was sent a recording could be shown, seconds.
const CLOCKS_APART: u64 = 300;

/// Packets of voice begin with their counter.
const COUNTER_BYTES: usize = 4;

/// What is sealed; the first byte of a nonce, for each kind is counted by itself.
#[derive(Clone, Copy)]
enum Kind {
    Message = 0,
    Voice = 1,
}

/// What the keys of a connection are derived from, besides a secret.
#[derive(Debug)]
struct Connection {
    room: RoomLink,
    avatar: PackageId,
    salt: String,
}

impl Connection {
    fn key(&self, secret: &[u8]) -> Result<LessSafeKey, CallError> {
        let secret = hmac::Key::new(hmac::HMAC_SHA256, secret);
        let text = format!("key\n{}", of_seal(&self.room, self.avatar, &self.salt));
        let key = hmac::sign(&secret, &Purpose::Seal.text(text.as_bytes()));
        let key = UnboundKey::new(&CHACHA20_POLY1305, key.as_ref());
        Ok(LessSafeKey::new(key.map_err(|_| CallError::NoLink)?))
    }

    /// That of the link's secret, by which keys are sealed.
    fn key_of_link(&self) -> Result<LessSafeKey, CallError> {
        let secret = self.room.secret().ok_or(CallError::NoLink)?;
        self.key(secret.bytes())
    }
}

/// The sender's end, for one forwarder.
pub(crate) struct Sealer {
    connection: Connection,
    /// By which keys are sealed.
    for_keys: LessSafeKey,
    epochs: Epochs,
    /// The epoch by whose key is sealed, and that key for this connection.
    sealing: Option<(u32, LessSafeKey)>,
    messages: u32,
    packets: u32,
}

impl std::fmt::Debug for Sealer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sealer").finish_non_exhaustive()
    }
}

impl Sealer {
    /// For a connection; nothing where the room's link has no secret, and so nobody could open.
    pub(crate) fn new(
        room: &RoomLink,
        avatar: PackageId,
        epochs: Epochs,
    ) -> Result<Option<Self>, CallError> {
        if room.secret().is_none() {
            return Ok(None);
        }
        let mut salt = [0; SALT_BYTES];
        getrandom::fill(&mut salt)?;
        let connection = Connection {
            room: room.clone(),
            avatar,
            salt: BASE64URL_NOPAD.encode(&salt),
        };
        Ok(Some(Self {
            for_keys: connection.key_of_link()?,
            connection,
            epochs,
            sealing: None,
            messages: 0,
            packets: 0,
        }))
    }

    /// The lines by which viewers find the key and see who seals. They hold for some minutes, and for what is sealed after them.
    pub(crate) fn lines(&self, own: Option<&Credentials>) -> String {
        let (messages, packets) = (self.messages, self.packets);
        let Connection { room, avatar, salt } = &self.connection;
        let seal = format!("{salt} {} {messages} {packets}", crate::now());
        let text = of_seal(room, *avatar, &seal);
        let lines = introduction::lines(own, room, Purpose::Seal, &text);
        format!("{SEAL_LINE}{seal}\r\n{lines}")
    }

    /// Writes `message` sealed into `out`, which is cleared first; whether that was possible.
    pub(crate) fn message(&mut self, session: u32, message: &[u8], out: &mut Vec<u8>) -> bool {
        let counter = next(&mut self.messages);
        let Some((counter, key)) = counter.zip(self.key_of_epoch()) else {
            return false;
        };
        seal(key, Header { session, counter }, message, out)
    }

    /// The same of a message of keys.
    pub(crate) fn keys(&mut self, session: u32, keys: &[u8], out: &mut Vec<u8>) -> bool {
        let counter = next(&mut self.messages);
        let key = &self.for_keys;
        counter.is_some_and(|counter| seal(key, Header { session, counter }, keys, out))
    }

    /// Whether there was a viewer who could open what is sealed.
    pub(crate) fn has_viewers(&self) -> bool {
        self.epochs.now().is_some()
    }

    fn key_of_epoch(&mut self) -> Option<&LessSafeKey> {
        let (epoch, key) = self.epochs.now()?;
        if self
            .sealing
            .as_ref()
            .is_none_or(|(sealing, _)| *sealing != epoch)
        {
            self.sealing = Some((epoch, self.connection.key(&key).ok()?));
        }
        self.sealing.as_ref().map(|(_, key)| key)
    }

    /// A packet of voice with this time stamp, sealed.
    pub(crate) fn voice(&mut self, timestamp: u32, opus: &[u8]) -> Option<Bytes> {
        let counter = next(&mut self.packets)?;
        let key = self.key_of_epoch()?;
        let mut packet = Vec::with_capacity(COUNTER_BYTES + opus.len() + TAG_BYTES);
        packet.extend(counter.to_le_bytes());
        packet.extend(opus);
        let nonce = nonce(Kind::Voice, counter);
        let aad = Aad::from(timestamp.to_le_bytes());
        let sealed = &mut packet[COUNTER_BYTES..];
        let tag = key.seal_in_place_separate_tag(nonce, aad, sealed);
        packet.extend(tag.ok()?.as_ref());
        Some(packet.into())
    }
}

/// Writes `message` sealed into `out`; whether that was possible.
fn seal(key: &LessSafeKey, header: Header, message: &[u8], out: &mut Vec<u8>) -> bool {
    let (nonce, header) = (nonce(Kind::Message, header.counter), header.bytes());
    out.clear();
    out.extend(header);
    out.extend(message);
    let sealed = &mut out[header.len()..];
    match key.seal_in_place_separate_tag(nonce, Aad::from(header), sealed) {
        Ok(tag) => {
            out.extend(tag.as_ref());
            true
        }
        Err(_) => false,
    }
}

/// A counter's next value; nothing once it has been through all of them, after two years.
fn next(counter: &mut u32) -> Option<u32> {
    *counter = counter.checked_add(1)?;
    Some(*counter)
}

/// What a seal's lines say, of a sender that is taken.
#[derive(Debug)]
pub(crate) struct Terms {
    connection: Connection,
    time: u64,
    messages: u32,
    packets: u32,
    sender: Option<PublicKey>,
}

impl Terms {
    /// The lines of a sender that `authentication` takes.
    pub(crate) fn read(
        authentication: &Authentication,
        room: &RoomLink,
        avatar: PackageId,
        lines: &str,
    ) -> Result<Self, CallError> {
        let seal = introduction::only(lines, SEAL_LINE)?.ok_or(CallError::NoLink)?;
        let text = of_seal(room, avatar, seal);
        let sender = authentication.check_sender(room, Purpose::Seal, &text, lines)?;
        let (salt, time, messages, packets) = parts(seal).ok_or(CallError::NoLink)?;
        let apart = crate::now().abs_diff(time);
        if apart > CLOCKS_APART {
            return Err(CallError::OldSeal { apart });
        }
        Ok(Self {
            connection: Connection {
                room: room.clone(),
                avatar,
                salt: salt.to_owned(),
            },
            time,
            messages,
            packets,
            sender,
        })
    }

    /// Who seals, where they say so.
    pub(crate) fn sender(&self) -> Option<PublicKey> {
        self.sender
    }
}

/// A viewer's end.
pub(crate) struct Opener {
    connection: Connection,
    /// By which keys are sealed.
    for_keys: LessSafeKey,
    /// The newest epochs, and their keys for this connection.
    opening: Vec<(u32, LessSafeKey)>,
    /// Of the newest lines, by the sender's clock.
    time: u64,
    messages: Replays,
    packets: Replays,
}

impl std::fmt::Debug for Opener {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Opener").finish_non_exhaustive()
    }
}

impl Opener {
    /// Opens what was sealed after these lines.
    pub(crate) fn new(terms: Terms) -> Result<Self, CallError> {
        Ok(Self {
            for_keys: terms.connection.key_of_link()?,
            connection: terms.connection,
            opening: Vec::new(),
            time: terms.time,
            messages: Replays::after(terms.messages),
            packets: Replays::after(terms.packets),
        })
    }

    /// Whether these lines are older than those that it has: whoever forwards could go back to what it recorded.
    pub(crate) fn is_newer_than(&self, terms: &Terms) -> bool {
        terms.time < self.time
    }

    /// Goes on with lines of the same seal; whether they are.
    pub(crate) fn renew(&mut self, terms: &Terms) -> bool {
        let is_same = terms.connection.salt == self.connection.salt;
        if is_same {
            self.time = self.time.max(terms.time);
        }
        is_same
    }

    /// What a sealed message of `session` is; nothing for any other.
    pub(crate) fn message(
        &mut self,
        keys: &mut ViewerKeys,
        session: u32,
        sealed: &[u8],
    ) -> Option<Opened> {
        let (header, rest) = Header::read(sealed).filter(|(it, _)| it.session == session)?;
        let (counter, aad) = (header.counter, header.bytes());
        let nonce = || nonce(Kind::Message, counter);
        if let Some(message) = self.open_by(keys, nonce, &aad, rest) {
            let is_new = self.messages.is_new(counter);
            return is_new.then_some(Opened::Message(message));
        }
        match self.open(&self.for_keys, nonce(), &aad, rest) {
            // Of no account for the counters: whoever has the link's secret can write one.
            Some(message) => {
                let for_us = keys.read_message(&message);
                Some(Opened::Keys { for_us })
            }
            None => Some(Opened::Nothing),
        }
    }

    /// A packet of voice as it was said.
    pub(crate) fn voice(&mut self, keys: &ViewerKeys, packet: &VoicePacket) -> Option<VoicePacket> {
        let (counter, rest) = packet.opus.split_first_chunk()?;
        let counter = u32::from_le_bytes(*counter);
        let nonce = || nonce(Kind::Voice, counter);
        let opus = self.open_by(keys, nonce, &packet.timestamp.to_le_bytes(), rest)?;
        self.packets.is_new(counter).then(|| VoicePacket {
            timestamp: packet.timestamp,
            opus: opus.into(),
        })
    }

    /// By the first of the newest keys that opens it.
    fn open_by(
        &mut self,
        keys: &ViewerKeys,
        nonce: impl Fn() -> Nonce,
        aad: &[u8],
        sealed: &[u8],
    ) -> Option<Vec<u8>> {
        let newest = keys.newest().first().map(|(epoch, _)| epoch);
        if newest != self.opening.first().map(|(epoch, _)| epoch) {
            let derived =
                |(epoch, key): &(u32, EpochKey)| Some((*epoch, self.connection.key(key).ok()?));
            self.opening = keys.newest().iter().filter_map(derived).collect();
        }
        let mut opened = (self.opening.iter()).map(|(_, key)| self.open(key, nonce(), aad, sealed));
        opened.find_map(|opened| opened)
    }

    fn open(&self, key: &LessSafeKey, nonce: Nonce, aad: &[u8], sealed: &[u8]) -> Option<Vec<u8>> {
        // What was held back is of no use either.
        if crate::now().abs_diff(self.time) > CLOCKS_APART {
            return None;
        }
        let mut bytes = sealed.to_vec();
        let opened = key.open_in_place(nonce, Aad::from(aad), &mut bytes);
        let length = opened.ok()?.len();
        bytes.truncate(length);
        Some(bytes)
    }
}

/// What a sealed message is.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Opened {
    /// This one.
    Message(Vec<u8>),
    /// Keys, of this viewer among them or of others alone.
    Keys { for_us: bool },
    /// One that someone changed, or that is sealed by a key which this viewer does not know.
    Nothing,
}

/// Which counters have come: the newest, and a bit for each of the 64 before it (as RFC 3711, section 3.3.2).
#[derive(Debug, Default)]
struct Replays {
    newest: u32,
    before: u64,
}

impl Replays {
    /// All up to this one have come.
    fn after(newest: u32) -> Self {
        Self {
            newest,
            before: u64::MAX,
        }
    }

    /// Whether this one has not come yet and is not far older than the newest.
    fn is_new(&mut self, counter: u32) -> bool {
        if counter > self.newest {
            let ahead = counter - self.newest;
            // The newest itself becomes one of those before.
            let shifted = self.before.checked_shl(ahead).unwrap_or(0);
            self.before = shifted | 1u64.checked_shl(ahead - 1).unwrap_or(0);
            self.newest = counter;
            return true;
        }
        let behind = self.newest - counter;
        let Some(bit) = behind.checked_sub(1).and_then(|at| 1u64.checked_shl(at)) else {
            return false;
        };
        let is_new = self.before & bit == 0;
        self.before |= bit;
        is_new
    }
}

/// Salt, time and counters of a seal.
fn parts(seal: &str) -> Option<(&str, u64, u32, u32)> {
    let mut parts = seal.split(' ');
    let salt = parts.next()?;
    let is_salt = salt.len() == BASE64URL_NOPAD.encode_len(SALT_BYTES);
    let (time, messages, packets) = (parts.next()?, parts.next()?, parts.next()?);
    let is_all = parts.next().is_none();
    (is_salt && is_all).then_some((
        salt,
        time.parse().ok()?,
        messages.parse().ok()?,
        packets.parse().ok()?,
    ))
}

/// What is signed.
fn of_seal(room: &RoomLink, avatar: PackageId, seal: &str) -> String {
    format!("{}\n{avatar}\n{seal}", room.room())
}

/// The kind, seven zeros, the counter.
fn nonce(kind: Kind, counter: u32) -> Nonce {
    let mut nonce = [0; NONCE_LEN];
    nonce[0] = kind as u8;
    nonce[NONCE_LEN - COUNTER_BYTES..].copy_from_slice(&counter.to_le_bytes());
    Nonce::assume_unique_for_key(nonce)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::epochs::tests::comes;
    use identity::Identity;
    use link_protocol::LinkSecret;

    fn room(name: &str, secret: u8) -> RoomLink {
        let server = "http://127.0.0.1:1".parse().expect("an address");
        let room = RoomLink::of(server, name, "token").expect("a room");
        room.with_secret(LinkSecret::new([secret; 16]))
    }

    fn avatar(digit: &str) -> PackageId {
        digit.repeat(64).parse().expect("a hash")
    }

    fn identity(seed: u8) -> Identity {
        Identity::from_seed(&[seed; 32]).expect("a key")
    }

    /// A sender, the lines of its seal, and a viewer.
    fn three(own: Option<&Credentials>) -> (Sealer, String, ViewerKeys) {
        let epochs = Epochs::default();
        let keys = comes(&epochs, 1, &room("r1", 1), avatar("a"));
        let sealer = Sealer::new(&room("r1", 1), avatar("a"), epochs);
        let sealer = sealer.expect("random").expect("a secret");
        let lines = sealer.lines(own);
        (sealer, lines, keys)
    }

    fn terms(lines: &str) -> Terms {
        let everyone = Authentication::default();
        Terms::read(&everyone, &room("r1", 1), avatar("a"), lines).expect("the seal")
    }

    fn opener(lines: &str) -> Opener {
        Opener::new(terms(lines)).expect("a key")
    }

    fn opened(text: &[u8]) -> Option<Opened> {
        Some(Opened::Message(text.to_vec()))
    }

    #[test]
    fn what_is_sealed_is_opened_once_and_by_none_without_the_link() {
        let (mut sealer, lines, mut keys) = three(None);
        let mut opener = opener(&lines);
        let mut open = |session, sealed: &[u8]| opener.message(&mut keys, session, sealed);
        let mut sealed = Vec::new();
        assert!(sealer.message(5, b"a frame", &mut sealed));
        assert!(!sealed.windows(7).any(|part| part == b"a frame"));
        assert_eq!(open(6, &sealed), None, "another session");
        assert_eq!(open(5, &sealed), opened(b"a frame"));
        assert_eq!(open(5, &sealed), None, "it comes again");
        let mut second = Vec::new();
        assert!(sealer.message(5, b"a frame", &mut second));
        assert_ne!(sealed[9..], second[9..]);
        for at in 0..second.len() {
            let mut changed = second.clone();
            changed[at] ^= 1;
            let changed = open(5, &changed);
            assert!(matches!(changed, None | Some(Opened::Nothing)), "byte {at}");
        }
        assert_eq!(open(5, &second), opened(b"a frame"));
        // Of what is sealed by the link's secret, keys are taken, and nothing else.
        assert!(sealer.keys(5, b"a frame", &mut second));
        assert_eq!(open(5, &second), Some(Opened::Keys { for_us: false }));
        let (mut other, other_lines, mut others_keys) = three(None);
        let mut without = Opener::new(terms(&lines)).expect("a key");
        assert!(other.message(5, b"a frame", &mut second));
        assert_eq!(open(5, &second), Some(Opened::Nothing), "another sender's");
        assert!(opener.renew(&terms(&sealer.lines(None))), "told again");
        assert!(!opener.renew(&terms(&other_lines)), "another connection");
        assert!(sealer.message(5, b"a frame", &mut second));
        assert_eq!(
            without.message(&mut others_keys, 5, &second),
            Some(Opened::Nothing),
            "the link and the seal without the epoch's key"
        );
        let everyone = Authentication::default();
        for (room, avatar) in [
            (room("r1", 2), avatar("a")),
            (room("r2", 1), avatar("a")),
            (room("r1", 1), avatar("b")),
        ] {
            let refused = Terms::read(&everyone, &room, avatar, &lines);
            assert!(matches!(refused, Err(CallError::NoLink)), "{refused:?}");
        }
    }

    #[test]
    fn nothing_is_sealed_before_there_is_a_viewer() {
        let sealer = Sealer::new(&room("r1", 1), avatar("a"), Epochs::default());
        let mut sealer = sealer.expect("random").expect("a secret");
        assert!(!sealer.has_viewers());
        assert!(!sealer.message(5, b"a frame", &mut Vec::new()));
        assert_eq!(sealer.voice(960, b"opus"), None);
    }

    #[test]
    fn a_voice_is_sealed_with_its_time() {
        let (mut sealer, lines, keys) = three(None);
        let mut opener = opener(&lines);
        let opus = sealer.voice(960, b"opus").expect("sealed");
        let packet = VoicePacket {
            timestamp: 960,
            opus,
        };
        let moved = VoicePacket {
            timestamp: 1920,
            ..packet.clone()
        };
        assert!(opener.voice(&keys, &moved).is_none(), "at another time");
        let heard = opener.voice(&keys, &packet).expect("as it was said");
        assert_eq!((heard.timestamp, &*heard.opus), (960, &b"opus"[..]));
        assert!(opener.voice(&keys, &packet).is_none(), "it comes again");
        let plain = VoicePacket {
            timestamp: 960,
            opus: Bytes::from_static(b"opu"),
        };
        assert!(opener.voice(&keys, &plain).is_none(), "not sealed");
    }

    #[test]
    fn a_seal_shows_who_seals_and_is_not_of_yesterday() {
        let owner = Credentials::new(identity(1));
        let (sealer, lines, _) = three(Some(&owner));
        let check = |lines: &str, expected: u8, signer| {
            let authentication = Authentication { own: None, signer };
            let room = room("r1", 1).with_key(identity(expected).public().hash());
            Terms::read(&authentication, &room, avatar("a"), lines).map(|terms| terms.sender())
        };
        let sender = check(&lines, 1, Some(identity(1).public())).expect("the owner");
        assert_eq!(sender, Some(identity(1).public()));
        let wrong = check(&lines, 2, None);
        assert!(
            matches!(wrong, Err(CallError::WrongKey { .. })),
            "{wrong:?}"
        );
        let wrong = check(&lines, 1, Some(identity(2).public()));
        assert!(
            matches!(wrong, Err(CallError::NotTheirAvatar { .. })),
            "{wrong:?}"
        );
        let unsigned = check(&sealer.lines(None), 1, None);
        assert!(matches!(unsigned, Err(CallError::NoKey)), "{unsigned:?}");
        // What was recorded long ago, and the same with another time.
        let recorded = crate::now() - CLOCKS_APART - 5;
        let Connection { room, avatar, salt } = &sealer.connection;
        let seal = format!("{salt} {recorded} 0 0");
        let text = of_seal(room, *avatar, &seal);
        let shown = introduction::lines(Some(&owner), room, Purpose::Seal, &text);
        let old = check(&format!("{SEAL_LINE}{seal}\r\n{shown}"), 1, None);
        assert!(matches!(old, Err(CallError::OldSeal { .. })), "{old:?}");
        let renewed = format!("{SEAL_LINE}{salt} {}\r\n{shown}", crate::now());
        let renewed = check(&renewed, 1, None);
        assert!(matches!(renewed, Err(CallError::NoLink)), "{renewed:?}");
    }

    #[test]
    fn what_was_recorded_is_not_shown_to_who_comes_later() {
        let (mut sealer, first_lines, mut keys) = three(None);
        let mut recorded = Vec::new();
        assert!(sealer.message(5, b"said in confidence", &mut recorded));
        let spoken = sealer.voice(960, b"opus").expect("sealed");
        // Who is there from the beginning opens both; who comes later, by the lines of then, neither, and what follows,
        // also in the same epoch.
        let mut early = opener(&first_lines);
        let first = early.message(&mut keys, 5, &recorded);
        assert_eq!(first, opened(b"said in confidence"));
        let mut late = opener(&sealer.lines(None));
        assert_eq!(late.message(&mut keys, 5, &recorded), None);
        let packet = VoicePacket {
            timestamp: 960,
            opus: spoken,
        };
        assert!(late.voice(&keys, &packet).is_none());
        let mut next = Vec::new();
        assert!(sealer.message(5, b"for all", &mut next));
        assert_eq!(late.message(&mut keys, 5, &next), opened(b"for all"));
        // Nor is anyone led back to a seal before.
        let mut before = terms(&first_lines);
        before.time -= 1;
        assert!(late.is_newer_than(&before));
        // What is held back until the lines are old is not opened.
        let mut held = Vec::new();
        assert!(sealer.message(5, b"held back", &mut held));
        late.time -= CLOCKS_APART + 5;
        assert_eq!(late.message(&mut keys, 5, &held), Some(Opened::Nothing));
    }

    #[test]
    fn a_counter_is_taken_once_in_any_order_and_not_from_long_ago() {
        let mut replays = Replays::default();
        let mut seen = std::collections::HashSet::new();
        let mut random = fastrand::Rng::with_seed(3);
        for at in 1..20_000u32 {
            let counter = (at + 30).saturating_sub(random.u32(0..60)).max(1);
            let is_new = replays.is_new(counter);
            assert_eq!(is_new, seen.insert(counter), "{counter} at {at}");
        }
        assert!(replays.is_new(30_000), "far ahead");
        assert!(!replays.is_new(29_935), "too long ago to be known");
        assert!(replays.is_new(29_936));
        assert!(!replays.is_new(0), "which none has");
    }
}
