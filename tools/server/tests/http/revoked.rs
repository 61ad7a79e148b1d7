//! Tokens that an operator takes back while the server runs, and what was open with them.

use crate::calls::rooms;
use crate::support::{Caller, OFFER, Outcome, PATIENCE, Presence, Room, TestServer};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

/// Takes this token back.
fn revoke(caller: &Caller, file: &Path, token: &str) -> Outcome {
    let (name, _) = caller.secret.look_at_token(token).ok_or("genuine")?;
    Ok(server::revoke(file, name)?)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_operator_takes_any_token_back_while_the_server_runs() -> Outcome {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("revoked");
    let list = file.clone();
    let server = TestServer::start_with(|config| config.revoked = Some(list)).await?;
    let caller = &server.caller;
    let (ada, eve) = (caller.owner("ada"), caller.owner("eve"));
    let open = |token: String| {
        let open = caller.request(Method::POST, "/v1/rooms", &token);
        async move { Ok::<_, reqwest::Error>(open.send().await?.status()) }
    };
    assert_eq!(open(ada.clone()).await?, StatusCode::CREATED);
    revoke(caller, &file, &ada)?;
    let begun = Instant::now();
    while open(ada.clone()).await? != StatusCode::UNAUTHORIZED {
        assert!(begun.elapsed() < PATIENCE, "never revoked");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(open(eve).await?, StatusCode::CREATED, "another's");
    assert_eq!(
        open(caller.owner("ada")).await?,
        StatusCode::CREATED,
        "a new one of hers"
    );
    Ok(())
}

/// Waits until the stream has ended: soon, for who has no right to it hears of everybody meanwhile. Its comments alone would go on for a day.
async fn ends(stream: &mut Presence) -> Outcome {
    let ended = async {
        // Those who are there leave, and nobody comes any more.
        while let Some((name, _)) = stream.next().await? {
            assert_eq!(name, "leave", "nothing else comes");
        }
        Outcome::Ok(())
    };
    let ended = tokio::time::timeout(Duration::from_secs(20), ended);
    ended.await.map_err(|_| "the stream goes on")?
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_that_is_taken_back_ends_the_presence_that_was_entered_with_it() -> Outcome {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("revoked");
    let list = file.clone();
    let server = TestServer::start_with(|config| config.revoked = Some(list)).await?;
    let caller = &server.caller;
    let (room, other) = (caller.room("ada").await?, caller.room("ada").await?);
    let call = caller.call("ada").await?;
    let put = caller.put_package(crate::support::package(), &call.member);
    assert_eq!(put.await?.status(), StatusCode::CREATED);
    let seats = rooms(&caller.seats(&call).await?);
    let mut sender = caller.enter(&room).await?;
    let mut stays = caller.enter(&other).await?;
    // A stranger sits in a call.
    let mut stranger = Presence::new(caller.sit(&call, &seats[0], "o1").await?);
    let seat = call.seat(&seats[0]);
    caller.meet(&seat, &mut stranger).await?;

    revoke(caller, &file, &call.member)?;
    ends(&mut stranger).await?;
    let again = caller.sit(&call, &seats[1], "o1").await?.status();
    assert_eq!(again, StatusCode::UNAUTHORIZED, "no other seat");
    caller.meet(&room, &mut sender).await?;

    revoke(caller, &file, &room.sender)?;
    ends(&mut sender).await?;
    let again = caller.announce(&room).await?.status();
    assert_eq!(again, StatusCode::UNAUTHORIZED, "nor back");
    let joined = caller.request(Method::POST, &format!("{}/whep", room.path()), &room.viewer);
    let joined = joined.header("content-type", "application/sdp").body(OFFER);
    let joined = joined.send().await?.status();
    assert_eq!(joined, StatusCode::SERVICE_UNAVAILABLE, "the room is empty");

    caller.meet(&other, &mut stays).await?;
    let there = caller.metric("mon3tr_rooms ").await?;
    assert_eq!(there, 1, "the other sender's alone");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewers_session_ends_with_its_token_and_a_room_with_its_owners() -> Outcome {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("revoked");
    let list = file.clone();
    let server = TestServer::start_with(|config| config.revoked = Some(list)).await?;
    let caller = &server.caller;
    let owner = caller.owner("ada");
    let put = caller
        .put_package(crate::support::package(), &owner)
        .await?;
    assert_eq!(put.status(), StatusCode::CREATED);
    let opened = caller.request(Method::POST, "/v1/rooms", &owner);
    let opened: Value = opened.send().await?.json().await?;
    let text = |key: &str| opened[key].as_str().unwrap_or_default().to_owned();
    let room = Room {
        id: text("room"),
        sender: text("sender_token"),
        viewer: text("viewer_token"),
    };
    let mut sender = caller.enter(&room).await?;
    let added = format!("{}/viewers", room.path());
    let added = caller.request(Method::POST, &added, &room.sender);
    let added: Value = added.send().await?.json().await?;
    let guest = Room {
        viewer: added["viewer_token"].as_str().ok_or("no token")?.to_owned(),
        ..room.clone()
    };
    let stays = caller.meet(&room, &mut sender).await?;
    let session = caller.meet(&guest, &mut sender).await?;

    revoke(caller, &file, &guest.viewer)?;
    let left = sender.next().await?;
    let expected = json!({ "session": session });
    assert_eq!(left, Some(("leave".into(), expected)), "the guest's alone");

    // What an owner's token has opened ends with it, and what the sender has given.
    revoke(caller, &file, &owner)?;
    let mut ended = Vec::new();
    while let Some((name, session)) = sender.next().await? {
        assert_eq!(name, "leave", "nothing else comes");
        ended.push(session);
    }
    assert!(ended.contains(&json!({ "session": stays })), "{ended:?}");
    for token in [&room.sender, &room.viewer, &guest.viewer] {
        let status = caller.get(&room.path(), token).await?.status();
        assert_eq!(status, StatusCode::UNAUTHORIZED, "made with it");
    }
    let line = "mon3tr_tokens_refused_total{reason=\"Revoked\"} ";
    assert!(caller.metric(line).await? >= 3, "counted");
    Ok(())
}
