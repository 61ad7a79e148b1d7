//! What strangers, and those who have a link to a room, may not do.

use super::client::{Client, Plain};
use super::{credentials, external, key, pause, server, set_limits, unix_now};
use rtc::stun::attributes::{ATTR_EVEN_PORT, ATTR_REQUESTED_TRANSPORT};
use rtc::stun::message::METHOD_ALLOCATE;
use std::net::{IpAddr, SocketAddr};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpStream, UdpSocket};
use turn_server::Key;
use turn_server::credentials::Credentials;

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
            limits.allocations_per_subject = per_room;
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
