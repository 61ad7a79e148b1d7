use super::visits::{GIVEN_UP, MOST_HANDED_OVER, MOST_WAITING};
use super::*;
use crate::visitor::Who;
use identity::Identity;
use link_protocol::Rights;
use std::time::Duration;

/// In the year 2096.
const LATE: u64 = 4_000_000_000;

const NAMELESS: Visitor = Visitor {
    key: None,
    guest: None,
};

fn name(text: &str) -> Name {
    text.parse().expect("a name")
}

fn keyed(number: u16) -> Visitor {
    let mut seed = [7; 32];
    seed[..2].copy_from_slice(&number.to_le_bytes());
    Visitor {
        key: Some(Identity::from_seed(&seed).expect("a key").public()),
        guest: None,
    }
}

/// A guest called Bob, with this token.
fn bob(token: &str, expires: u64) -> Guest {
    Guest {
        name: "Bob".parse().expect("a name"),
        expires,
        rights: Rights::ALL,
        token: name(token),
    }
}

/// With that guest's link, and no key.
fn with_link(guest: &Guest) -> Visitor {
    Visitor {
        key: None,
        guest: Some(guest.clone()),
    }
}

fn asking() -> Door {
    Door::new(DoorRules {
        ask: true,
        ..DoorRules::default()
    })
}

/// With the room's own link.
fn knocks(door: &Door, visitor: &Visitor) -> Result<(), Refusal> {
    door.knock(visitor, Some(&name("rooms")), 0)
}

/// With a guest's link, as it is.
fn guest_knocks(door: &Door, visitor: &Visitor, now: u64) -> Result<(), Refusal> {
    let guest = visitor.guest.as_ref().expect("a guest");
    door.knock(visitor, Some(&guest.token), now)
}

#[tokio::test]
async fn who_is_asked_about_waits_is_let_in_comes_back_and_may_give_up() {
    let door = asking();
    let (ada, bob) = (keyed(1), keyed(2));
    assert_eq!(knocks(&door, &NAMELESS), Err(Refusal::Nameless));
    assert_eq!(knocks(&door, &ada), Err(Refusal::Wait));
    assert_eq!(knocks(&door, &ada), Err(Refusal::Wait), "still");
    assert_eq!(knocks(&door, &bob), Err(Refusal::Wait));
    assert_eq!(door.next_event(), Some(DoorEvent::Waits(1, ada.clone())));
    assert_eq!(door.next_event(), Some(DoorEvent::Waits(2, bob.clone())));
    assert_eq!(door.next_event(), None, "each is told once");
    assert_eq!(door.admit(1), Some(ada.clone()));
    assert_eq!(knocks(&door, &ada), Ok(()));
    drop(door.enter(ada.clone(), None));
    assert_eq!(knocks(&door, &ada), Ok(()), "comes back");
    for waiting in &mut door.locked().waiting {
        waiting.knocked -= GIVEN_UP + Duration::from_millis(1);
    }
    let events: Vec<_> = std::iter::from_fn(|| door.next_event()).collect();
    assert_eq!(
        events,
        [
            DoorEvent::Entered(1, ada.clone()),
            DoorEvent::Left(1, ada),
            DoorEvent::GaveUp(2, bob),
        ]
    );
    assert_eq!(door.admit(2), None, "nobody waits");
}

#[tokio::test]
async fn members_of_a_call_are_let_in_by_their_keys_and_sent_away_by_them() {
    let door = Door::default();
    let [ada, eve] = [keyed(1), keyed(2)];
    let key = |visitor: &Visitor| visitor.key.expect("a key");
    let keyless = door.is_seated(&NAMELESS).await;
    assert_eq!(keyless, Some(false), "without a key");
    let now = std::time::Instant::now();
    door.seat_members(now, &[key(&ada), key(&eve)]);
    assert_eq!(door.is_seated(&eve).await, Some(true));
    assert!(door.lets_in(key(&eve)));
    let stay = door.enter(eve.clone(), None);
    door.seat_members(now, &[key(&ada)]);
    assert_eq!(*stay.leave.borrow(), None, "her seat may be kept");
    for second in 1..=11 {
        door.seat_members(now + Duration::from_secs(second), &[key(&ada)]);
    }
    assert_eq!(*stay.leave.borrow(), Some(NO_SEAT));
    drop(stay);
    door.remove_member(key(&eve));
    assert!(door.has_removed(key(&eve)) && !door.lets_in(key(&eve)));
    assert_eq!(knocks(&door, &eve), Err(Refusal::Removed));
    let stay = door.enter(ada.clone(), None);
    door.toggle_lock();
    assert!(door.lets_in(key(&ada)) && !door.lets_in(key(&keyed(3))));
    door.remove_member(key(&ada));
    assert_eq!(*stay.leave.borrow(), Some(SENT_AWAY));
}

#[test]
fn a_network_with_every_place_makes_room_for_another_one() {
    let door = Door::default();
    let [hers, his] = ["eve", "bob"].map(|network| Some(name(network)));
    let mut eve: Vec<Stay> = (0..MOST_INSIDE)
        .map(|number| {
            let number = u16::try_from(number).expect("few");
            door.enter(keyed(number), hers.clone())
        })
        .collect();
    let has_to_go = |stay: &Stay| *stay.leave.borrow();
    assert!(!door.has_room(&keyed(99), hers.as_ref()));
    let one_more = door.enter(keyed(99), hers.clone());
    assert_eq!(has_to_go(&one_more), Some(NO_ROOM), "of hers");
    assert!(door.has_room(&NAMELESS, his.as_ref()));
    let bob = door.enter(NAMELESS, his);
    assert_eq!(has_to_go(&bob), None);
    let newest = eve.pop().expect("many");
    assert_eq!(has_to_go(&newest), Some(MADE_ROOM));
    assert!(eve.iter().all(|stay| has_to_go(stay).is_none()));
}

#[test]
fn a_crowd_before_the_door_is_bounded_told_once_and_keeps_no_guest_from_waiting() {
    let door = asking();
    let crowd = u16::try_from(MOST_WAITING).expect("few") + 5;
    for number in 0..crowd {
        assert_eq!(knocks(&door, &keyed(number)), Err(Refusal::Wait));
    }
    assert_eq!(door.seen().len(), MOST_WAITING);
    let guest = bob("t", LATE);
    door.invite(guest.clone()).expect("few guests");
    assert_eq!(
        guest_knocks(&door, &with_link(&guest), 0),
        Err(Refusal::Wait)
    );
    let seen = door.seen();
    let waits = seen.last().expect("someone");
    assert_eq!(waits.visitor, with_link(&guest), "is seen");
    let told = std::iter::from_fn(|| door.next_event());
    let crowded = told.filter(|event| *event == DoorEvent::Crowded);
    assert_eq!(crowded.count(), 1);
}

#[tokio::test]
async fn who_is_sent_away_leaves_and_comes_in_neither_by_link_nor_by_key() {
    let door = Door::default();
    let guest = bob("t1", LATE);
    let visitor = Visitor {
        key: keyed(2).key,
        ..with_link(&guest)
    };
    door.invite(guest.clone()).expect("few guests");
    assert_eq!(guest_knocks(&door, &visitor, 0), Ok(()));
    let stay = door.enter(visitor.clone(), None);
    // Another program of the same guest's, with another key.
    let second = Visitor {
        key: keyed(3).key,
        ..with_link(&guest)
    };
    assert!(door.hand_over(second.clone(), name("s1")));
    let number = door.seen()[0].number;
    assert!(door.revoked(9, 0).is_empty());
    assert_eq!(door.remove(number), Some(visitor.clone()));
    assert_eq!(
        Stay::over(Some(&stay)).await,
        "the performer has sent it away"
    );
    door.changed().await;
    assert_eq!(door.take_sessions_to_end(), [name("s1")]);
    assert_eq!(door.revoked(9, 0), [name("t1")]);
    assert!(door.revoked(9, LATE).is_empty(), "it has ended anyway");
    let refused = |door: &Door| {
        for visitor in [&visitor, &second, &with_link(&guest)] {
            let refused = guest_knocks(door, visitor, 0);
            assert_eq!(refused, Err(Refusal::Removed), "{visitor}");
        }
        for number in [2, 3] {
            assert_eq!(knocks(door, &keyed(number)), Err(Refusal::Removed));
        }
    };
    refused(&door);
    // A new link of the same name pardons nobody, also not when the room is entered again.
    let again = bob("t2", LATE);
    door.invite(again.clone()).expect("few guests");
    refused(&door);
    assert_eq!(door.revoked(9, 0), [name("t1")]);
    assert_eq!(guest_knocks(&door, &with_link(&again), 0), Ok(()));
    refused(&Door::new(door.rules()));
}

#[test]
fn a_guest_is_nobody_without_their_token_and_their_token_is_nobodys_without_them() {
    let door = Door::default();
    let hears = Guest {
        rights: Rights {
            see: false,
            hear: true,
        },
        ..bob("t1", LATE)
    };
    door.invite(hears.clone()).expect("few guests");
    assert_eq!(guest_knocks(&door, &with_link(&hears), 0), Ok(()));
    // The link without what says who they are; what says it, with another token.
    for (visitor, token) in [
        (keyed(1), Some("t1")),
        (NAMELESS, Some("t1")),
        (with_link(&hears), Some("rooms")),
        (with_link(&hears), None),
    ] {
        let token = token.map(name);
        let refused = door.knock(&visitor, token.as_ref(), 0);
        assert_eq!(refused, Err(Refusal::Link), "{visitor} {token:?}");
    }
    let again = Door::new(door.rules());
    let refused = again.knock(&keyed(1), Some(&name("t1")), 0);
    assert_eq!(refused, Err(Refusal::Link), "kept");
    // So it holds only as long as all are known.
    for number in 1..MOST_KEPT {
        let one = bob(&format!("more{number}"), LATE);
        door.invite(one).expect("one of so many");
    }
    let refused = door.invite(bob("more", LATE));
    assert!(matches!(refused, Err(CallError::TooManyGuests { .. })));
    let later = door.locked().rules.invite(bob("more", LATE + 9), LATE);
    assert!(later.is_ok(), "links end");
}

#[test]
fn only_who_was_inside_comes_in_while_the_room_is_locked_and_asking_asks_all_but_those_let_in() {
    let door = Door::default();
    let stay = door.enter(keyed(1), None);
    assert!(door.hand_over(keyed(2), name("s2")));
    drop(door.enter(keyed(3), None));
    // Whoever offers and does not connect was not inside.
    assert_eq!(knocks(&door, &keyed(4)), Ok(()));
    assert!(door.toggle_lock());
    for number in [1, 2, 3] {
        assert_eq!(knocks(&door, &keyed(number)), Ok(()), "{number} was inside");
    }
    for visitor in [keyed(4), NAMELESS] {
        assert_eq!(knocks(&door, &visitor), Err(Refusal::Locked), "{visitor}");
    }
    assert!(!door.toggle_lock());
    // However many come and go.
    for number in 1000.. {
        drop(door.enter(keyed(number), None));
        if usize::from(number) == 1000 + MOST_KEPT {
            break;
        }
    }
    assert!(door.toggle_lock());
    for (number, expected) in [(1, Ok(())), (2, Ok(())), (3, Err(Refusal::Locked))] {
        assert_eq!(knocks(&door, &keyed(number)), expected, "{number}");
    }
    drop(stay);
    let asks = Door::new(DoorRules {
        ask: true,
        locked: false,
        ..door.rules()
    });
    assert_eq!(
        knocks(&asks, &keyed(1)),
        Err(Refusal::Wait),
        "was not let in"
    );
    assert_eq!(asks.admit(1), Some(keyed(1)));
    assert!(asks.toggle_lock());
    assert_eq!(knocks(&asks, &keyed(1)), Ok(()));
    assert_eq!(knocks(&asks, &keyed(2)), Err(Refusal::Locked));
}

#[test]
fn who_shows_nothing_and_is_sent_away_has_nobody_come_in_who_shows_nothing() {
    let door = Door::default();
    assert_eq!(knocks(&door, &NAMELESS), Ok(()));
    let _stay = door.enter(NAMELESS, None);
    let number = door.seen()[0].number;
    assert_eq!(door.remove(number), Some(NAMELESS));
    assert_eq!(knocks(&door, &NAMELESS), Err(Refusal::Nameless));
    assert_eq!(knocks(&door, &keyed(1)), Ok(()));
    assert!(door.rules().known_only, "kept");
}

#[tokio::test]
async fn guests_come_and_stay_until_their_time_is_over_also_where_the_server_serves_them() {
    let door = Door::new(DoorRules {
        guests_only: true,
        ..DoorRules::default()
    });
    let guest = with_link(&bob("t", 10));
    assert_eq!(knocks(&door, &keyed(1)), Err(Refusal::Guests));
    assert_eq!(guest_knocks(&door, &guest, 9), Ok(()));
    assert_eq!(guest_knocks(&door, &guest, 10), Err(Refusal::Expired));
    // Long over by the clock.
    let stay = door.enter(guest.clone(), None);
    assert_eq!(Stay::over(Some(&stay)).await, "its link has ended");
    let stays = door.enter(with_link(&bob("t", u64::MAX)), None);
    let lasts = tokio::time::timeout(Duration::from_millis(50), Stay::over(Some(&stays)));
    assert!(lasts.await.is_err(), "goes on");
    assert!(door.hand_over(guest, name("s1")));
    assert!(door.hand_over(keyed(1), name("s2")));
    door.end_expired(9);
    assert!(door.take_sessions_to_end().is_empty());
    door.end_expired(10);
    door.changed().await;
    assert_eq!(door.take_sessions_to_end(), [name("s1")]);
    door.end_expired(11);
    assert!(door.take_sessions_to_end().is_empty(), "once");
}

#[test]
fn all_whom_the_server_serves_are_known_until_it_says_that_they_have_left() {
    let door = Door::default();
    for number in 0..MOST_HANDED_OVER {
        assert!(door.hand_over(NAMELESS, name(&format!("s{number}"))));
    }
    assert!(!door.hand_over(keyed(1), name("more")), "none is forgotten");
    door.left(&name("s7"));
    assert!(door.hand_over(keyed(1), name("more")));
    let number = door.seen().last().expect("they are there").number;
    assert_eq!(door.remove(number), Some(keyed(1)));
    assert_eq!(door.take_sessions_to_end(), [name("more")]);
    assert!(
        door.rules()
            .removed
            .contains(&Who::Key(keyed(1).key.expect("a key")))
    );
}
