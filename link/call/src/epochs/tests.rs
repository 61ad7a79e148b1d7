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
pub(crate) fn comes(epochs: &Epochs, number: u8, room: &RoomLink, avatar: PackageId) -> ViewerKeys {
    let viewer = Exchange::new().expect("random");
    let answer = epochs.admit(&session(number), Some(&viewer.text()), room, avatar);
    let [answer, signed] = answer.expect("admitted");
    assert_eq!(signed, viewer.signed(room, avatar, &answer));
    viewer.accept(&answer, room, avatar).expect("the answer")
}

fn comes_in(epochs: &Epochs, number: u8) -> ViewerKeys {
    comes(epochs, number, &room(1), avatar())
}

/// Time passes: the sender's epoch may be over, and its newest key is used.
fn pass(epochs: &Epochs) {
    epochs.0.send_modify(|state| {
        state.begun -= Duration::from_secs(60);
        state.used_from = state.begun;
    });
}

/// One round of the newest epoch's key.
fn key_messages(epochs: &Epochs) -> Vec<Vec<u8>> {
    let mut distribution = epochs.distribution();
    let mut now = Instant::now();
    let first = distribution.message(now);
    let messages = epochs.0.borrow().messages();
    let rest = (1..messages).map(|_| {
        now += LONGEST_ROUNDS;
        distribution.sent();
        distribution.message(now).expect("one more")
    });
    first.into_iter().chain(rest).collect()
}

fn used(epochs: &Epochs) -> EpochKey {
    epochs.now().expect("a key").1
}

fn knows(keys: &ViewerKeys, key: EpochKey) -> bool {
    keys.newest().iter().any(|(_, known)| *known == key)
}

#[test]
fn who_comes_later_or_has_left_knows_no_key_of_the_epochs_before_and_after() {
    let epochs = Epochs::default();
    assert_eq!(epochs.now(), None, "no viewer could open it");
    let mut ada = comes_in(&epochs, 1);
    let first = used(&epochs);
    assert!(knows(&ada, first));
    pass(&epochs);
    let mut bob = comes_in(&epochs, 2);
    assert_eq!(used(&epochs), first, "Ada does not know the next yet");
    assert!(!knows(&bob, first), "what was before he came");
    for message in key_messages(&epochs) {
        assert!(ada.read_message(&message));
        bob.read_message(&message);
    }
    pass(&epochs);
    let second = used(&epochs);
    assert!(second != first && knows(&ada, second) && knows(&bob, second));
    // Bob leaves, and keeps reading what passes.
    epochs.leave(&session(2));
    for message in key_messages(&epochs) {
        assert!(ada.read_message(&message));
        bob.read_message(&message);
    }
    pass(&epochs);
    let third = used(&epochs);
    assert!(third != second && knows(&ada, third) && !knows(&bob, third));
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
    assert!(knows(&keys, used(&epochs)));
    pass(&epochs);
    let [message] = &key_messages(&epochs)[..] else {
        panic!("one viewer");
    };
    assert_eq!(message.len(), EPOCH_BYTES + ENTRY_BYTES);
    assert_eq!(epochs.0.borrow().epoch, 2, "the next one");
    assert!(keys.read_message(message));
    pass(&epochs);
    assert!(knows(&keys, used(&epochs)));
}

#[test]
fn a_large_audience_gets_the_keys_in_messages_of_one_packet_within_seconds() {
    let epochs = Epochs::default();
    let mut all: Vec<_> = (0..200).map(|number| comes_in(&epochs, number)).collect();
    pass(&epochs);
    epochs.leave(&session(199));
    let messages = key_messages(&epochs);
    assert_eq!(messages.len(), 199usize.div_ceil(ENTRIES_PER_MESSAGE));
    for keys in &mut all {
        for message in &messages {
            keys.read_message(message);
        }
    }
    assert!(messages.iter().all(|message| message.len() < 1_000));
    assert!(epochs.0.borrow().distribution() < Duration::from_secs(3));
    pass(&epochs);
    let key = used(&epochs);
    let know = all.iter().filter(|keys| knows(keys, key)).count();
    assert_eq!(know, 199, "all but the one who left");
}

#[test]
fn keys_are_taken_of_the_sender_alone_and_never_an_old_one_again() {
    let epochs = Epochs::default();
    let viewer = Exchange::new().expect("random");
    let text = viewer.text();
    let answer = epochs.admit(&session(1), Some(&text), &room(1), avatar());
    let [answer, _] = answer.expect("admitted");
    // A party without the link cannot stand between the two, nor change the answer.
    let refused = |answer: &str, room: &RoomLink| {
        let viewer = Exchange::new().expect("random");
        viewer.accept(answer, room, avatar()).is_err()
    };
    assert!(refused(&answer, &room(1)), "another viewer's");
    assert!(refused("", &room(1)) && refused("x 1 y", &room(1)));
    let other = Exchange::new().expect("random");
    let of_other = epochs.admit(&session(2), Some(&other.text()), &room(2), avatar());
    let [of_other, _] = of_other.expect("admitted with another secret");
    assert!(other.accept(&of_other, &room(1), avatar()).is_err());
    for exchange in [None, Some(""), Some("AAAA")] {
        let refused = epochs.admit(&session(3), exchange, &room(1), avatar());
        assert!(refused.is_err(), "{exchange:?}");
    }
    let mut keys = viewer.accept(&answer, &room(1), avatar()).expect("its own");
    pass(&epochs);
    epochs.leave(&session(2));
    let [message] = &key_messages(&epochs)[..] else {
        panic!("one viewer");
    };
    for at in 0..message.len() {
        let mut changed = message.clone();
        changed[at] ^= 1;
        assert!(!keys.read_message(&changed) && !keys.read_message(&message[..at]));
        assert_eq!(keys.epochs.len(), 1, "byte {at}");
    }
    assert!(keys.read_message(message) && keys.read_message(message));
    assert_eq!(keys.epochs.len(), 2, "once");
}

#[test]
fn each_forwarder_is_sent_the_keys_of_an_epoch_at_once_and_again_what_it_could_not_take() {
    let epochs = Epochs::default();
    let mut ada = comes_in(&epochs, 1);
    let [mut one, mut two] = [(); 2].map(|()| epochs.distribution());
    let mut now = Instant::now();
    for distribution in [&mut one, &mut two] {
        assert!(distribution.message(now).is_some());
        distribution.sent();
        while distribution.next > now {
            now += MESSAGE_INTERVAL;
        }
    }
    comes_in(&epochs, 2);
    assert_eq!(epochs.0.borrow().epoch, 1, "too early for another one");
    pass(&epochs);
    one.changed.mark_unchanged();
    two.changed.mark_unchanged();
    let of_one = one.message(now + REPEATED).expect("the next epoch");
    assert_eq!(epochs.0.borrow().epoch, 2);
    assert_eq!(two.changed.has_changed().ok(), Some(true), "it wakes up");
    let of_two = two.message(now + REPEATED).expect("the same");
    assert_eq!(of_one, of_two);
    let again = one.message(now + 2 * REPEATED);
    assert_eq!(again, Some(of_one), "it was not sent");
    assert!(ada.read_message(&of_two));
}

#[test]
fn a_viewer_that_was_connecting_gets_the_next_key_soon_however_many_there_are() {
    let epochs = Epochs::default();
    for number in 0..250 {
        comes_in(&epochs, number);
    }
    epochs.0.send_modify(|state| {
        for viewer in &mut state.viewers {
            viewer.joined -= NEW;
        }
    });
    let mut late = comes_in(&epochs, 250);
    pass(&epochs);
    epochs.leave(&session(0));
    let mut distribution = epochs.distribution();
    let mut now = Instant::now();
    // It is connecting, and gets nothing of the first rounds.
    for at in 0..FIRST_ROUNDS * 16 {
        assert!(distribution.message(now).is_some(), "message {at}");
        distribution.sent();
        now += MESSAGE_INTERVAL;
    }
    let key = epochs.0.borrow().key;
    assert!(!knows(&late, key));
    let repeated = distribution.message(now).expect("one more");
    assert!(late.read_message(&repeated));
    assert!(knows(&late, key));
}
