//! Access: without a genuine token a client learns nothing, with one nothing beyond its right.

use crate::support::{
    ANSWER, OFFER, Outcome, PATIENCE, TestServer, announcement, another_package, files_below,
    package, unix_now,
};
use link_protocol::rooms::ViewerToken;
use reqwest::{Method, StatusCode};
use serde_json::json;
use server::Secret;
use std::collections::BTreeSet;
use std::sync::{Mutex, Once, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

#[tokio::test(flavor = "multi_thread")]
async fn without_a_genuine_unexpired_token_every_route_answers_the_same_whether_it_exists_or_not()
-> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let _sender = caller.enter(&room).await?;
    let owner = caller.owner("ada");
    let swapped: String = owner.chars().rev().collect();
    let authorizations = [
        None,
        Some(String::new()),
        Some("Bearer".to_owned()),
        Some("Bearer ".to_owned()),
        Some(format!("Basic {owner}")),
        Some(owner.clone()),
        Some(format!("Bearer {swapped}")),
        Some(format!("Bearer {}", &owner[1..])),
        Some(format!("Bearer {owner} {owner}")),
        Some(format!(
            "Bearer {}",
            caller.secret.owner_token("ada", unix_now())?
        )),
        Some(format!("Bearer {}", caller.secret.owner_token("ada", 0)?)),
        Some(format!(
            "Bearer {}",
            Secret::random()?.owner_token("ada", u64::MAX)?
        )),
    ];
    let (there, not) = (room.id.clone(), "0".repeat(32));
    let (kept, lost) = (package().hash.clone(), "0".repeat(64));
    let mut routes = vec![
        (Method::POST, "/v1/rooms".to_owned()),
        (Method::PATCH, "/v1/rooms".to_owned()),
        (Method::GET, "/v1/packages".to_owned()),
        (Method::GET, "/".to_owned()),
        (Method::GET, "/v2/anything".to_owned()),
        (Method::GET, "/healthz/".to_owned()),
    ];
    for room in [&there, &not] {
        routes.extend([
            (Method::GET, format!("/v1/rooms/{room}")),
            (Method::GET, format!("/rooms/{room}")),
            (Method::POST, format!("/v1/rooms/{room}/presence")),
            (Method::POST, format!("/v1/rooms/{room}/whep")),
            (Method::DELETE, format!("/v1/rooms/{room}/sessions/{not}")),
            (
                Method::PUT,
                format!("/v1/rooms/{room}/sessions/{not}/answer"),
            ),
        ]);
    }
    for hash in [&kept, &lost] {
        for method in [Method::GET, Method::PUT, Method::DELETE] {
            routes.push((method, format!("/v1/packages/{hash}")));
        }
    }
    let mut answers = BTreeSet::new();
    for (method, path) in &routes {
        for authorization in &authorizations {
            let url = format!("http://{}{path}", caller.address);
            let mut request = caller.client.request(method.clone(), url);
            if let Some(value) = authorization {
                request = request.header("authorization", value);
            }
            if method == Method::PUT {
                request = request.body(package().bytes.clone());
            }
            let answer = request.send().await?;
            assert_eq!(
                answer.status(),
                StatusCode::UNAUTHORIZED,
                "{method} {path} with {authorization:?}"
            );
            let names: Vec<_> = answer
                .headers()
                .keys()
                .filter(|name| *name != "allow")
                .map(ToString::to_string)
                .collect();
            answers.insert((names, answer.text().await?));
        }
    }
    assert_eq!(answers.len(), 1, "one answer for all: {answers:?}");
    for path in ["/healthz", "/readyz", "/metrics"] {
        let answer = caller
            .client
            .get(format!("http://{}{path}", caller.address))
            .send()
            .await?;
        assert_eq!(answer.status(), StatusCode::OK, "{path} needs none");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_genuine_token_sees_nothing_it_has_no_right_to() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let (ada, eve) = (caller.room("ada").await?, caller.empty_room("eve").await?);
    let _sender = caller.enter(&ada).await?;
    let path = ada.path();
    let session = "0".repeat(32);
    let presence = (Method::POST, format!("{path}/presence"));
    let whep = (Method::POST, format!("{path}/whep"));
    let room = (Method::GET, path.clone());
    let answer = (Method::PUT, format!("{path}/sessions/{session}/answer"));
    let leave = (Method::DELETE, format!("{path}/sessions/{session}"));
    let open = (Method::POST, "/v1/rooms".to_owned());
    let put = (Method::PUT, package().path());
    let get = (Method::GET, package().path());
    let delete = (Method::DELETE, package().path());
    // Ada's, too, but nobody shows it in the room.
    let second = another_package();
    let stored = caller.put_package(&second, &caller.owner("ada")).await?;
    assert_eq!(stored.status(), StatusCode::CREATED);
    let other = (Method::GET, second.path());
    let (ada_owner, eve_owner) = (caller.owner("ada"), caller.owner("eve"));
    let mut bodies = BTreeSet::new();
    for (token, forbidden) in [
        (&ada.sender, vec![&whep, &open, &put, &delete]),
        (&ada_owner, vec![&presence, &whep, &room, &answer, &leave]),
        (
            &ada.viewer,
            vec![&presence, &answer, &open, &put, &delete, &other],
        ),
        (&eve.viewer, vec![&presence, &whep, &room, &answer, &leave]),
        (
            &eve.sender,
            vec![&presence, &whep, &room, &answer, &leave, &get],
        ),
        (&eve_owner, vec![&presence, &whep, &room, &get, &delete]),
    ] {
        for (method, path) in forbidden {
            let request = caller.request(method.clone(), path, token);
            let request = match path.rsplit('/').next() {
                Some("whep") => request
                    .header("content-type", "application/sdp")
                    .body(OFFER),
                Some("answer") => request
                    .header("content-type", "application/sdp")
                    .body(ANSWER),
                Some("presence") => request.json(&announcement()),
                _ if method == Method::PUT => request.body(package().bytes.clone()),
                _ => request,
            };
            let answer = request.send().await?;
            assert_eq!(answer.status(), StatusCode::NOT_FOUND, "{method} {path}");
            bodies.insert(answer.text().await?);
        }
    }
    let nothing = caller.get("/v1/rooms/no/such/thing", &ada_owner).await?;
    bodies.insert(nothing.text().await?);
    assert_eq!(bodies.len(), 1, "one body for all: {bodies:?}");
    // Nobody shows anything in Eve's room: so what there is to read there cannot be said yet.
    let unshown = caller.get(&package().path(), &eve.viewer).await?;
    assert_eq!(unshown.status(), StatusCode::SERVICE_UNAVAILABLE);
    // And with the right ones the same requests go through.
    assert_eq!(
        caller.get(&package().path(), &ada.viewer).await?.status(),
        StatusCode::OK,
        "a viewer reads"
    );
    assert_eq!(
        caller.get(&package().path(), &ada.sender).await?.status(),
        StatusCode::OK,
        "a sender reads"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn no_path_leads_out_of_the_store() -> Outcome {
    let outside = tempfile::tempdir()?;
    let store = outside.path().join("store");
    std::fs::write(outside.path().join("secret.txt"), "a secret")?;
    let folder = store.clone();
    let server = TestServer::start_with(|c| c.store = server::StoreConfig::Local(folder)).await?;
    let caller = &server.caller;
    caller.room("ada").await?;
    let token = caller.owner("ada");
    let before = files_below(outside.path())?;
    let hash = &package().hash;
    let upper = hash.to_uppercase();
    let tricks = [
        "/v1/packages/..".to_owned(),
        "/v1/packages/../../secret.txt".to_owned(),
        "/v1/packages/..%2f..%2fsecret.txt".to_owned(),
        "/v1/packages/%2e%2e%2f%2e%2e%2fsecret.txt".to_owned(),
        "/v1/packages/..%5c..%5csecret.txt".to_owned(),
        "/v1/packages/....//secret.txt".to_owned(),
        "/v1/packages/%2fetc%2fpasswd".to_owned(),
        "/v1/packages//etc/passwd".to_owned(),
        format!("/v1/packages/{hash}/"),
        format!("/v1/packages/{hash}/.."),
        format!("/v1/packages/{hash}%00"),
        format!("/v1/packages/{hash}%23"),
        format!("/v1/packages/{upper}"),
        format!("/v1/packages/{}", &hash[..63]),
        format!("//v1/packages/{hash}"),
        format!("/v1//packages/{hash}"),
        format!("/v1/packages/../packages/{hash}"),
        "/v1/rooms/../packages".to_owned(),
        "/v1/rooms/*".to_owned(),
        "/v1/rooms/%3e".to_owned(),
        format!("/v1/packages/{}", "%f0%9f".repeat(40)),
        "http://elsewhere/v1/packages/..".to_owned(),
        "*".to_owned(),
        "secret.txt".to_owned(),
    ];
    for path in &tricks {
        for method in ["GET", "PUT", "DELETE"] {
            let mut stream = TcpStream::connect(caller.address).await?;
            let request = format!(
                "{method} {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\nAuthorization: Bearer {token}\r\nContent-Length: 0\r\n\r\n"
            );
            stream.write_all(request.as_bytes()).await?;
            let mut answer = String::new();
            tokio::time::timeout(PATIENCE, stream.read_to_string(&mut answer)).await??;
            let status = answer.split(' ').nth(1).unwrap_or_default();
            assert!(
                matches!(status, "400" | "404" | "405"),
                "{method} {path:?} answers {answer:?}"
            );
            assert!(!answer.contains("business"), "{method} {path:?} leaks");
        }
    }
    assert_eq!(files_below(outside.path())?, before, "nothing was touched");
    Ok(())
}

/// Everything that the server logs in this process.
struct Ears(Mutex<String>);

impl log::Log for Ears {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }
    fn log(&self, record: &log::Record<'_>) {
        // The client's own libraries run here, too.
        if record.target().starts_with("server") || record.target().starts_with("async_nats") {
            let mut text = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            text.push_str(&format!("{}\n", record.args()));
        }
    }
    fn flush(&self) {}
}

static EARS: Ears = Ears(Mutex::new(String::new()));
static LISTEN: Once = Once::new();

#[tokio::test(flavor = "multi_thread")]
async fn neither_logs_nor_metrics_hold_a_token_or_text_of_a_client() -> Outcome {
    LISTEN.call_once(|| {
        if log::set_logger(&EARS).is_ok() {
            log::set_max_level(log::LevelFilter::Trace);
        }
    });
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    caller.meet(&room, &mut sender).await?;
    caller.get("/v1/imagination", &room.viewer).await?;
    caller.get("/v1/rooms/imagination", &room.viewer).await?;
    let owner = caller.owner("ada");
    caller.delete(&package().path(), &owner).await?;
    let metrics = caller.get("/metrics", "").await?.text().await?;
    let logs = EARS
        .0
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    assert!(logs.contains(&room.id), "the log was heard: {logs}");
    for text in [&logs, &metrics] {
        for secret in [&room.sender, &room.viewer, &owner] {
            assert!(!text.contains(secret.as_str()), "a token in {text}");
        }
    }
    assert!(
        !metrics.contains(&room.id) && !metrics.contains("imagination"),
        "{metrics}"
    );
    let route = "mon3tr_requests_total{route=\"/v1/rooms/{room}/whep\",status=\"201\"} ";
    assert_eq!(
        caller.metric(route).await?,
        1,
        "a route's pattern: {metrics}"
    );
    assert_eq!(
        caller
            .metric("mon3tr_requests_total{route=\"other\",status=\"404\"} ")
            .await?,
        1,
        "what is no route: {metrics}"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sender_gives_each_viewer_a_token_and_takes_one_back() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let room = caller.room("ada").await?;
    let path = format!("{}/viewers", room.path());
    for token in [&room.viewer, &caller.owner("ada")] {
        let asked = caller.request(Method::POST, &path, token).send().await?;
        assert_eq!(asked.status(), StatusCode::NOT_FOUND, "no sender's");
    }
    let mut guests = Vec::new();
    for lifetime in [None, Some(3600), Some(30 * 86_400)] {
        let asked = caller.request(Method::POST, &path, &room.sender);
        let asked = asked.json(&json!({ "lifetime_s": lifetime }));
        let answer = asked.send().await?;
        assert_eq!(answer.status(), StatusCode::CREATED);
        let added: ViewerToken = answer.json().await?;
        let left = added.expires - unix_now();
        let expected = lifetime.unwrap_or(86_400).min(86_400);
        assert!(left.abs_diff(expected) < 60, "{lifetime:?}: {left} s");
        guests.push(added);
    }
    let mut body = announcement();
    body["revoked"] = json!([guests[0].name]);
    let presence = format!("{}/presence", room.path());
    let presence = caller.request(Method::POST, &presence, &room.sender);
    let presence = presence.timeout(Duration::from_secs(3600)).json(&body);
    let _stream = presence.send().await?;
    let offer = |token: String| {
        let offer = caller.request(Method::POST, &format!("{}/whep", room.path()), &token);
        let offer = offer.header("content-type", "application/sdp").body(OFFER);
        async move { Ok::<_, reqwest::Error>(offer.send().await?.status()) }
    };
    for (guest, allowed) in [(&guests[0], false), (&guests[1], true)] {
        let token = &guest.viewer_token;
        for path in [room.path(), package().path()] {
            let status = caller.get(&path, token).await?.status();
            let expected = if allowed {
                StatusCode::OK
            } else {
                StatusCode::UNAUTHORIZED
            };
            assert_eq!(status, expected, "{path}");
        }
        let expected = if allowed {
            // It was passed on, and nobody answers here.
            StatusCode::GATEWAY_TIMEOUT
        } else {
            StatusCode::UNAUTHORIZED
        };
        assert_eq!(offer(token.clone()).await?, expected);
    }
    let status = caller.get(&room.path(), &room.viewer).await?.status();
    assert_eq!(status, StatusCode::OK, "the room's own link");
    body["revoked"] = json!(vec!["n"; 65]);
    let many = caller.request(
        Method::POST,
        &format!("{}/presence", room.path()),
        &room.sender,
    );
    let many = many.json(&body).send().await?;
    assert_eq!(many.status(), StatusCode::UNPROCESSABLE_ENTITY);
    Ok(())
}
