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
    assert_eq!(sealer.message(5, b"a frame", &mut sealed), Sealing::Sealed);
    assert!(!sealed.windows(7).any(|part| part == b"a frame"));
    assert_eq!(open(6, &sealed), None, "another session");
    assert_eq!(open(5, &sealed), opened(b"a frame"));
    assert_eq!(open(5, &sealed), None, "it comes again");
    let mut second = Vec::new();
    assert_eq!(sealer.message(5, b"a frame", &mut second), Sealing::Sealed);
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
    assert_eq!(other.message(5, b"a frame", &mut second), Sealing::Sealed);
    assert_eq!(open(5, &second), Some(Opened::Nothing), "another sender's");
    assert!(opener.renew(&terms(&sealer.lines(None))), "told again");
    assert!(!opener.renew(&terms(&other_lines)), "another connection");
    assert_eq!(sealer.message(5, b"a frame", &mut second), Sealing::Sealed);
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
    assert_eq!(
        sealer.message(5, b"a frame", &mut Vec::new()),
        Sealing::NoViewer
    );
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
    assert_eq!(
        sealer.message(5, b"said in confidence", &mut recorded),
        Sealing::Sealed
    );
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
    assert_eq!(sealer.message(5, b"for all", &mut next), Sealing::Sealed);
    assert_eq!(late.message(&mut keys, 5, &next), opened(b"for all"));
    // Nor is anyone led back to a seal before.
    let mut before = terms(&first_lines);
    before.time -= 1;
    assert!(late.is_newer_than(&before));
    // What is held back until the lines are old is not opened.
    let mut held = Vec::new();
    assert_eq!(sealer.message(5, b"held back", &mut held), Sealing::Sealed);
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
