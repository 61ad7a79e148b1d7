//! What strangers, and those who have a link to a room, may not do.

use super::client::{Client, Plain};
use super::{credentials, external, key, pause, server, set_limits, unix_now};
use rtc::stun::attributes::{ATTR_EVEN_PORT, ATTR_REQUESTED_TRANSPORT};
use rtc::stun::message::METHOD_ALLOCATE;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream, UdpSocket};
use turn_server::credentials::{Credentials, Role, Subject};
use turn_server::{Admission, Key};

#[tokio::test]
async fn only_genuine_credentials_that_have_not_expired_get_an_allocation() {
    let (_server, address) = server(|_| {});
    let now = unix_now();
    let genuine = key().issue("room", now + 60);
    let password = genuine.password.clone();
    let with_name = |username: String| Credentials {
        username,
        password: password.clone(),
    };
    let refused = [
        ("expired", key().issue("room", now - 1)),
        (
            "another server's",
            Key::new([4; 32]).issue("room", now + 60),
        ),
        ("another room's", with_name(format!("{}:other", now + 60))),
        ("prolonged", with_name(format!("{}:room", now + 6000))),
        ("no expiry", with_name("room".to_owned())),
        ("an overflow", with_name(format!("{}0:room", u64::MAX))),
        ("no name", with_name(String::new())),
    ];
    for (what, credentials) in refused {
        let mut client = Client::udp(address, credentials).await;
        assert_eq!(client.allocate().await, Err(401), "{what}");
    }
    let mut client = Client::udp(address, genuine).await;
    client.allocate().await.expect("lent");
    // Others' credentials, even genuine ones, do not command an allocation.
    client.use_credentials(key().issue("other", now + 60));
    assert_eq!(client.refresh(0).await, Err(441), "another room's");
}

#[tokio::test]
async fn an_allocation_outlives_its_credentials_but_they_allow_no_other() {
    let (_server, address) = server(|_| {});
    let credentials = key().issue("room", unix_now() + 2);
    let mut client = Client::udp(address, credentials.clone()).await;
    let lent = client.allocate().await.expect("lent");
    tokio::time::sleep(Duration::from_millis(2200)).await;
    assert_eq!(client.refresh(600).await, Ok(600), "a call goes on");
    client.permit(lent).await.expect("a call goes on");
    let mut other = Client::udp(address, credentials).await;
    assert_eq!(other.allocate().await, Err(401), "no new one");
}

#[tokio::test]
async fn nothing_is_relayed_into_the_servers_own_networks() {
    let (_server, address) = server(external);
    let mut client = Client::udp(address, credentials()).await;
    client.allocate().await.expect("lent");
    for peer in [
        "127.0.0.1:80",
        "127.8.8.8:80",
        "0.0.0.0:80",
        "10.0.0.1:80",
        "172.20.0.1:80",
        "192.168.1.1:80",
        "100.64.0.1:80",
        "169.254.169.254:80",
        "224.0.0.251:5353",
        "255.255.255.255:80",
    ] {
        let peer: SocketAddr = peer.parse().expect("an address");
        assert_eq!(client.permit(peer).await, Err(403), "{peer}");
        assert_eq!(client.bind(0x4000, peer).await, Err(403), "{peer}");
    }
    for peer in ["[::1]:80", "[fe80::1]:80", "[::ffff:169.254.169.254]:80"] {
        let peer: SocketAddr = peer.parse().expect("an address");
        let refused = client.permit(peer).await;
        assert!(matches!(refused, Err(403 | 443)), "{peer}: {refused:?}");
    }
    assert_eq!(client.permit(([8, 8, 8, 8], 53).into()).await, Ok(()));
    // Not this machine either, by whatever address it has.
    let own = UdpSocket::bind("0.0.0.0:0").await.expect("a socket");
    own.connect("192.0.2.1:9").await.ok();
    if let Ok(own) = own.local_addr()
        && !own.ip().is_unspecified()
    {
        assert_eq!(client.permit(own).await, Err(403), "{own}");
    }
}

#[tokio::test]
async fn the_servers_own_address_leads_only_to_other_clients() {
    // The lent address is the loopback's, on which another program listens too.
    let (_server, address) = server(|_| {});
    let victim = UdpSocket::bind("127.0.0.1:0").await.expect("a socket");
    let target = victim.local_addr().expect("an address");
    let mut client = Client::udp(address, credentials()).await;
    let lent = client.allocate().await.expect("lent");
    client.permit(target).await.expect("the address of others");
    client.bind(0x4000, target).await.expect("a channel");
    client.indicate(target, b"attack").await;
    client.send_on(0x4000, b"attack").await;
    // And what comes from there by the network does not come from a client.
    victim.send_to(b"forged", lent).await.expect("sent");
    assert!(client.hears_nothing().await, "a packet from outside");
    let mut buffer = [0; 16];
    let received = victim.try_recv(&mut buffer);
    assert!(received.is_err(), "{received:?} bytes reached the loopback");
}

#[tokio::test]
async fn private_networks_are_relayed_to_where_the_operator_says_so() {
    let (_server, address) = server(|config| {
        external(config);
        config.private_peers = true;
    });
    let mut client = Client::udp(address, credentials()).await;
    client.allocate().await.expect("lent");
    assert_eq!(client.permit(([10, 99, 98, 97], 80).into()).await, Ok(()));
    for peer in [[127, 0, 0, 1], [169, 254, 169, 254]] {
        assert_eq!(client.permit((peer, 80).into()).await, Err(403), "{peer:?}");
    }
}

#[tokio::test]
async fn allocations_are_capped_by_room_by_address_and_in_all() {
    for (what, in_all, per_room, per_address, code) in [
        ("in all", 3, 9, 9, 508),
        ("of a room", 9, 3, 9, 486),
        ("of an address", 9, 9, 3, 486),
    ] {
        let (_server, address) = server(set_limits(|limits| {
            limits.allocations = in_all;
            limits.allocations_per_room = per_room;
            limits.allocations_of_sender = 0;
            limits.allocations_per_address = per_address;
        }));
        let mut clients = Vec::new();
        for _ in 0..3 {
            let mut client = Client::udp(address, credentials()).await;
            client.allocate().await.expect("lent");
            clients.push(client);
        }
        let mut more = Client::udp(address, credentials()).await;
        assert_eq!(more.allocate().await, Err(code), "{what}");
        if per_room == 3 {
            let mut other = Client::udp(address, key().issue("other", unix_now() + 60)).await;
            other.allocate().await.expect("another room's");
        }
        let first = clients.first_mut().expect("three");
        assert_eq!(first.allocate().await, Err(437), "one for each client");
        first.refresh(0).await.expect("given back");
        assert!(more.allocate().await.is_ok(), "{what}, after one is gone");
    }
}

/// A client at this address of the loopback with credentials of a token.
async fn client_at(address: SocketAddr, from: [u8; 4], subject: &Subject<'_>) -> Client {
    let credentials = key().issue(&subject.to_string(), unix_now() + 60);
    Client::udp_from(from, address, credentials).await
}

/// How many allocations these credentials get from this address, of the most that are tried.
async fn take(
    address: SocketAddr,
    from: [u8; 4],
    subject: &Subject<'_>,
    most: usize,
) -> Vec<Client> {
    let mut clients = Vec::new();
    while clients.len() < most {
        let mut client = client_at(address, from, subject).await;
        match client.allocate().await {
            Ok(_) => clients.push(client),
            Err(code) => {
                assert!(matches!(code, 486 | 508), "{code}");
                break;
            }
        }
    }
    clients
}

#[tokio::test]
async fn a_viewers_link_takes_neither_the_senders_nor_other_viewers_allocations() {
    let (_server, address) = server(set_limits(|limits| {
        limits.allocations_per_room = 24;
        limits.allocations_of_sender = 8;
        limits.allocations_per_token = 12;
        limits.allocations_per_token_and_address = 4;
        limits.unauthenticated_per_address = 1000;
    }));
    let viewer = Subject {
        room: "room",
        role: Role::Viewer,
        tokens: "link.owner",
        owner: "ada",
    };
    let first = take(address, [127, 0, 0, 11], &viewer, 99).await;
    let second = take(address, [127, 0, 0, 12], &viewer, 99).await;
    assert_eq!((first.len(), second.len()), (4, 4), "of each address");
    let honest = take(address, [127, 0, 0, 13], &viewer, 2).await;
    assert_eq!(honest.len(), 2, "the same link at another address");
    let third = take(address, [127, 0, 0, 14], &viewer, 99).await;
    assert_eq!(third.len(), 2, "of the token in all");
    let guest = Subject {
        tokens: "guest.owner.sender",
        ..viewer
    };
    let guests = take(address, [127, 0, 0, 11], &guest, 99).await;
    assert_eq!(guests.len(), 4, "another token at the same address");
    let other = Subject {
        tokens: "other.owner.sender",
        ..viewer
    };
    let refused = take(address, [127, 0, 0, 15], &other, 99).await;
    assert_eq!(refused.len(), 0, "the rest is the sender's");
    let sender = Subject {
        role: Role::Sender,
        tokens: "sender.owner",
        ..viewer
    };
    let senders = take(address, [127, 0, 0, 16], &sender, 99).await;
    assert_eq!(senders.len(), 8, "kept for the sender");
    let member = Subject {
        room: "call",
        role: Role::Member,
        tokens: "member.owner",
        owner: "bob",
    };
    let members = take(address, [127, 0, 0, 17], &member, 99).await;
    assert_eq!(members.len(), 12, "of a token that many share");
}

#[tokio::test]
async fn an_owner_gets_no_more_allocations_than_it_leaves_to_others() {
    let (_server, address) = server(set_limits(|limits| {
        limits.allocations = 16;
        limits.unauthenticated_per_address = 1000;
    }));
    for (number, most) in [("eve", 8), ("bob", 4), ("ada", 2)] {
        let sender = Subject {
            room: number,
            role: Role::Sender,
            tokens: number,
            owner: number,
        };
        let taken = take(address, [127, 0, 0, 21], &sender, 99).await;
        assert_eq!(taken.len(), most, "{number}");
        // They stay.
        taken.into_iter().for_each(std::mem::forget);
    }
}

/// Admits all but one token and one address, once that is asked for.
#[derive(Debug, Default)]
struct Refuses(AtomicBool);

impl Admission for Refuses {
    fn honours(&self, _: &str, tokens: &str) -> bool {
        !self.0.load(Relaxed) || !tokens.split('.').any(|name| name == "owner")
    }

    fn is_blocked(&self, address: IpAddr) -> bool {
        self.0.load(Relaxed) && address == IpAddr::from([127, 0, 0, 32])
    }
}

#[tokio::test]
async fn a_revoked_tokens_allocations_and_a_blocked_addresses_end_and_no_other_comes() {
    let refuses = Arc::new(Refuses::default());
    let admission = Arc::clone(&refuses);
    let (server, address) = server(move |config| config.admission = admission);
    let of = |tokens| Subject {
        room: "room",
        role: Role::Viewer,
        tokens,
        owner: "ada",
    };
    let mut revoked = client_at(address, [127, 0, 0, 31], &of("link.owner")).await;
    let mut blocked = client_at(address, [127, 0, 0, 32], &of("guest")).await;
    let mut stays = client_at(address, [127, 0, 0, 33], &of("guest")).await;
    for client in [&mut revoked, &mut blocked, &mut stays] {
        client.allocate().await.expect("lent");
    }
    assert_eq!(server.counts().allocations, 3);
    refuses.0.store(true, Relaxed);
    assert_eq!(revoked.refresh(600).await, Err(401), "its token is revoked");
    server.end_refused();
    let ended = async {
        while server.counts().allocations > 1 {
            pause().await;
        }
    };
    let ended = tokio::time::timeout(Duration::from_secs(20), ended).await;
    ended.expect("they end");
    assert_eq!(stays.refresh(600).await, Ok(600), "another token's");
    assert_eq!(revoked.allocate().await, Err(401), "no other");
    let stun = [
        0, 1, 0, 0, 0x21, 0x12, 0xA4, 0x42, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
    ];
    blocked.send(&stun).await;
    assert!(blocked.hears_nothing().await, "an answer to who is blocked");
    let counts = server.counts();
    assert!(counts.revoked >= 2 && counts.blocked >= 1, "{counts:?}");
}

#[tokio::test]
async fn a_flood_without_credentials_silences_its_own_address_alone() {
    let (server, address) = server(|_| {});
    let flood = UdpSocket::bind("127.0.0.41:0").await.expect("a socket");
    let mut allocate = vec![
        0, 3, 0, 8, 0x21, 0x12, 0xA4, 0x42, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
    ];
    let binding = [&[0, 1, 0, 0], &allocate[4..]].concat();
    allocate.extend([0, 0x19, 0, 4, 17, 0, 0, 0]);
    let mut answers = 0;
    let mut packet = [0; 256];
    for number in 0..4000 {
        let request = if number % 2 == 0 { &allocate } else { &binding };
        // The socket may be full.
        drop(flood.send_to(request, address).await);
        while flood.try_recv(&mut packet).is_ok() {
            answers += 1;
        }
        if number % 1000 == 999 {
            let from = [127, 0, 0, 42];
            let mut honest = Client::udp_from(from, address, credentials()).await;
            assert!(honest.binding().await.is_some(), "STUN elsewhere");
            honest.allocate().await.expect("lent elsewhere");
        }
    }
    pause().await;
    while flood.try_recv(&mut packet).is_ok() {
        answers += 1;
    }
    assert!(
        (100..600).contains(&answers),
        "{answers} answers to the flood"
    );
    assert!(server.counts().unanswered > 1000, "{:?}", server.counts());
}

#[tokio::test]
async fn connections_without_an_allocation_make_room_for_new_ones() {
    let (_server, address) = server(set_limits(|limits| {
        limits.connections = 12;
        limits.connections_per_address = 4;
    }));
    let open = async |last| {
        let socket = TcpSocket::new_v4().expect("a socket");
        socket.bind(([127, 0, 0, last], 0).into()).expect("bound");
        socket.connect(address).await.expect("a connection")
    };
    let mut held = Vec::new();
    for _ in 0..4 {
        for last in [51, 52, 53] {
            held.push(open(last).await);
        }
    }
    let mut honest = Client::tcp_on(open(54).await, credentials());
    honest.allocate().await.expect("lent");
    for last in [55, 56, 57, 58] {
        held.push(open(last).await);
    }
    assert_eq!(honest.refresh(600).await, Ok(600), "it is not closed");
}

#[tokio::test]
async fn peers_and_bytes_of_an_allocation_are_capped() {
    let (_server, address) = server(|config| {
        external(config);
        config.limits.peers_per_allocation = 4;
        config.limits.allocation_bytes_per_second = 20_000;
    });
    let mut one = Client::udp(address, credentials()).await;
    let mut two = Client::udp(address, credentials()).await;
    let [a, b] = [one.allocate().await, two.allocate().await].map(|lent| lent.expect("lent"));
    one.permit(b).await.expect("permitted");
    two.permit(a).await.expect("permitted");
    for last in 1..4 {
        assert_eq!(one.permit(([8, 8, 8, last], 1).into()).await, Ok(()));
    }
    assert_eq!(one.permit(([8, 8, 8, 4], 1).into()).await, Err(508));
    assert_eq!(one.permit(b).await, Ok(()), "renewed");
    let begin = Instant::now();
    let sent = 100;
    for _ in 0..sent {
        one.indicate(b, &[0; 972]).await;
    }
    let mut passed = 0;
    while !two.hears_nothing().await {
        passed += 1;
    }
    // A second's worth at once, and what the rate adds while this took.
    let seconds = 1 + usize::try_from(begin.elapsed().as_secs()).expect("short") + 1;
    assert!(
        (15..=20 * seconds).contains(&passed) && passed < sent,
        "{passed} of {sent} packets of 1000 bytes passed"
    );
}

#[tokio::test]
async fn requests_that_are_not_understood_are_refused_and_garbage_is_not_answered() {
    let (_server, address) = server(|_| {});
    let mut client = Client::udp(address, credentials()).await;
    let transport = |number| Plain(ATTR_REQUESTED_TRANSPORT, vec![number, 0, 0, 0]);
    client.allocate().await.expect("lent");
    client.refresh(0).await.expect("given back");
    let refused = client
        .exchange(METHOD_ALLOCATE, &[&transport(6)], true)
        .await;
    assert_eq!(refused.err(), Some(442), "a relay for TCP");
    let refused = client.exchange(METHOD_ALLOCATE, &[], true).await;
    assert_eq!(refused.err(), Some(400), "for nothing");
    let even = Plain(ATTR_EVEN_PORT, vec![0x80]);
    let refused = client
        .exchange(METHOD_ALLOCATE, &[&transport(17), &even], true)
        .await;
    assert_eq!(refused.err(), Some(420), "two ports");
    let mut random = fastrand::Rng::with_seed(20);
    for length in 0..300 {
        let mut packet = vec![0; length];
        random.fill(&mut packet);
        if let Some(first) = packet.first_mut() {
            *first &= 0x4F;
        }
        client.send(&packet).await;
    }
    assert!(client.hears_nothing().await, "an answer to garbage");
    assert_eq!(client.binding().await, Some(client.address()), "it lives");
}

#[tokio::test]
async fn strangers_get_few_answers() {
    let (_server, address) = server(set_limits(|limits| limits.unauthenticated_per_second = 5));
    let mut client = Client::udp(address, credentials()).await;
    let mut answers = 0;
    let begin = Instant::now();
    for _ in 0..5 {
        answers += usize::from(client.binding().await.is_some());
    }
    assert_eq!(answers, 5, "a second's worth");
    if begin.elapsed() < Duration::from_millis(150) {
        let stun = [
            0, 1, 0, 0, 0x21, 0x12, 0xA4, 0x42, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
        ];
        client.send(&stun).await;
        assert!(client.hears_nothing().await, "a sixth answer");
    }
}

#[tokio::test]
async fn a_connection_is_closed_when_it_is_idle_or_brings_what_is_no_packet() {
    let (_server, address) = server(set_limits(|limits| {
        limits.idle = Duration::from_millis(300);
        limits.connections_per_address = 3;
    }));
    let garbage: [&[u8]; 4] = [
        b"",
        b"GET / HTTP/1.1\r\n\r\n",
        &[0x00, 0x01, 0xFF, 0xFC, 0, 0],
        &[0x40, 0x00, 0xFF, 0xFF, 0, 0],
    ];
    for bytes in garbage {
        let mut stream = TcpStream::connect(address).await.expect("a connection");
        stream.write_all(bytes).await.expect("written");
        let mut answer = Vec::new();
        let read = tokio::time::timeout(Duration::from_secs(10), stream.read_to_end(&mut answer));
        let closed = read.await.expect("closed in time");
        assert!(matches!(closed, Ok(0) | Err(_)), "{answer:?} to {bytes:?}");
    }
    // A client with an allocation stays; strangers beyond the bound do not get in.
    let mut client = Client::tcp(address, credentials()).await;
    client.allocate().await.expect("lent");
    let mut held = Vec::new();
    for _ in 0..4 {
        held.push(TcpStream::connect(address).await.expect("a connection"));
    }
    pause().await;
    let mut refused = 0;
    for stream in &mut held {
        let mut byte = [0];
        let read = tokio::time::timeout(Duration::from_millis(20), stream.read(&mut byte));
        refused += usize::from(read.await.is_ok());
    }
    assert!(refused >= 2, "{refused} of 4 were refused at once");
    tokio::time::sleep(Duration::from_millis(600)).await;
    assert_eq!(client.refresh(600).await, Ok(600), "it is not idle");
    let local: IpAddr = client.address().ip();
    assert!(local.is_loopback());
}
