use std::time::{Duration, SystemTime};

use axum::http::{Method, header};
use link_http::HttpError;
use link_protocol::{Name, ProtocolError, RoomLink, announcement::ChannelMode};

use crate::{
    client,
    server::{Fault, Server, TOKEN},
};

/// A server that answers one request with these bytes; the task returns the request's bytes.
async fn raw(answer: String) -> (RoomLink, tokio::task::JoinHandle<String>) {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0")
        .await
        .expect("a port");
    let link = format!(
        "http://{}/pre/rooms/R-1#{TOKEN}",
        listener.local_addr().expect("bound")
    )
    .parse()
    .expect("a link");
    let asked = tokio::spawn(async move {
        let (mut socket, _) = listener.accept().await.expect("a client");
        let mut asked = vec![0; 1 << 16];
        // The client's small requests come in one or two pieces; a head with a body ends with the body's last word.
        let mut got = 0;
        loop {
            got += socket.read(&mut asked[got..]).await.expect("a request");
            let text = String::from_utf8_lossy(&asked[..got]).to_lowercase();
            let Some((head, body)) = text.split_once("\r\n\r\n") else {
                continue;
            };
            let length = head
                .lines()
                .find_map(|line| line.strip_prefix("content-length: ")?.parse().ok())
                .unwrap_or(0);
            if body.len() >= length {
                break;
            }
        }
        socket.write_all(answer.as_bytes()).await.expect("answered");
        String::from_utf8_lossy(&asked[..got]).into_owned()
    });
    (link, asked)
}

fn http(status: &str, headers: &str, body: &str) -> String {
    format!(
        "HTTP/1.1 {status}\r\n{headers}content-length: {}\r\nconnection: close\r\n\r\n{body}",
        body.len()
    )
}

#[tokio::test]
async fn a_room_is_opened_and_its_links_lead_back_to_this_server() {
    let body = r#"{"room":"R7","sender_token":"s.1","viewer_token":"v.2","expires":2000000000}"#;
    let (link, asked) = raw(http("201 Created", "", body)).await;
    let room = client()
        .open_room(link.server(), "owner.3", Some(Duration::from_secs(60)))
        .await
        .expect("a room");
    assert_eq!(
        room.sender.to_string(),
        format!("{}/rooms/R7#s.1", link.server()),
        "the sender's link"
    );
    assert_eq!(
        room.viewer.to_string(),
        format!("{}/rooms/R7#v.2", link.server()),
        "the viewers' link"
    );
    assert_eq!(
        room.expires,
        SystemTime::UNIX_EPOCH + Duration::from_secs(2_000_000_000),
        "when it ends"
    );
    let asked = asked.await.expect("asked");
    assert!(
        asked.starts_with("POST /pre/v1/rooms HTTP/1.1\r\n"),
        "{asked}"
    );
    assert!(
        asked.contains("authorization: Bearer owner.3\r\n")
            && asked.ends_with(r#"{"lifetime_s":60}"#),
        "{asked}"
    );
}

#[tokio::test]
async fn a_room_that_cannot_be_is_refused() {
    for body in [
        r#"{"room":"../x","sender_token":"s","viewer_token":"v","expires":1}"#,
        r#"{"room":"R","sender_token":"s s","viewer_token":"v","expires":1}"#,
        r#"{"room":"R","sender_token":"s","viewer_token":"v","expires":-1}"#,
        r#"{"room":"R"}"#,
        "<html>",
    ] {
        let (link, _) = raw(http("201 Created", "", body)).await;
        let error = client()
            .open_room(link.server(), "owner.3", None)
            .await
            .expect_err(body);
        assert!(
            matches!(
                error,
                HttpError::InvalidResponse { .. } | HttpError::Protocol(ProtocolError::Token(_))
            ),
            "{body}: {error:?}"
        );
    }
    let (link, _) = raw(String::new()).await;
    let error = client()
        .open_room(link.server(), "two words", None)
        .await
        .expect_err("no token");
    assert!(
        matches!(error, HttpError::Protocol(ProtocolError::Token(_))),
        "{error:?}"
    );
}

#[tokio::test]
async fn a_viewer_gets_the_announcement_or_learns_that_the_sender_is_absent() {
    let id = "ab".repeat(32);
    let body = format!(
        r#"{{"avatar":{{"sha256":"{id}","bytes":16800000}},"channel":"unreliable","codec":"compact","rate_hz":30.0}}"#
    );
    let (link, asked) = raw(http("200 OK", "content-type: application/json\r\n", &body)).await;
    let told = client()
        .announcement(&link)
        .await
        .expect("told")
        .expect("there");
    assert_eq!(
        (told.avatar.bytes, told.channel, told.rate_hz),
        (16_800_000, ChannelMode::Unreliable, 30.0),
        "its values"
    );
    let asked = asked.await.expect("asked");
    assert!(
        asked.starts_with("GET /pre/v1/rooms/R-1 HTTP/1.1\r\n"),
        "{asked}"
    );
    let (link, _) = raw(http("503 Service Unavailable", "retry-after: 2\r\n", "")).await;
    assert_eq!(
        client().announcement(&link).await.expect("told"),
        None,
        "no sender there"
    );
    let (link, _) = raw(http("200 OK", "", &body.replace("30.0", "1e9"))).await;
    assert!(
        matches!(
            client().announcement(&link).await,
            Err(HttpError::InvalidResponse { .. })
        ),
        "out of bounds"
    );
    let (link, _) = raw(http("200 OK", "", &" ".repeat(1 << 20))).await;
    assert!(
        matches!(
            client().announcement(&link).await,
            Err(HttpError::InvalidResponse { .. })
        ),
        "endless"
    );
}

#[tokio::test]
async fn an_offer_is_answered_with_an_sdp_and_a_session() {
    let headers = "content-type: application/sdp\r\nlocation: /pre/v1/rooms/R-1/sessions/S_9\r\n";
    let (link, asked) = raw(http("201 Created", headers, "v=0\r\nanswer")).await;
    let answer = client()
        .offer(&link, "v=0\r\noffer")
        .await
        .expect("an answer");
    assert_eq!(
        (answer.sdp.as_str(), answer.session.as_str()),
        ("v=0\r\nanswer", "S_9"),
        "its parts"
    );
    let asked = asked.await.expect("asked");
    assert!(
        asked.starts_with("POST /pre/v1/rooms/R-1/whep HTTP/1.1\r\n"),
        "{asked}"
    );
    assert!(
        asked.contains("content-type: application/sdp\r\n")
            && asked.ends_with("\r\n\r\nv=0\r\noffer"),
        "{asked}"
    );
    for headers in [
        "",
        "location: /v1/rooms/R\r\n",
        "location: /sessions/\r\n",
        "location: /sessions/a/../b\r\n",
    ] {
        let (link, _) = raw(http("201 Created", headers, "v=0")).await;
        let error = client().offer(&link, "v=0").await.expect_err("no session");
        assert!(
            matches!(error, HttpError::InvalidResponse { .. }),
            "{headers:?}: {error:?}"
        );
    }
}

#[tokio::test]
async fn an_offer_without_an_answer_fails_with_the_reason() {
    let offer = async |status: &str, headers: &str| {
        let (link, _) = raw(http(status, headers, "")).await;
        client().offer(&link, "v=0").await.expect_err("a refusal")
    };
    let error = offer("503 Service Unavailable", "retry-after: 3\r\n").await;
    assert!(
        matches!(error, HttpError::SenderAbsent { retry_after: Some(wait) } if wait.as_secs() == 3),
        "{error:?}"
    );
    assert!(
        matches!(
            offer("504 Gateway Timeout", "").await,
            HttpError::SenderTimedOut
        ),
        "504"
    );
    assert!(
        matches!(
            offer("401 Unauthorized", "").await,
            HttpError::Unauthorized { .. }
        ),
        "401"
    );
    assert!(
        matches!(offer("404 Not Found", "").await, HttpError::NotFound { .. }),
        "404"
    );
    assert!(
        matches!(
            offer("429 Too Many", "").await,
            HttpError::RateLimited { .. }
        ),
        "429"
    );
    assert!(
        matches!(
            offer("500 Oops", "").await,
            HttpError::Unavailable { status: 500, .. }
        ),
        "500"
    );
}

#[tokio::test]
async fn answering_and_leaving_name_the_session_and_no_other_path() {
    let server = Server::without_package([
        Fault::Status(204, ""),
        Fault::Status(204, ""),
        Fault::Status(404, "gone"),
    ])
    .await;
    let link = server.link();
    let session: Name = "S9".parse().expect("a name");
    let answered = client().answer(&link, &session, "v=0").await;
    answered.expect("answered");
    client().leave(&link, &session).await.expect("left");
    client().leave(&link, &session).await.expect("gone already");
    for other in ["", "..", "a/b", "a?b", "a#b", "a%2fb"] {
        other.parse::<Name>().expect_err(other);
    }
    let asked: Vec<(Method, String)> = server
        .requests()
        .into_iter()
        .map(|request| (request.method, request.path))
        .collect();
    let session = "/v1/rooms/R-1/sessions/S9";
    let delete = (Method::DELETE, session.to_owned());
    assert_eq!(
        asked,
        [
            (Method::PUT, format!("{session}/answer")),
            delete.clone(),
            delete
        ],
        "and nothing else"
    );
    assert_eq!(
        server.requests()[0].header(header::CONTENT_TYPE),
        Some("application/sdp"),
        "an SDP"
    );
}

#[tokio::test]
async fn a_server_that_does_not_answer_is_not_waited_for_without_end() {
    // It accepts connections, as the system does for it, and reads none.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let link: RoomLink = format!("http://{}/rooms/R#t", listener.local_addr().expect("bound"))
        .parse()
        .expect("a link");
    let error = client().announcement(&link).await.expect_err("silence");
    assert!(matches!(error, HttpError::TimedOut { .. }), "{error:?}");
}
