//! Rooms: which token may enter, the events, and a sender that comes again.

use crate::support::{OFFER, Outcome, TestServer, announcement, package};
use link_protocol::Refusal;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::time::Duration;

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_meets_the_sender_and_leaves_again() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let before = caller.get(&room.path(), &room.viewer).await?;
    assert_eq!(
        before.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "not there"
    );
    assert!(
        before.headers().contains_key("retry-after"),
        "when to retry"
    );
    assert_eq!(
        caller.join(&room).await?.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "nor joined"
    );

    let mut sender = caller.enter(&room).await?;
    for token in [&room.viewer, &room.sender] {
        let told: Value = caller.get(&room.path(), token).await?.json().await?;
        assert_eq!(told, announcement(), "the announcement as it was sent");
    }
    assert_eq!(caller.metric("mon3tr_rooms ").await?, 1, "one room");
    let session = caller.meet(&room, &mut sender).await?;
    let second = caller.meet(&room, &mut sender).await?;
    assert_ne!(session, second, "sessions differ");
    assert_eq!(
        caller.metric("mon3tr_viewers_joined_total ").await?,
        2,
        "two joined"
    );

    caller.part(&room, &session, &mut sender).await?;

    drop(sender);
    // The server sees a closed connection at its next write at the latest.
    let mut there = StatusCode::OK;
    for _ in 0..100 {
        there = caller.get(&room.path(), &room.viewer).await?.status();
        if there == StatusCode::SERVICE_UNAVAILABLE {
            break;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(
        there,
        StatusCode::SERVICE_UNAVAILABLE,
        "gone with its stream"
    );
    assert_eq!(caller.metric("mon3tr_rooms ").await?, 0, "no room");
    server.server.stop().await;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sender_that_does_not_answer_costs_its_viewer_a_504_and_an_answer_without_a_waiting_viewer_is_a_404()
-> Outcome {
    let server =
        TestServer::start_with(|c| c.limits.answer_within = Duration::from_millis(300)).await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    let joined = caller.join(&room).await?;
    assert_eq!(joined.status(), StatusCode::GATEWAY_TIMEOUT, "unanswered");
    let session = sender.offer().await?;
    assert_eq!(
        caller.answer(&room, &session).await?,
        StatusCode::NOT_FOUND,
        "too late"
    );
    let never = "0".repeat(32);
    assert_eq!(
        caller.answer(&room, &never).await?,
        StatusCode::NOT_FOUND,
        "never offered"
    );
    caller.meet(&room, &mut sender).await?;
    assert_eq!(
        caller.answer(&room, &session).await?,
        StatusCode::NOT_FOUND,
        "answered twice"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn another_sender_with_the_same_token_replaces_the_first_and_comments_keep_the_stream_alive()
-> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let mut first = caller.enter(&room).await?;
    while first.comments < 3 {
        assert!(first.read().await?, "the stream stays open");
    }
    let mut second = caller.enter(&room).await?;
    assert_eq!(
        first.next().await?,
        Some(("replaced".into(), json!({}))),
        "told"
    );
    assert_eq!(first.next().await?, None, "ended");
    caller.meet(&room, &mut second).await?;
    assert_eq!(caller.metric("mon3tr_rooms ").await?, 1, "still one room");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sender_whose_stream_broke_comes_again_and_new_viewers_join() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    let session = caller.meet(&room, &mut sender).await?;
    drop(sender);
    let mut sender = caller.enter(&room).await?;
    caller.meet(&room, &mut sender).await?;
    // A viewer that joined before can still leave.
    caller.part(&room, &session, &mut sender).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stopping_server_ends_the_stream_and_another_with_the_same_secret_goes_on() -> Outcome {
    let first = TestServer::start().await?;
    let room = first.caller.room("ada").await?;
    let mut sender = first.caller.enter(&room).await?;
    let secret = first.caller.secret.clone();
    first.server.stop().await;
    assert_eq!(sender.next().await?, None, "the stream ends");
    let folder = first.folder.path().to_path_buf();
    let second = TestServer::start_with(|c| {
        c.secret = secret;
        c.store = server::StoreConfig::Local(folder);
    })
    .await?;
    let mut sender = second.caller.enter(&room).await?;
    second.caller.meet(&room, &mut sender).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_announcement_is_checked_before_the_sender_is_let_in() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.empty_room("ada").await?;
    // Another owner's package counts as missing.
    caller.room("eve").await?;
    assert_eq!(
        caller.announce(&room).await?.status(),
        StatusCode::NOT_FOUND,
        "not ada's"
    );
    let room = caller.room("ada").await?;
    let path = format!("{}/presence", room.path());
    for (key, wrong) in [
        ("channel", json!("carrier pigeon")),
        ("codec", json!(7)),
        ("rate_hz", json!(0.0)),
        ("rate_hz", json!(1e9)),
        (
            "avatar",
            json!({ "sha256": "../../etc/passwd", "bytes": 1 }),
        ),
        ("avatar", json!({ "sha256": package().hash, "bytes": 1 })),
    ] {
        let mut body = announcement();
        body[key] = wrong;
        let answer = caller
            .request(Method::POST, &path, &room.sender)
            .json(&body)
            .send()
            .await?;
        assert_eq!(answer.status(), StatusCode::UNPROCESSABLE_ENTITY, "{body}");
        let error: Value = answer.json().await?;
        assert!(error["error"].is_string(), "a sentence: {error}");
    }
    let long = vec![b' '; 100_000];
    let answer = caller
        .request(Method::POST, &path, &room.sender)
        .body(long)
        .send()
        .await?;
    assert_eq!(answer.status(), StatusCode::PAYLOAD_TOO_LARGE, "too long");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_offer_that_is_no_sdp_or_too_long_never_reaches_the_sender() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    let path = format!("{}/whep", room.path());
    let long = format!("{OFFER}{}", "a=x\r\n".repeat(20_000));
    for (kind, body, status) in [
        (
            "text/plain",
            OFFER.to_owned(),
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
        ),
        (
            "application/sdp",
            "hello".to_owned(),
            StatusCode::UNPROCESSABLE_ENTITY,
        ),
        ("application/sdp", long, StatusCode::PAYLOAD_TOO_LARGE),
    ] {
        let request = caller.request(Method::POST, &path, &room.viewer);
        let answer = request
            .header("content-type", kind)
            .body(body)
            .send()
            .await?;
        assert_eq!(answer.status(), status, "{kind}");
    }
    // The next that the sender hears of is a proper one.
    caller.meet(&room, &mut sender).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn rooms_and_waiting_viewers_are_bounded() -> Outcome {
    let server = TestServer::start_with(|c| {
        c.limits.rooms_per_owner = 2;
        c.limits.rooms = 3;
        c.limits.waiting_per_room = 2;
    })
    .await?;
    let caller = &server.caller;
    let mut rooms = Vec::new();
    for _ in 0..3 {
        rooms.push(caller.room("ada").await?);
    }
    let mut first = caller.enter(&rooms[0]).await?;
    let _second = caller.enter(&rooms[1]).await?;
    let third = caller.announce(&rooms[2]).await?.status();
    assert_eq!(third, StatusCode::SERVICE_UNAVAILABLE, "ada's third");
    let bob = caller.enter(&caller.room("bob").await?).await?;
    let cleo = caller.room("cleo").await?;
    let fourth = caller.announce(&cleo).await?.status();
    assert_eq!(
        fourth,
        StatusCode::SERVICE_UNAVAILABLE,
        "the server's fourth"
    );
    drop(bob);

    // Two wait, and the third gets a 503.
    let join = |room: &crate::support::Room| {
        let (caller, room) = (caller.clone(), room.clone());
        tokio::spawn(async move { caller.join(&room).await })
    };
    let waiting = [join(&rooms[0]), join(&rooms[0])];
    let sessions = [first.offer().await?, first.offer().await?];
    let refused = caller.join(&rooms[0]).await?;
    assert_eq!(
        refused.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "too many"
    );
    for session in &sessions {
        assert_eq!(
            caller.answer(&rooms[0], session).await?,
            StatusCode::NO_CONTENT,
            "answered"
        );
    }
    for viewer in waiting {
        assert_eq!(viewer.await??.status(), StatusCode::CREATED, "joined");
    }
    // And then there is room again.
    caller.meet(&rooms[0], &mut first).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn who_is_refused_by_the_sender_is_not_counted_as_joined() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    let joined = "mon3tr_viewers_joined_total ";
    for refusal in [Refusal::Wait, Refusal::Wait, Refusal::Full] {
        let joining = tokio::spawn({
            let (caller, room) = (caller.clone(), room.clone());
            async move { caller.join(&room).await }
        });
        let session = sender.offer().await?;
        let path = format!("{}/sessions/{session}/answer", room.path());
        let answer = caller.request(Method::PUT, &path, &room.sender);
        let answer = answer.header("content-type", "application/sdp");
        let answer = answer.body(refusal.answer()).send().await?;
        assert_eq!(answer.status(), StatusCode::NO_CONTENT);
        assert_eq!(joining.await??.text().await?, refusal.answer());
        assert_eq!(caller.metric(joined).await?, 0, "{refusal:?}");
    }
    caller.meet(&room, &mut sender).await?;
    assert_eq!(caller.metric(joined).await?, 1, "let in");
    Ok(())
}
