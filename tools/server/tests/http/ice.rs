//! The STUN and TURN servers that senders and viewers are told.

use crate::support::{Outcome, TestServer, announcement, unix_now};
use serde_json::{Value, json};
use server::TurnConfig;
use std::net::SocketAddr;

#[tokio::test(flavor = "multi_thread")]
async fn bearers_are_told_the_servers_relay_with_credentials_that_end() -> Outcome {
    let server = TestServer::start_with(|config| {
        config.stun = vec!["stun:stun.example:3479".parse().expect("an address")];
        config.turn = Some(TurnConfig::new(SocketAddr::from(([127, 0, 0, 1], 0))));
    })
    .await?;
    let turn = server.server.turn_address().ok_or("no relay")?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    let told = sender.ice_servers().await?;
    let mut told: Vec<Value> = vec![told];
    for token in [&room.viewer, &room.sender] {
        let mut status: Value = caller.get(&room.path(), token).await?.json().await?;
        told.push(status["ice_servers"].take());
        for (field, value) in announcement().as_object().ok_or("an object")? {
            assert_eq!(&status[field], value, "{field} stands beside it");
        }
    }
    let owner = server::Id::of_owner("ada").to_string();
    // The presence's, and each token's own.
    let tokens = [&room.sender, &room.viewer, &room.sender];
    for ((servers, token), role) in told.iter().zip(tokens).zip(["s", "v", "s"]) {
        let address = format!("127.0.0.1:{}", turn.port());
        assert_eq!(servers[0], json!({"urls": ["stun:stun.example:3479"]}));
        assert_eq!(servers[1], json!({"urls": [format!("stun:{address}")]}));
        assert_eq!(
            servers[2]["urls"],
            json!([
                format!("turn:{address}?transport=udp"),
                format!("turn:{address}?transport=tcp")
            ]),
            "without a certificate no TLS"
        );
        let user = servers[2]["username"].as_str().ok_or("no name")?;
        let (expires, subject) = user.split_once(':').ok_or("no expiry")?;
        let lifetime = expires.parse::<u64>()?.saturating_sub(unix_now());
        assert!((3500..=3600).contains(&lifetime), "an hour: {lifetime} s");
        let (name, _) = caller.secret.look_at_token(token).ok_or("genuine")?;
        let begin = format!("{}:{role}:{name}.", room.id);
        assert!(subject.starts_with(&begin), "{subject}");
        assert!(subject.ends_with(&format!(":{owner}")), "{subject}");
        let password = servers[2]["credential"].as_str().ok_or("no password")?;
        assert_eq!(password.len(), 28, "HMAC-SHA1 in Base64");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_credential_ends_with_its_token_and_a_server_without_relay_tells_none() -> Outcome {
    let server = TestServer::start_with(|config| {
        config.turn = Some(TurnConfig::new(SocketAddr::from(([127, 0, 0, 1], 0))));
    })
    .await?;
    let caller = &server.caller;
    let room = caller.room_for("ada", 60).await?;
    let mut sender = caller.enter(&room).await?;
    let told = sender.ice_servers().await?;
    let user = told[1]["username"].as_str().ok_or("no name")?;
    let (expires, _) = user.split_once(':').ok_or("no expiry")?;
    let lifetime = expires.parse::<u64>()?.saturating_sub(unix_now());
    assert!(lifetime <= 60, "the token's: {lifetime} s");

    let plain = TestServer::start().await?;
    let room = plain.caller.room("ada").await?;
    let _sender = plain.caller.enter(&room).await?;
    let status: Value = plain
        .caller
        .get(&room.path(), &room.viewer)
        .await?
        .json()
        .await?;
    assert_eq!(status, announcement(), "as before there were any");
    Ok(())
}
