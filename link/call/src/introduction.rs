//! Who a side is, in lines of its offer or answer about the fingerprints of its DTLS certificate: that it has the link, by a MAC with the link's secret, and which
//! key it has, by a signature. A server, or any other program that the SDP passes, can put no certificate of its own there.
//!
//! A sender says so for one room, one avatar and one viewer's offer; so what one viewer got is of no use towards another. Lines that a program does not
//! know are passed over (RFC 8866, section 5.13).

use crate::sdp::{self, Description, Shown};
use crate::visitor::Visitor;
use crate::{CallError, guests, now, proof};
use data_encoding::BASE64URL_NOPAD;
use identity::{Identity, IdentityError, Keyring, Permit, PublicKey, Purpose, Signature};
use link_protocol::{
    Guest, GuestPass, Name, PackageId, PersonName, Refusal, RoomLink, sdp::with_session_lines,
    sealed,
};

/// How the lines begin: the MAC; `KEY SIGNATURE`; a permit as its text has it; and `NAME SIGNATURE`, the name in
/// base64url.
const LINK_LINE: &str = "a=mon3tr-link:";
const KEY_LINE: &str = "a=mon3tr-key:";
const PERMIT_LINE: &str = "a=mon3tr-permit:";
const NAME_LINE: &str = "a=mon3tr-name:";

/// What the MAC's secret is of.
const OF_LINK: &str = "link";

/// The line of a server's forwarder in an answer: it has nothing to show, and what it hands on is sealed.
const FORWARDER_LINE: &str = "a=mon3tr-forwarder";

/// One's own key, with which a side introduces itself.
#[derive(Debug, Clone)]
pub struct Credentials {
    identity: Identity,
    permit: Option<Permit>,
    /// What this side is called.
    name: Option<PersonName>,
}

impl Credentials {
    /// This key, for what drives no avatar or one that nobody signed.
    #[must_use]
    pub fn new(identity: Identity) -> Self {
        Self {
            identity,
            permit: None,
            name: None,
        }
    }

    /// The same key of a person who is called so: those who meet them read it, signed by the key.
    #[must_use]
    pub fn named(self, name: Option<PersonName>) -> Self {
        Self { name, ..self }
    }

    /// This key, to drive an avatar with this signer; of `permits` one is taken, where the signer is another.
    ///
    /// # Errors
    /// [`CallError::NotTheirAvatar`] if there is none that holds.
    pub fn for_avatar(
        identity: Identity,
        signer: Option<PublicKey>,
        permits: &[Permit],
    ) -> Result<Self, CallError> {
        let key = identity.public();
        let permit = holding(permits, key).find(|permit| Some(permit.owner()) == signer);
        let introduced = Introduced {
            key,
            permit,
            name: None,
        };
        introduced.check_avatar(signer)?;
        Ok(Self {
            permit,
            ..Self::new(identity)
        })
    }

    /// This key, to forward what the key `sender` sends, if it is known: one of `permits` may let this side show its avatar. It is the sender's own, where
    /// there is one; a sender that is a forwarder itself has none to give.
    pub(crate) fn of_forwarder(
        keys: &Keyring,
        permits: &[Permit],
        sender: Option<PublicKey>,
    ) -> Self {
        let identity = keys.identity().clone();
        let mut holding = holding(permits, identity.public());
        let theirs = holding
            .clone()
            .find(|permit| Some(permit.owner()) == sender);
        let permit = theirs.or_else(|| holding.next());
        Self {
            permit,
            ..Self::new(identity)
        }
    }

    /// One's own key.
    #[must_use]
    pub fn key(&self) -> PublicKey {
        self.identity.public()
    }

    /// What the link of `guest` to a room of this sender has of them.
    #[must_use]
    pub fn pass(&self, room: &Name, guest: Guest) -> GuestPass {
        guests::pass(&self.identity, room, guest)
    }

    /// The lines of this key.
    fn lines(&self, purpose: Purpose, text: &str) -> String {
        let signed = self.identity.sign_as_text(purpose, text.as_bytes());
        let mut lines = format!("{KEY_LINE}{signed}\r\n");
        let drives = matches!(purpose, Purpose::Sender | Purpose::Seal | Purpose::Exchange);
        if let Some(permit) = self.permit.filter(|_| drives) {
            lines.push_str(&format!("{PERMIT_LINE}{permit}\r\n"));
        }
        if let Some(name) = self.name.as_ref().filter(|_| purpose == Purpose::Sender) {
            let signature = self
                .identity
                .sign(Purpose::Name, of_name(text, name).as_bytes());
            let name = BASE64URL_NOPAD.encode(name.as_str().as_bytes());
            lines.push_str(&format!("{NAME_LINE}{name} {signature}\r\n"));
        }
        lines
    }
}

/// Those of `permits` that are for `key` and hold now.
fn holding(permits: &[Permit], key: PublicKey) -> impl Iterator<Item = Permit> + Clone {
    let holds = move |permit: &Permit| permit.key() == key && permit.check(now()).is_ok();
    permits.iter().copied().filter(holds)
}

/// The sender's answer to `offer`, in which it shows its key, if it has one to show, and that it has the link.
pub(crate) fn introduce_sender(
    own: Option<&Credentials>,
    room: &RoomLink,
    avatar: PackageId,
    offer: &Description,
    answer: &str,
) -> Result<String, CallError> {
    let text = of_sender(room.room(), avatar, offer, &Description::read(answer)?)?;
    Ok(introduce(own, room, Purpose::Sender, &text, answer))
}

/// The answer of a server's forwarder, which has neither key nor link.
pub(crate) fn introduce_forwarder(answer: &str) -> String {
    with_session_lines(answer, &[FORWARDER_LINE, "\r\n"])
}

/// What a sender shows of itself in `text`, which is none of a connection.
pub(crate) fn lines(
    own: Option<&Credentials>,
    room: &RoomLink,
    purpose: Purpose,
    text: &str,
) -> String {
    introduce(own, room, purpose, text, "")
}

/// `sdp` with what a side shows of itself.
fn introduce(
    own: Option<&Credentials>,
    room: &RoomLink,
    purpose: Purpose,
    text: &str,
    sdp: &str,
) -> String {
    let link = room.secret().map(|secret| {
        let mac = proof::prove(secret, purpose, OF_LINK, text);
        format!("{LINK_LINE}{mac}\r\n")
    });
    let key = own.map(|own| own.lines(purpose, text));
    let [link, key] = [link, key].map(Option::unwrap_or_default);
    with_session_lines(sdp, &[&link, &key])
}

/// Whether a server's forwarder may serve the room's viewers. Without a secret nothing can be sealed. People in a call
/// are met directly: all of them have the secret, so one of them who works together with the server could be any other
/// behind a forwarder.
pub(crate) fn may_be_handed_over(room: &RoomLink) -> bool {
    room.secret().is_some() && !room.is_seat()
}

/// The offer of a viewer that may be handed over, before it is signed.
pub(crate) fn with_exchange(offer: &str, exchange: &str) -> String {
    with_session_lines(offer, &[sealed::EXCHANGE_LINE, exchange, "\r\n"])
}

/// Checks that the side which shows this has the room's link, where the link has a secret.
fn check_link(
    room: &RoomLink,
    purpose: Purpose,
    text: &str,
    shown: &Shown,
) -> Result<(), CallError> {
    let Some(secret) = room.secret() else {
        return Ok(());
    };
    let mac = shown.link.as_ref().ok_or(CallError::NoLink)?;
    proof::check(secret, purpose, OF_LINK, text, mac)
}

/// Which side answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Answered {
    /// The sender itself, with its key, where it says so, and the name that it signed with it.
    Sender(Option<PublicKey>, Option<PersonName>),
    /// The server's forwarder, which need not be believed: what it hands on is sealed.
    Forwarder,
}

/// What a viewer shows the sender, and which sender it takes: the one whose key the room's link tells, if it does, and one who may drive the
/// avatar.
#[derive(Debug, Clone, Default)]
pub struct Authentication {
    /// One's own key, to be shown.
    pub own: Option<Credentials>,
    /// Who signed the avatar: only they drive it, and whom they permit.
    pub signer: Option<PublicKey>,
}

impl Authentication {
    /// The offer, in which this side shows its own key, if it has one to show, and that it has the link.
    pub(crate) fn introduce(&self, room: &RoomLink, offer: &str) -> Result<String, CallError> {
        let text = of_viewer(room.room(), &Description::read(offer)?)?;
        let own = self.own.as_ref();
        let introduced = introduce(own, room, Purpose::Viewer, &text, offer);
        Ok(with_session_lines(
            &introduced,
            &[&guests::line(room, &text)],
        ))
    }

    /// Takes the side that answered this side's offer, or does not.
    pub(crate) fn check(
        &self,
        room: &RoomLink,
        avatar: PackageId,
        offer: &str,
        answer: &Description,
    ) -> Result<Answered, CallError> {
        match answer.refusal {
            Some(Refusal::Full | Refusal::Many) => return Err(CallError::TooManyViewers),
            Some(refusal) => return Err(CallError::Refused(refusal)),
            None => {}
        }
        if answer.is_of_forwarder {
            let may_be = may_be_handed_over(room);
            let answered = may_be.then_some(Answered::Forwarder);
            return answered.ok_or(CallError::TooManyViewers);
        }
        let text = of_sender(room.room(), avatar, &Description::read(offer)?, answer)?;
        let sender = self.take_sender(room, Purpose::Sender, &text, &answer.shown)?;
        Ok(match sender {
            Some(Introduced { key, name, .. }) => Answered::Sender(Some(key), name),
            None => Answered::Sender(None, None),
        })
    }

    /// Takes the sender that shows `lines` for `text`, or does not. Who it is, where it says so.
    pub(crate) fn check_sender(
        &self,
        room: &RoomLink,
        purpose: Purpose,
        text: &str,
        lines: &str,
    ) -> Result<Option<PublicKey>, CallError> {
        let sender = self.take_sender(room, purpose, text, &Shown::read(lines)?)?;
        Ok(sender.map(|sender| sender.key))
    }

    /// As [`Self::check`], of the half of the agreement on keys that the sender sends by a forwarder's answer; what the
    /// sender says, of which `signed` makes what it signs.
    pub(crate) fn check_exchange<'a>(
        &self,
        room: &RoomLink,
        answer: &'a Description,
        signed: impl FnOnce(&str) -> String,
    ) -> Result<&'a str, CallError> {
        let said = answer.shown.exchange.as_deref();
        let said = said.ok_or(CallError::NoExchange)?;
        self.take_sender(room, Purpose::Exchange, &signed(said), &answer.shown)?;
        Ok(said)
    }

    fn take_sender(
        &self,
        room: &RoomLink,
        purpose: Purpose,
        text: &str,
        shown: &Shown,
    ) -> Result<Option<Introduced>, CallError> {
        check_link(room, purpose, text, shown)?;
        let sender = Introduced::read(shown, purpose, text)?;
        if let Some(expected) = room.key() {
            match &sender {
                None => return Err(CallError::NoKey),
                Some(sender) if sender.key.hash() != expected => {
                    let found = sender.key.fingerprint();
                    return Err(CallError::WrongKey { found });
                }
                Some(_) => {}
            }
        }
        match &sender {
            Some(sender) => sender.check_avatar(self.signer)?,
            None if self.signer.is_some() => return Err(CallError::NoKey),
            None => {}
        }
        Ok(sender)
    }
}

/// Takes the viewer who made `offer` and has the room's link. Who it is, as far as it says so, and its offer as it was
/// read.
pub(crate) fn check_viewer(
    own: Option<&Credentials>,
    room: &RoomLink,
    offer: &str,
) -> Result<(Visitor, Description), CallError> {
    let offer = Description::read(offer)?;
    // One of which no connection can be made is answered before anything is spent on it.
    offer.write(&[])?;
    let text = of_viewer(room.room(), &offer)?;
    check_link(room, Purpose::Viewer, &text, &offer.shown)?;
    let viewer = Introduced::read(&offer.shown, Purpose::Viewer, &text)?;
    let own = own.map(|own| &own.identity);
    let visitor = Visitor {
        key: viewer.map(|viewer| viewer.key),
        guest: guests::read(own, room, &text, offer.shown.guest.as_deref())?,
    };
    Ok((visitor, offer))
}

/// A side that has proved which key it has.
struct Introduced {
    key: PublicKey,
    permit: Option<Permit>,
    name: Option<PersonName>,
}

impl Introduced {
    /// The side that shows this, and signed `text`.
    fn read(shown: &Shown, purpose: Purpose, text: &str) -> Result<Option<Self>, CallError> {
        let Some(signed) = &shown.key else {
            return Ok(None);
        };
        let key = PublicKey::of_signed(signed, purpose, text.as_bytes())?;
        let permit = shown
            .permit
            .as_deref()
            .map(str::parse::<Permit>)
            .transpose()?;
        let name = match &shown.name {
            Some(signed) => Some(read_name(signed, key, text)?),
            None => None,
        };
        Ok(Some(Self { key, permit, name }))
    }

    /// Whether it may drive an avatar with this signer.
    fn check_avatar(&self, signer: Option<PublicKey>) -> Result<(), CallError> {
        let Some(signer) = signer.filter(|signer| *signer != self.key) else {
            return Ok(());
        };
        let refused = |why| CallError::NotTheirAvatar {
            owner: signer.fingerprint(),
            driver: self.key.fingerprint(),
            why,
        };
        let mine = |permit: &Permit| permit.owner() == signer && permit.key() == self.key;
        let permit = self.permit.filter(mine).ok_or_else(|| refused(None))?;
        permit.check(now()).map_err(|why| refused(Some(why)))
    }
}

/// The name in `NAME SIGNATURE`, which this key has signed with `text`.
fn read_name(signed: &str, key: PublicKey, text: &str) -> Result<PersonName, CallError> {
    let malformed = IdentityError::Malformed("a name and its signature");
    let read = |signed: &str| {
        let (name, signature) = signed.split_once(' ')?;
        let name = String::from_utf8(BASE64URL_NOPAD.decode(name.as_bytes()).ok()?).ok()?;
        Some((name.parse().ok()?, signature.parse().ok()?))
    };
    let (name, signature): (PersonName, Signature) = read(signed).ok_or(malformed)?;
    key.verify(Purpose::Name, of_name(text, &name).as_bytes(), &signature)?;
    Ok(name)
}

/// What a sender signs.
fn of_sender(
    room: &Name,
    avatar: PackageId,
    offer: &Description,
    answer: &Description,
) -> Result<String, CallError> {
    let [theirs, own] = [offer.fingerprints()?, answer.fingerprints()?];
    Ok(format!("{room}\n{avatar}\n{own}\n{theirs}"))
}

/// What a viewer signs.
fn of_viewer(room: &Name, offer: &Description) -> Result<String, CallError> {
    let mut text = format!("{room}\n{}", offer.fingerprints()?);
    if let Some(exchange) = &offer.shown.exchange {
        text.push('\n');
        text.push_str(exchange);
    }
    Ok(text)
}

/// What a sender with this name signs besides, of the same connection.
fn of_name(text: &str, name: &PersonName) -> String {
    format!("{text}\n{name}")
}

/// The value of the one line of `lines` that begins with `a=HEAD:`, given as such.
pub(crate) fn only<'a>(lines: &'a str, head: &str) -> Result<Option<&'a str>, CallError> {
    let name = head.trim_start_matches("a=").trim_end_matches(':');
    Ok(sdp::only(lines, name)?)
}

#[cfg(test)]
mod tests;
