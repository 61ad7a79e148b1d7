//! Two peers in one process, directly and by a relay.

use super::*;
use crate::plan::{Planner, RelayTransport};
use crate::sdp::tests::offer;
use link_protocol::IceServers;
use link_protocol::ice::IceServer;
use std::net::UdpSocket;

fn loopback() -> Plan {
    Plan {
        local: vec![([127, 0, 0, 1], 0).into()],
        ..Plan::default()
    }
}

/// A description with the candidates of one kind only.
fn only(kind: &str, sdp: &str) -> Description {
    let mut description = Description::read(sdp).expect("a description");
    description
        .candidates
        .retain(|candidate| candidate.kind == kind);
    assert!(!description.candidates.is_empty(), "{sdp}");
    description
}

fn read(sdp: &str) -> Description {
    Description::read(sdp).expect("a description")
}

#[tokio::test]
async fn two_peers_with_no_other_way_are_relayed_over_udp_and_over_tcp() {
    let key = turn_server::Key::new([5; 32]);
    let listen = ([127, 0, 0, 1], 0).into();
    let server = turn_server::TurnServer::start(turn_server::Config::new(listen, key.clone()))
        .expect("a relay");
    let issued = key.issue("room", 4_000_000_000);
    let here = "http://127.0.0.1:1".parse().expect("an address");
    // To a port where nothing listens UDP is as good as blocked.
    let nowhere = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    for (transport, udp) in [
        (RelayTransport::Udp, server.address()),
        (
            RelayTransport::Tcp,
            nowhere.local_addr().expect("an address"),
        ),
    ] {
        let servers = IceServers::try_from(vec![IceServer {
            urls: vec![
                format!("turn:{udp}?transport=udp"),
                format!("turn:{}?transport=tcp", server.address()),
            ],
            username: Some(issued.username.clone()),
            credential: Some(issued.password.clone()),
        }]);
        let planner = Planner::default();
        let plan = planner.plan(&here, &servers.expect("servers")).await;
        let relay = plan.relay.clone().expect("a relay");
        assert_eq!(relay.transport, transport, "as far as UDP leads");
        let mode = ChannelMode::Unreliable;
        let (mut viewer, offer) = Peer::offer(plan.clone(), mode).await.expect("an offer");
        let offer = only("relay", &offer);
        let (mut sender, answer) = Peer::answer(plan, mode, &offer).await.expect("an answer");
        let answer = only("relay", &answer);
        viewer.accept(&answer).await.expect("a good answer");
        for peer in [&mut viewer, &mut sender] {
            peer.opened().await.expect("an open channel");
            let path = peer.path().await.expect("a path");
            assert!(path.is_relayed(), "{path:?}");
            assert_eq!(path.relay, Some(relay.clone()), "{path:?}");
            assert!(!path.is_cut(), "{path:?}");
        }
        sender.try_send(b"motion").await;
        let message = viewer.next().await;
        assert!(
            matches!(&message, PeerEvent::Message(bytes) if bytes[..] == *b"motion"),
            "{message:?}"
        );
    }
}

#[test]
fn only_a_browser_that_hides_its_addresses_has_them_looked_up() {
    let mode = |address: &str| {
        let line = format!("a=candidate:1 1 udp 2113937151 {address} 5000 typ host\r\n");
        mdns_for(&read(&offer(&line)).candidates.iter().collect::<Vec<_>>())
    };
    assert_eq!(
        mode("192.168.1.2"),
        MulticastDnsMode::Disabled,
        "an address"
    );
    let hidden = mode("0f5f33ad-68fd-4d2f-9ec2-6b0fc5c3ba0f.local");
    let possible = MulticastSocket::new().into_std().is_ok();
    assert_eq!(
        hidden == MulticastDnsMode::QueryOnly,
        possible,
        "{hidden:?}"
    );
}

#[tokio::test]
async fn two_peers_connect_and_disconnect() {
    for mode in [ChannelMode::Unreliable, ChannelMode::Reliable] {
        let (mut viewer, offer) = Peer::offer(loopback(), mode).await.expect("an offer");
        let (mut sender, answer) = Peer::answer(loopback(), mode, &read(&offer))
            .await
            .expect("an answer");
        viewer.accept(&read(&answer)).await.expect("a good answer");
        for peer in [&mut viewer, &mut sender] {
            peer.opened().await.expect("an open channel");
        }
        assert_eq!(
            sender.try_send(b"motion").await,
            SendOutcome::Queued,
            "{mode}"
        );
        let message = viewer.next().await;
        assert!(
            matches!(&message, PeerEvent::Message(bytes) if bytes[..] == *b"motion"),
            "{message:?} on a {mode} channel"
        );
        // A voice goes the same way; its track may open a moment later than the channels.
        let packet = |number: u32| (number * 960, Bytes::from(format!("opus {number}")));
        let mut heard = None;
        for number in 0..100 {
            let (timestamp, opus) = packet(number);
            sender.send_voice(timestamp, opus).await;
            if let Ok(PeerEvent::Voice(VoicePacket { timestamp, opus })) =
                tokio::time::timeout(Duration::from_millis(20), viewer.next()).await
            {
                heard = Some((timestamp, opus));
                break;
            }
        }
        let (timestamp, opus) = heard.expect("a packet of voice");
        assert_eq!((timestamp, opus), packet(timestamp / 960), "{mode}");
        // Neither pushes out the other where none is read for a while.
        let pause = || tokio::time::sleep(Duration::from_millis(300));
        for number in (100u32..).take(2 * MAX_WAITING) {
            let (timestamp, opus) = packet(number);
            assert!(sender.send_voice(timestamp, opus).await, "it is taken");
            tokio::task::yield_now().await;
        }
        pause().await;
        assert_eq!(sender.try_send(b"after").await, SendOutcome::Queued);
        pause().await;
        let (mut voices, mut messages) = (Vec::new(), 0);
        while let Ok(event) = tokio::time::timeout(Duration::from_millis(100), viewer.next()).await
        {
            match event {
                PeerEvent::Voice(VoicePacket { timestamp, opus }) => {
                    assert_eq!((timestamp, opus), packet(timestamp / 960), "as it was sent");
                    voices.push(timestamp);
                }
                PeerEvent::Message(bytes) => {
                    assert_eq!(bytes, b"after"[..]);
                    messages += 1;
                }
                event => panic!("{event:?}"),
            }
        }
        assert_eq!(voices.len(), MAX_VOICE_WAITING, "what may wait: {voices:?}");
        assert!(voices.is_sorted_by(|a, b| a < b), "in order: {voices:?}");
        assert_eq!(messages, 1, "the message came, behind the voice");
        viewer.close().await;
        let last = tokio::time::timeout(Duration::from_secs(4), sender.next()).await;
        assert!(matches!(last, Ok(PeerEvent::Closed)), "{last:?}");
    }
}

/// A viewer's and a sender's end, connected.
async fn connected() -> (Peer, Peer) {
    let mode = ChannelMode::Unreliable;
    let (mut viewer, offer) = Peer::offer(loopback(), mode).await.expect("an offer");
    let answered = Peer::answer(loopback(), mode, &read(&offer)).await;
    let (mut sender, answer) = answered.expect("an answer");
    viewer.accept(&read(&answer)).await.expect("a good answer");
    for peer in [&mut viewer, &mut sender] {
        peer.opened().await.expect("an open channel");
    }
    (viewer, sender)
}

#[tokio::test]
async fn a_connection_ends_whose_other_side_opens_a_channel_in_band() {
    for is_viewer in [true, false] {
        let (viewer, sender) = connected().await;
        let (attacker, mut other) = if is_viewer {
            (viewer, sender)
        } else {
            (sender, viewer)
        };
        let channel = attacker.connection.create_data_channel("another", None);
        let _channel = channel.await.expect("it may ask");
        let ended = async { while !matches!(other.next().await, PeerEvent::Closed) {} };
        let ended = tokio::time::timeout(Duration::from_secs(4), ended).await;
        assert!(ended.is_ok(), "the viewer: {is_viewer}");
    }
}

#[tokio::test]
async fn a_connection_with_another_certificate_than_the_signed_one_ends_in_words() {
    let mode = ChannelMode::Unreliable;
    // What the library reads stays as it is: the comparison does not depend on it.
    let other = |peer: &Peer| {
        let signed = peer.signed.clone().expect("a certificate").to_string();
        let first = signed.find(' ').expect("digits") + 1;
        let digit = if signed[first..].starts_with('0') {
            "1"
        } else {
            "0"
        };
        let text = format!("{}{digit}{}", &signed[..first], &signed[first + 1..]);
        let sdp = format!("v=0\r\na=fingerprint:{text}\r\n");
        read(&sdp).fingerprints().expect("a certificate").clone()
    };
    for is_viewer_deceived in [true, false] {
        let (mut viewer, offer) = Peer::offer(loopback(), mode).await.expect("an offer");
        let answered = Peer::answer(loopback(), mode, &read(&offer)).await;
        let (mut sender, answer) = answered.expect("an answer");
        viewer.accept(&read(&answer)).await.expect("a good answer");
        let deceived = if is_viewer_deceived {
            &mut viewer
        } else {
            &mut sender
        };
        deceived.signed = Some(other(deceived));
        let opened = tokio::time::timeout(Duration::from_secs(10), deceived.opened()).await;
        let refused = opened.expect("it does not wait");
        assert!(
            matches!(refused, Err(CallError::OtherCertificate)),
            "{refused:?}"
        );
        assert_eq!(deceived.try_send(b"motion").await, SendOutcome::Closed);
    }
}

#[tokio::test]
async fn a_relay_is_named_by_its_ipv6_address_too() {
    let key = turn_server::Key::new([5; 32]);
    let listen = SocketAddr::from((std::net::Ipv6Addr::LOCALHOST, 0));
    if UdpSocket::bind(listen).is_err() {
        println!("skipped: this machine has no IPv6");
        return;
    }
    let server = turn_server::TurnServer::start(turn_server::Config::new(listen, key.clone()));
    let server = server.expect("a relay");
    let issued = key.issue("room", 4_000_000_000);
    let servers = IceServers::try_from(vec![IceServer {
        urls: vec![format!("turn:{}?transport=udp", server.address())],
        username: Some(issued.username.clone()),
        credential: Some(issued.password.clone()),
    }]);
    let here = "http://[::1]:1".parse().expect("an address");
    let planner = Planner::default();
    let plan = planner.plan(&here, &servers.expect("servers")).await;
    assert!(plan.relay.is_some(), "it answers");
    let plan = Plan {
        local: vec![(std::net::Ipv6Addr::LOCALHOST, 0).into()],
        ..plan
    };
    let offer = Peer::offer(plan, ChannelMode::Unreliable).await;
    let (_viewer, offer) = offer.expect("an offer");
    assert!(offer.contains("typ relay"), "{offer}");
}

#[tokio::test]
async fn a_side_that_shows_another_certificate_is_found_by_the_library_too() {
    let mode = ChannelMode::Unreliable;
    let (mut viewer, offer) = Peer::offer(loopback(), mode).await.expect("an offer");
    let answered = Peer::answer(loopback(), mode, &read(&offer)).await;
    let (mut sender, answer) = answered.expect("an answer");
    // A server in the middle of the packets alone: descriptions pass as they are, and their certificates are not those
    // of the connection.
    let signed = read(&answer)
        .fingerprints()
        .expect("one")
        .to_string()
        .to_ascii_uppercase();
    let signed = signed.split(' ').nth(1).expect("digits").to_owned();
    let digit = if signed.starts_with('0') { "1" } else { "0" };
    let other = format!("{digit}{}", &signed[1..]);
    let answer = answer.replace(&signed, &other);
    viewer.accept(&read(&answer)).await.expect("a good answer");
    for peer in [&mut viewer, &mut sender] {
        let opened = tokio::time::timeout(Duration::from_secs(3), peer.opened()).await;
        assert!(!matches!(opened, Ok(Ok(()))), "{opened:?}");
    }
    assert!(viewer.path().await.is_some(), "packets pass");
}
