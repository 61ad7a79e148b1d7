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

/// The result of sealing a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sealing {
    Sealed,
    /// No viewer has been handed over yet, so that no key exists.
    NoViewer,
    /// The counter is at its end, or the cipher failed.
    Failed,
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

    /// Writes `message` sealed into `out`, which is cleared first.
    pub(crate) fn message(&mut self, session: u32, message: &[u8], out: &mut Vec<u8>) -> Sealing {
        let Some((epoch, key)) = self.epochs.now() else {
            return Sealing::NoViewer;
        };
        let counter = next(&mut self.messages);
        let Some((counter, key)) = counter.zip(self.key_of(epoch, &key)) else {
            return Sealing::Failed;
        };
        if seal(key, Header { session, counter }, message, out) {
            Sealing::Sealed
        } else {
            Sealing::Failed
        }
    }

    /// The same of a message of keys.
    pub(crate) fn keys(&mut self, session: u32, keys: &[u8], out: &mut Vec<u8>) -> bool {
        let counter = next(&mut self.messages);
        let key = &self.for_keys;
        counter.is_some_and(|counter| seal(key, Header { session, counter }, keys, out))
    }

    /// The key that this connection uses in `epoch`.
    fn key_of(&mut self, epoch: u32, key: &EpochKey) -> Option<&LessSafeKey> {
        let known = self.sealing.as_ref();
        if known.is_none_or(|(known, _)| *known != epoch) {
            self.sealing = Some((epoch, self.connection.key(key).ok()?));
        }
        self.sealing.as_ref().map(|(_, key)| key)
    }

    /// A packet of voice with this time stamp, sealed.
    pub(crate) fn voice(&mut self, timestamp: u32, opus: &[u8]) -> Option<Bytes> {
        let (epoch, key) = self.epochs.now()?;
        let counter = next(&mut self.packets)?;
        let key = self.key_of(epoch, &key)?;
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
mod tests;
