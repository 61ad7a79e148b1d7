use super::*;
use crate::sdp::tests::{fingerprint, offer};
use link_protocol::{CallLink, LinkSecret};
use std::sync::LazyLock;

static OFFER: LazyLock<String> = LazyLock::new(|| offer(""));
static ANSWER: LazyLock<String> = LazyLock::new(|| offer("").replace("AA:01", "BB:02"));

fn read(sdp: &str) -> Description {
    Description::read(sdp).expect("a description")
}

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

/// Takes this answer to this offer, or does not.
fn take(
    authentication: &Authentication,
    room: &RoomLink,
    digit: char,
    offer: &str,
    answer: &str,
) -> Result<Answered, CallError> {
    authentication.check(room, avatar(digit), offer, &Description::read(answer)?)
}

fn anyone() -> Authentication {
    Authentication::default()
}

fn answer(own: Option<Identity>, room: &RoomLink) -> String {
    let own = own.map(Credentials::new);
    introduce_sender(own.as_ref(), room, avatar('a'), &read(&OFFER), &ANSWER).expect("an answer")
}

/// What a server in the middle may try: its own certificate, on either side; another room, another avatar.
fn meddled(answer: &str, other_room: &RoomLink, room: &RoomLink) -> Vec<Option<CallError>> {
    let certificate = answer.replace("BB:02", "CC:03");
    let offer = OFFER.replace("AA:01", "CC:03");
    [
        (room, 'a', OFFER.as_str(), &*certificate),
        (room, 'a', &*offer, answer),
        (other_room, 'a', &OFFER, answer),
        (room, 'b', &OFFER, answer),
    ]
    .map(|(room, digit, offer, answer)| take(&anyone(), room, digit, offer, answer).err())
    .into()
}

/// The same with its own certificate beside the genuine one, in the forms that once passed: no answer and no offer of
/// these is taken.
#[test]
fn a_certificate_beside_the_signed_one_is_refused_in_every_form() {
    let evil = fingerprint("CC:03");
    let room = secret("r1", 1);
    let own = Some(Credentials::new(identity(1)));
    let signed = answer(Some(identity(1)), &room);
    let offered = Authentication { own, signer: None };
    let offered = offered.introduce(&room, &OFFER).expect("an offer");
    assert!(take(&anyone(), &room, 'a', &OFFER, &signed).is_ok());
    assert!(check_viewer(None, &room, &offered).is_ok());
    for form in [
        "a=fingerprint:",
        "a= fingerprint:",
        "a=\tfingerprint:",
        "\ra=fingerprint:",
        "a=\u{a0}fingerprint:",
        "a=\u{c}fingerprint:",
        "a=\u{b}fingerprint:",
        " a=fingerprint:",
        "a =fingerprint:",
        "A=fingerprint:",
        "\r\na=fingerprint:",
        "a=\0fingerprint:",
    ] {
        let line = format!("{form}sha-256 {evil}\r\na=fingerprint:");
        let answer = signed.replace("a=fingerprint:", &line);
        let refused = take(&anyone(), &room, 'a', &OFFER, &answer);
        assert!(
            matches!(refused, Err(CallError::Description(_))),
            "{form:?}: {refused:?}"
        );
        let offer = offered.replace("a=fingerprint:", &line);
        let refused = check_viewer(None, &room, &offer);
        assert!(
            matches!(refused, Err(CallError::Description(_))),
            "{form:?}: {refused:?}"
        );
    }
}

#[test]
fn a_sender_is_known_by_the_key_in_the_link() {
    let signed = answer(Some(identity(1)), &room("r1"));
    let check = |answer: &str, key| take(&anyone(), &keyed("r1", key), 'a', &OFFER, answer);
    let known = check(&signed, 1).expect("the sender");
    assert_eq!(known, Answered::Sender(Some(identity(1).public()), None));
    let wrong = check(&signed, 2);
    assert!(
        matches!(wrong, Err(CallError::WrongKey { .. })),
        "{wrong:?}"
    );
    let unsigned = check(&ANSWER, 1);
    assert!(matches!(unsigned, Err(CallError::NoKey)), "{unsigned:?}");
    for refused in meddled(&signed, &keyed("r2", 1), &keyed("r1", 1)) {
        let wrong = CallError::Identity(IdentityError::WrongSignature);
        assert_eq!(refused.map(|it| it.to_string()), Some(wrong.to_string()));
    }
    let line = signed
        .lines()
        .find(|line| line.starts_with(KEY_LINE))
        .expect("it");
    let twice = signed.replace(line, &format!("{line}\r\n{line}"));
    assert!(check(&twice, 1).is_err(), "two keys");
}

#[test]
fn each_side_knows_that_the_other_has_the_link() {
    let proved = answer(None, &secret("r1", 1));
    let check = |room: &RoomLink, answer: &str| take(&anyone(), room, 'a', &OFFER, answer);
    assert!(check(&secret("r1", 1), &proved).is_ok());
    assert!(
        check(&room("r1"), &proved).is_ok(),
        "who has less checks less"
    );
    for (room, answer) in [
        (secret("r1", 2), &*proved),
        (secret("r1", 1), ANSWER.as_str()),
    ] {
        let refused = check(&room, answer);
        assert!(matches!(refused, Err(CallError::NoLink)), "{refused:?}");
    }
    for refused in meddled(&proved, &secret("r2", 1), &secret("r1", 1)) {
        assert!(matches!(refused, Some(CallError::NoLink)), "{refused:?}");
    }
    let offer = anyone().introduce(&secret("r1", 1), &OFFER);
    let offer = offer.expect("an offer");
    assert!(check_viewer(None, &secret("r1", 1), &offer).is_ok());
    for (room, offer) in [
        (secret("r1", 1), OFFER.clone()),
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
    let answer = introduce_forwarder(&ANSWER);
    let media = answer.find("m=").expect("media");
    assert!(answer.find(FORWARDER_LINE).expect("a line") < media);
    let check = |room: &RoomLink| take(&anyone(), room, 'a', &OFFER, &answer);
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
        let told = take(&anyone(), &room("r1"), 'a', &OFFER, &refusal.answer());
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
        let offer = read(&OFFER);
        let answer = introduce_sender(Some(&own), &room("r1"), avatar('a'), &offer, &ANSWER);
        let authentication = Authentication { own: None, signer };
        let answer = answer.expect("signed");
        take(&authentication, &room("r1"), 'a', &OFFER, &answer)
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
        permit: Some(permit(1)),
        ..Credentials::new(other.clone())
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
    let unsigned = take(&authentication, &room("r1"), 'a', &OFFER, &ANSWER);
    assert!(matches!(unsigned, Err(CallError::NoKey)));
}

#[test]
fn a_viewer_is_known_by_its_offer() {
    let own = Some(Credentials::new(identity(3)));
    let authentication = Authentication { own, signer: None };
    let signed = authentication.introduce(&room("r1"), &OFFER);
    let signed = signed.expect("signed");
    let (known, _) = check_viewer(None, &room("r1"), &signed).expect("a viewer");
    assert_eq!(known.key, Some(identity(3).public()));
    let (unknown, _) = check_viewer(None, &room("r1"), &OFFER).expect("a viewer");
    assert_eq!(unknown.key, None);
    assert!(
        check_viewer(None, &room("r2"), &signed).is_err(),
        "for another room"
    );
    assert!(check_viewer(None, &room("r1"), &signed.replace("AA:01", "AA:02")).is_err());
    let media = signed.find("m=").expect("media");
    assert!(signed.find(KEY_LINE).expect("a key") < media);
}

#[test]
fn a_name_is_its_owners_and_no_servers() {
    let name = |text: &str| Some(text.parse::<PersonName>().expect("a name"));
    let named = |seed: u8, text: &str| {
        let own = Credentials::new(identity(seed)).named(name(text));
        introduce_sender(Some(&own), &room("r1"), avatar('a'), &read(&OFFER), &ANSWER)
            .expect("an answer")
    };
    let check = |answer: &str| take(&anyone(), &room("r1"), 'a', &OFFER, answer);
    let [ada, bob] = [named(1, "Ada Lovelace"), named(2, "Bob")];
    let known = check(&ada).expect("the sender");
    assert_eq!(
        known,
        Answered::Sender(Some(identity(1).public()), name("Ada Lovelace"))
    );
    let line = |answer: &str| {
        let line = answer.lines().find(|line| line.starts_with(NAME_LINE));
        line.expect("a name").to_owned()
    };
    // Another person's name, the same person's under another name, and one of another connection.
    let elsewhere = Credentials::new(identity(1)).named(name("Bob"));
    let other = read(&OFFER.replace("AA:01", "AA:02"));
    let elsewhere = introduce_sender(Some(&elsewhere), &room("r1"), avatar('a'), &other, &ANSWER);
    for theirs in [line(&bob), line(&elsewhere.expect("an answer"))] {
        let refused = check(&ada.replace(&line(&ada), &theirs));
        let wrong = CallError::Identity(IdentityError::WrongSignature);
        assert_eq!(
            refused.err().map(|it| it.to_string()),
            Some(wrong.to_string())
        );
    }
    let bobs = BASE64URL_NOPAD.encode(b"Bob");
    let adas = BASE64URL_NOPAD.encode(b"Ada Lovelace");
    assert!(
        check(&ada.replace(&adas, &bobs)).is_err(),
        "another name, the same signature"
    );
    let control = BASE64URL_NOPAD.encode(b"\x1b[2J");
    assert!(
        check(&ada.replace(&adas, &control)).is_err(),
        "a control character"
    );
    // Programs that sign no name have none, and one without a key has none that counts.
    let nameless = ada.replace(&format!("{}\r\n", line(&ada)), "");
    assert_eq!(
        check(&nameless).expect("it"),
        Answered::Sender(Some(identity(1).public()), None)
    );
    let key = ada
        .lines()
        .find(|line| line.starts_with(KEY_LINE))
        .expect("a key");
    let keyless = ada.replace(&format!("{key}\r\n"), "");
    assert_eq!(check(&keyless).expect("it"), Answered::Sender(None, None));
    // A viewer tells no name, and so no sender's is of use for one.
    let own = Some(Credentials::new(identity(1)).named(name("Ada")));
    let offer = Authentication { own, signer: None }.introduce(&room("r1"), &OFFER);
    assert!(!offer.expect("an offer").contains(NAME_LINE));
}
