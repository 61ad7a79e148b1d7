//! Who a side is, in lines of its offer or answer about the fingerprints of its DTLS certificate: that it has the link, by a MAC with the link's secret, and which
//! key it has, by a signature. A server, or any other program that the SDP passes, can put no certificate of its own there.
//!
//! A sender says so for one room, one avatar and one viewer's offer; so what one viewer got is of no use towards another. Lines that a program does not
//! know are passed over (RFC 8866, section 5.13).

use crate::visitor::Visitor;
use crate::{CallError, guests, now, proof};
use identity::{Identity, IdentityError, Keyring, Permit, PublicKey, Purpose};
use link_protocol::{Guest, GuestPass, Name, PackageId, Refusal, RoomLink};

/// How the lines begin: the MAC; `KEY SIGNATURE`; and a permit as its text has it.
const LINK_LINE: &str = "a=mon3tr-link:";
const KEY_LINE: &str = "a=mon3tr-key:";
const PERMIT_LINE: &str = "a=mon3tr-permit:";

/// What the MAC's secret is of.
const OF_LINK: &str = "link";

/// The line of a server's forwarder in an answer: it has nothing to show, and what it hands on is sealed.
const FORWARDER_LINE: &str = "a=mon3tr-forwarder";

/// Certificates of one side, at most; WebRTC has one.
const MOST_FINGERPRINTS: usize = 4;

/// One's own key, with which a side introduces itself.
#[derive(Debug, Clone)]
pub struct Credentials {
    identity: Identity,
    permit: Option<Permit>,
}

impl Credentials {
    /// This key, for what drives no avatar or one that nobody signed.
    #[must_use]
    pub fn new(identity: Identity) -> Self {
        Self {
            identity,
            permit: None,
        }
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
        Introduced { key, permit }.check_avatar(signer)?;
        Ok(Self { identity, permit })
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
        Self { identity, permit }
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
        let key = format!("{KEY_LINE}{signed}\r\n");
        match self.permit.filter(|_| purpose != Purpose::Viewer) {
            Some(permit) => format!("{key}{PERMIT_LINE}{permit}\r\n"),
            None => key,
        }
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
    offer: &str,
    answer: &str,
) -> Result<String, CallError> {
    let text = of_sender(room.room(), avatar, offer, answer)?;
    Ok(introduce(own, room, Purpose::Sender, &text, answer))
}

/// The answer of a server's forwarder, which has neither key nor link.
pub(crate) fn introduce_forwarder(answer: &str) -> String {
    before_media(answer, &[FORWARDER_LINE, "\r\n"])
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
    before_media(sdp, &[&link, &key])
}

/// `sdp` with lines of the whole session: before its first medium.
fn before_media(sdp: &str, lines: &[&str]) -> String {
    let media = sdp.find("\nm=").map_or(sdp.len(), |at| at + 1);
    let (session, media) = sdp.split_at(media);
    [&[session], lines, &[media]].concat().concat()
}

/// Checks that the side which wrote `sdp` has the room's link, where the link has a secret.
fn check_link(room: &RoomLink, purpose: Purpose, text: &str, sdp: &str) -> Result<(), CallError> {
    let Some(secret) = room.secret() else {
        return Ok(());
    };
    let mac = only(sdp, LINK_LINE)?.ok_or(CallError::NoLink)?;
    proof::check(secret, purpose, OF_LINK, text, mac)
}

/// Which side answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answered {
    /// The sender itself, with its key, where it says so.
    Sender(Option<PublicKey>),
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
        let text = of_viewer(room.room(), offer)?;
        let own = self.own.as_ref();
        let introduced = introduce(own, room, Purpose::Viewer, &text, offer);
        Ok(before_media(&introduced, &[&guests::line(room, &text)]))
    }

    /// Takes the side that answered, or does not.
    pub(crate) fn check(
        &self,
        room: &RoomLink,
        avatar: PackageId,
        offer: &str,
        answer: &str,
    ) -> Result<Answered, CallError> {
        match Refusal::read(answer) {
            Some(Refusal::Full | Refusal::Many) => return Err(CallError::TooManyViewers),
            Some(refusal) => return Err(CallError::Refused(refusal)),
            None => {}
        }
        if only(answer, FORWARDER_LINE)?.is_some() {
            // Without a secret nothing can be sealed. People in a call are met directly: all of them have the secret, so one of them who works together
            // with the server could be any other behind a forwarder.
            return match room.secret() {
                Some(_) if !room.is_seat() => Ok(Answered::Forwarder),
                _ => Err(CallError::TooManyViewers),
            };
        }
        let text = of_sender(room.room(), avatar, offer, answer)?;
        let sender = self.check_sender(room, Purpose::Sender, &text, answer)?;
        Ok(Answered::Sender(sender))
    }

    /// Takes the sender that shows `lines` for `text`, or does not. Who it is, where it says so.
    pub(crate) fn check_sender(
        &self,
        room: &RoomLink,
        purpose: Purpose,
        text: &str,
        lines: &str,
    ) -> Result<Option<PublicKey>, CallError> {
        check_link(room, purpose, text, lines)?;
        let sender = Introduced::read(lines, purpose, text)?;
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
        Ok(sender.map(|sender| sender.key))
    }
}

/// Takes the viewer who made `offer` and has the room's link. Who it is, as far as it says so.
pub(crate) fn check_viewer(
    own: Option<&Credentials>,
    room: &RoomLink,
    offer: &str,
) -> Result<Visitor, CallError> {
    let text = of_viewer(room.room(), offer)?;
    check_link(room, Purpose::Viewer, &text, offer)?;
    let viewer = Introduced::read(offer, Purpose::Viewer, &text)?;
    let own = own.map(|own| &own.identity);
    Ok(Visitor {
        key: viewer.map(|viewer| viewer.key),
        guest: guests::read(own, room, &text, only(offer, guests::LINE)?)?,
    })
}

/// A side that has proved which key it has.
struct Introduced {
    key: PublicKey,
    permit: Option<Permit>,
}

impl Introduced {
    /// The side that wrote `sdp`, which signed `text`.
    fn read(sdp: &str, purpose: Purpose, text: &str) -> Result<Option<Self>, CallError> {
        let Some(line) = only(sdp, KEY_LINE)? else {
            return Ok(None);
        };
        let key = PublicKey::of_signed(line, purpose, text.as_bytes())?;
        let permit = only(sdp, PERMIT_LINE)?;
        let permit = permit.map(str::parse::<Permit>).transpose()?;
        Ok(Some(Self { key, permit }))
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

/// What a sender signs.
fn of_sender(
    room: &Name,
    avatar: PackageId,
    offer: &str,
    answer: &str,
) -> Result<String, CallError> {
    let [theirs, own] = [fingerprints(offer)?, fingerprints(answer)?];
    Ok(format!("{room}\n{avatar}\n{own}\n{theirs}"))
}

/// What a viewer signs.
fn of_viewer(room: &Name, offer: &str) -> Result<String, CallError> {
    Ok(format!("{room}\n{}", fingerprints(offer)?))
}

/// The fingerprints in an offer or answer, each once, in their order by the alphabet: `sha-256 aa:bb:...`, with commas between.
fn fingerprints(sdp: &str) -> Result<String, CallError> {
    let values = sdp
        .lines()
        .filter_map(|line| line.trim_end().strip_prefix("a=fingerprint:"));
    let mut found: Vec<String> = values.map(str::to_ascii_lowercase).collect();
    found.sort_unstable();
    found.dedup();
    if found.is_empty() || found.len() > MOST_FINGERPRINTS {
        return Err(CallError::NoFingerprint);
    }
    Ok(found.join(","))
}

/// What follows `head` in the one line that begins so; nothing where none does.
pub(crate) fn only<'a>(sdp: &'a str, head: &str) -> Result<Option<&'a str>, CallError> {
    let mut lines = sdp.lines().filter_map(|line| line.strip_prefix(head));
    let line = lines.next().map(str::trim_end);
    if lines.next().is_some() {
        return Err(IdentityError::Malformed("an introduction: there are two").into());
    }
    Ok(line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use link_protocol::{CallLink, LinkSecret};

    const OFFER: &str = "v=0\r\na=fingerprint:sha-256 AA:01\r\nm=application 9\r\na=mid:0\r\n";
    const ANSWER: &str = "v=0\r\nm=application 9\r\na=fingerprint:sha-256 BB:02\r\n";

    fn avatar(digit: char) -> PackageId {
        let text: String = std::iter::repeat_n(digit, 64).collect();
        text.parse().expect("a hash")
    }

    fn identity(seed: u8) -> Identity {
        Identity::from_seed(&[seed; 32]).expect("a key")
    }

    fn room(name: &str) -> RoomLink {
        let server = "http://127.0.0.1:1".parse().expect("an address");
        RoomLink::of(server, name, "token").expect("a room")
    }

    fn keyed(name: &str, key: u8) -> RoomLink {
        room(name).with_key(identity(key).public().hash())
    }

    fn secret(name: &str, secret: u8) -> RoomLink {
        room(name).with_secret(LinkSecret::new([secret; 16]))
    }

    fn answer(own: Option<Identity>, room: &RoomLink) -> String {
        let own = own.map(Credentials::new);
        introduce_sender(own.as_ref(), room, avatar('a'), OFFER, ANSWER).expect("an answer")
    }

    /// What a server in the middle may try: its own certificate, on either side, or beside the sender's; another room, another avatar.
    fn meddled(answer: &str, other_room: &RoomLink, room: &RoomLink) -> Vec<Option<CallError>> {
        let certificate = answer.replace("BB:02", "CC:03");
        let beside = format!("{answer}a=fingerprint:sha-256 CC:03\r\n");
        let offer = OFFER.replace("AA:01", "CC:03");
        [
            (room, 'a', OFFER, &*certificate),
            (room, 'a', OFFER, &*beside),
            (room, 'a', &*offer, answer),
            (other_room, 'a', OFFER, answer),
            (room, 'b', OFFER, answer),
        ]
        .map(|(room, digit, offer, answer)| {
            let checked = Authentication::default().check(room, avatar(digit), offer, answer);
            checked.err()
        })
        .into()
    }

    #[test]
    fn a_sender_is_known_by_the_key_in_the_link() {
        let signed = answer(Some(identity(1)), &room("r1"));
        let check = |answer: &str, key| {
            Authentication::default().check(&keyed("r1", key), avatar('a'), OFFER, answer)
        };
        let known = check(&signed, 1).expect("the sender");
        assert_eq!(known, Answered::Sender(Some(identity(1).public())));
        let wrong = check(&signed, 2);
        assert!(
            matches!(wrong, Err(CallError::WrongKey { .. })),
            "{wrong:?}"
        );
        let unsigned = check(ANSWER, 1);
        assert!(matches!(unsigned, Err(CallError::NoKey)), "{unsigned:?}");
        for refused in meddled(&signed, &keyed("r2", 1), &keyed("r1", 1)) {
            let wrong = CallError::Identity(IdentityError::WrongSignature);
            assert_eq!(refused.map(|it| it.to_string()), Some(wrong.to_string()));
        }
        let again = &signed[signed.find(KEY_LINE).expect("it")..];
        assert!(check(&format!("{signed}{again}"), 1).is_err(), "two keys");
    }

    #[test]
    fn each_side_knows_that_the_other_has_the_link() {
        let proved = answer(None, &secret("r1", 1));
        let check = |room: &RoomLink, answer: &str| {
            Authentication::default().check(room, avatar('a'), OFFER, answer)
        };
        assert!(check(&secret("r1", 1), &proved).is_ok());
        assert!(
            check(&room("r1"), &proved).is_ok(),
            "who has less checks less"
        );
        for (room, answer) in [(secret("r1", 2), &*proved), (secret("r1", 1), ANSWER)] {
            let refused = check(&room, answer);
            assert!(matches!(refused, Err(CallError::NoLink)), "{refused:?}");
        }
        for refused in meddled(&proved, &secret("r2", 1), &secret("r1", 1)) {
            assert!(matches!(refused, Some(CallError::NoLink)), "{refused:?}");
        }
        let offer = Authentication::default().introduce(&secret("r1", 1), OFFER);
        let offer = offer.expect("an offer");
        assert!(check_viewer(None, &secret("r1", 1), &offer).is_ok());
        for (room, offer) in [
            (secret("r1", 1), OFFER.to_owned()),
            (secret("r1", 2), offer.clone()),
            (secret("r2", 1), offer.clone()),
            (secret("r1", 1), offer.replace("AA:01", "AA:02")),
        ] {
            let refused = check_viewer(None, &room, &offer);
            assert!(matches!(refused, Err(CallError::NoLink)), "{refused:?}");
        }
        // What a viewer proved is no proof of a sender.
        let [viewers, senders] = [Purpose::Viewer, Purpose::Sender].map(|purpose| {
            let secret = LinkSecret::new([1; 16]);
            proof::prove(&secret, purpose, OF_LINK, "the same text")
        });
        assert_ne!(viewers, senders);
    }

    #[test]
    fn a_forwarder_is_taken_where_it_cannot_read_and_never_in_a_call() {
        let answer = introduce_forwarder(ANSWER);
        let media = answer.find("m=").expect("media");
        assert!(answer.find(FORWARDER_LINE).expect("a line") < media);
        let check =
            |room: &RoomLink| Authentication::default().check(room, avatar('a'), OFFER, &answer);
        let taken = check(&secret("r1", 1)).expect("it cannot read");
        assert_eq!(taken, Answered::Forwarder);
        let call: CallLink = "http://127.0.0.1:1/calls/c1#token".parse().expect("a link");
        let call = call.with_secret(LinkSecret::new([1; 16]));
        let seat = call.seat(&"r1".parse().expect("a name"));
        for room in [room("r1"), keyed("r1", 1), seat] {
            let refused = check(&room);
            assert!(
                matches!(refused, Err(CallError::TooManyViewers)),
                "{refused:?}"
            );
        }
        for (refusal, expected) in [
            (Refusal::Link, CallError::Refused(Refusal::Link)),
            (Refusal::Full, CallError::TooManyViewers),
        ] {
            let authentication = Authentication::default();
            let told = authentication.check(&room("r1"), avatar('a'), OFFER, &refusal.answer());
            assert_eq!(
                told.err().map(|it| it.to_string()),
                Some(expected.to_string())
            );
        }
    }

    #[test]
    fn an_avatar_is_driven_by_its_owner_and_by_whom_they_permit() {
        let (owner, other) = (identity(1), identity(2));
        let signer = Some(owner.public());
        let drive = |own: Credentials| {
            let answer = introduce_sender(Some(&own), &room("r1"), avatar('a'), OFFER, ANSWER);
            let authentication = Authentication { own: None, signer };
            let answer = answer.expect("signed");
            authentication.check(&room("r1"), avatar('a'), OFFER, &answer)
        };
        assert!(drive(Credentials::new(owner.clone())).is_ok(), "the owner");
        let refused = drive(Credentials::new(other.clone()));
        assert!(
            matches!(refused, Err(CallError::NotTheirAvatar { why: None, .. })),
            "{refused:?}"
        );
        let permit = |until| Permit::new(&owner, other.public(), until);
        let permitted = Credentials::for_avatar(other.clone(), signer, &[permit(u64::MAX)]);
        assert!(drive(permitted.expect("a permit")).is_ok(), "a permit");
        let over = Credentials {
            identity: other.clone(),
            permit: Some(permit(1)),
        };
        let refused = drive(over);
        assert!(
            matches!(refused, Err(CallError::NotTheirAvatar { why: Some(_), .. })),
            "{refused:?}"
        );
        for permits in [
            &[][..],
            &[permit(1)],
            &[Permit::new(&other, other.public(), u64::MAX)],
        ] {
            let own = Credentials::for_avatar(other.clone(), signer, permits);
            assert!(own.is_err(), "this side is told before it enters");
        }
        let authentication = Authentication { own: None, signer };
        let unsigned = authentication.check(&room("r1"), avatar('a'), OFFER, ANSWER);
        assert!(matches!(unsigned, Err(CallError::NoKey)));
    }

    #[test]
    fn a_viewer_is_known_by_its_offer() {
        let own = Some(Credentials::new(identity(3)));
        let authentication = Authentication { own, signer: None };
        let signed = authentication.introduce(&room("r1"), OFFER);
        let signed = signed.expect("signed");
        let known = check_viewer(None, &room("r1"), &signed).expect("a viewer");
        assert_eq!(known.key, Some(identity(3).public()));
        assert_eq!(
            check_viewer(None, &room("r1"), OFFER).expect("nobody").key,
            None
        );
        assert!(
            check_viewer(None, &room("r2"), &signed).is_err(),
            "for another room"
        );
        assert!(check_viewer(None, &room("r1"), &signed.replace("AA:01", "AA:02")).is_err());
        let media = signed.find("m=").expect("media");
        assert!(signed.find(KEY_LINE).expect("a key") < media);
    }
}
