//! What a client gets.

use super::client::Client;
use super::{credentials, external, pause, server, set_limits};
use std::net::SocketAddr;
use std::time::Duration;

#[tokio::test]
async fn two_clients_exchange_packets_in_indications_and_channels_over_udp_and_tcp() {
    let (_server, address) = server(external);
    for carriers in [[false, false], [false, true], [true, true]] {
        let mut clients = Vec::new();
        for tcp in carriers {
            clients.push(if tcp {
                Client::tcp(address, credentials()).await
            } else {
                Client::udp(address, credentials()).await
            });
        }
        let [one, two] = &mut clients[..] else {
            unreachable!("two")
        };
        assert_eq!(one.binding().await, Some(one.address()), "STUN");
        let [a, b] = [one.allocate().await, two.allocate().await].map(|lent| lent.expect("lent"));
        assert_eq!(a.ip().to_string(), "203.0.113.7", "as the world sees it");
        assert_ne!(a, b);
        // Nothing passes before both sides have allowed it.
        one.indicate(b, b"early").await;
        one.permit(b).await.expect("permitted");
        one.indicate(b, b"not allowed there").await;
        assert!(two.hears_nothing().await, "a permission of one side only");
        two.permit(a).await.expect("permitted");
        one.indicate(b, b"hello").await;
        assert_eq!(two.data().await, Some((a, b"hello".to_vec())));
        two.bind(0x4001, a).await.expect("a channel");
        two.send_on(0x4001, b"odd").await;
        assert_eq!(one.data().await, Some((b, b"odd".to_vec())));
        one.indicate(b, b"back").await;
        let channel = SocketAddr::from(([0, 0, 0, 0], 0x4001));
        assert_eq!(two.data().await, Some((channel, b"back".to_vec())));
        // A channel is one peer's, and a peer has one channel.
        assert_eq!(two.bind(0x4002, a).await, Err(400), "another channel");
        assert_eq!(two.bind(0x4001, b).await, Err(400), "another peer");
        assert_eq!(two.bind(0x4001, a).await, Ok(()), "again");
        assert_eq!(two.bind(0x5000, a).await, Err(400), "no channel's number");
        // A lent address is gone once it is given back.
        assert_eq!(two.refresh(0).await, Ok(0));
        one.indicate(b, b"late").await;
        assert!(two.hears_nothing().await, "after the end");
        assert_eq!(two.refresh(600).await, Err(437), "there is none");
    }
}

#[tokio::test]
async fn an_allocation_ends_when_it_expires_and_lives_on_when_it_is_refreshed() {
    let (_server, address) = server(set_limits(|limits| {
        limits.lifetime = Duration::from_secs(2);
        limits.age = Duration::from_secs(1000);
    }));
    let mut one = Client::udp(address, credentials()).await;
    one.allocate().await.expect("lent");
    assert_eq!(one.refresh(3600).await, Ok(2), "bounded");
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert_eq!(one.refresh(3600).await, Ok(2), "still there");
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert_eq!(one.refresh(3600).await, Ok(2), "refreshed");
    tokio::time::sleep(Duration::from_millis(2500)).await;
    assert_eq!(one.refresh(3600).await, Err(437), "expired");
    one.allocate().await.expect("lent again");
}

#[tokio::test]
async fn a_closed_connection_gives_its_address_back() {
    let (_server, address) = server(set_limits(|limits| limits.allocations = 1));
    let mut one = Client::tcp(address, credentials()).await;
    one.allocate().await.expect("lent");
    let mut two = Client::udp(address, credentials()).await;
    assert_eq!(two.allocate().await, Err(508), "there is only one");
    drop(one);
    let mut again = two.allocate().await;
    for _ in 0..50 {
        if again.is_ok() {
            break;
        }
        pause().await;
        again = two.allocate().await;
    }
    again.expect("lent");
}
