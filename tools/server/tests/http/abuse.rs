//! Hostile clients, and that the server keeps serving the others.

use crate::support::{Outcome, PATIENCE, TestServer, package};
use reqwest::{Method, StatusCode};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_never_finish_their_request_head_are_closed_while_others_are_served()
-> Outcome {
    let server = TestServer::start_with(|c| c.limits.head_within = Duration::from_secs(1)).await?;
    let caller = server.caller.clone();
    let mut lorises = Vec::new();
    for number in 0..100 {
        let address = caller.address;
        lorises.push((
            number,
            tokio::spawn(async move {
                let mut stream = TcpStream::connect(address).await?;
                if number % 4 != 0 {
                    stream.write_all(b"GET /healthz HTTP/1.1\r\n").await?;
                }
                let (mut from, mut to) = stream.split();
                let drip = async {
                    loop {
                        // A client that sends nothing at all is waited for no longer than one that sends little.
                        if number % 4 != 0 && to.write_all(b"X: y\r\n").await.is_err() {
                            break;
                        }
                        tokio::time::sleep(Duration::from_millis(100)).await;
                    }
                    std::future::pending::<()>().await;
                };
                let mut answer = Vec::new();
                tokio::select! {
                    // Closed or reset, it is over.
                    _ = from.read_to_end(&mut answer) => Outcome::Ok(true),
                    () = drip => Ok(false),
                    () = tokio::time::sleep(PATIENCE) => Ok(false),
                }
            }),
        ));
    }
    let served = caller.get("/healthz", "").await?;
    assert_eq!(
        served.status(),
        StatusCode::OK,
        "others are served meanwhile"
    );
    for loris in lorises {
        assert!(loris.1.await??, "the server ends it: {}", loris.0);
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_download_that_its_client_does_not_read_is_given_up() -> Outcome {
    let server = TestServer::start_with(|c| c.limits.pause = Duration::from_secs(1)).await?;
    let caller = &server.caller;
    let owner = caller.owner("ada");
    // More than the sockets' buffers hold; put past the check, which has tests of its own.
    let big = crate::support::Package::of(vec![7; 64 << 20]);
    let below = |name: String| server.folder.path().join(name);
    std::fs::create_dir_all(below(format!("records/{}", big.hash)))?;
    std::fs::write(below(format!("packages/{}", big.hash)), &big.bytes)?;
    let ada = server::Id::of_owner("ada");
    std::fs::write(below(format!("records/{}/{ada}", big.hash)), "")?;
    let mut stream = TcpStream::connect(caller.address).await?;
    let head = format!(
        "GET {} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {owner}\r\n\r\n",
        big.path()
    );
    stream.write_all(head.as_bytes()).await?;
    let mut status = [0; 12];
    stream.read_exact(&mut status).await?;
    assert_eq!(&status, b"HTTP/1.1 200", "it begins");
    // Its connection ends at the server, and only those of this test's questions stay.
    let mut ended = false;
    for _ in 0..600 {
        ended = caller.metric("mon3tr_connections ").await? == 1;
        if ended {
            break;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert!(ended, "the server gives it up");
    let mut rest = Vec::new();
    let read = tokio::time::timeout(PATIENCE, stream.read_to_end(&mut rest)).await?;
    assert!(
        read.is_err() || rest.len() < big.bytes.len(),
        "it was cut off"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_connections_of_one_address_are_limited() -> Outcome {
    let server = TestServer::start_with(|c| c.limits.connections_per_address = 3).await?;
    let address = server.caller.address;
    let mut open = Vec::new();
    for _ in 0..3 {
        let mut stream = TcpStream::connect(address).await?;
        stream
            .write_all(b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n")
            .await?;
        let mut status = [0; 12];
        tokio::time::timeout(PATIENCE, stream.read_exact(&mut status)).await??;
        assert_eq!(&status, b"HTTP/1.1 200", "within the bound");
        open.push(stream);
    }
    let mut fourth = TcpStream::connect(address).await?;
    let mut nothing = Vec::new();
    let read = tokio::time::timeout(PATIENCE, fourth.read_to_end(&mut nothing)).await?;
    assert!(read.is_err() || nothing.is_empty(), "closed without a word");
    drop(open);
    let mut served = None;
    for _ in 0..100 {
        if let Ok(answer) = server.caller.get("/healthz", "").await {
            served = Some(answer.status());
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(served, Some(StatusCode::OK), "there is room again");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn slow_connections_from_many_addresses_keep_no_other_client_out() -> Outcome {
    let server = TestServer::start_with(|c| {
        c.limits.connections = 64;
        c.limits.connections_per_address = 10;
        c.limits.requests_per_second = 0;
    })
    .await?;
    let caller = server.caller.clone();
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    let presence = format!(
        "POST {}/presence HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {}\r\nContent-Length: 100\r\n\r\n{{",
        room.path(),
        room.sender
    );
    let hostile = (0..10).map(|number| {
        let (caller, presence) = (caller.at([127, 0, 0, 20 + number]), presence.clone());
        tokio::spawn(async move {
            let caller = caller?;
            let mut held = std::collections::VecDeque::new();
            // With a genuine token and without, with a head and without, and idle after an answer.
            for kind in 0_u32.. {
                let mut stream = caller.connect().await?;
                let bytes: &[u8] = match kind % 5 {
                    0 | 1 => presence.as_bytes(),
                    2 => b"GET /healthz HTTP/1.1\r\nX: ",
                    3 => b"",
                    _ => b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n",
                };
                // It may be closed already.
                drop(stream.write_all(bytes).await);
                held.push_back(stream);
                if held.len() >= 10 {
                    held.pop_front();
                }
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
            Outcome::Ok(())
        })
    });
    let hostile: Vec<_> = hostile.collect();
    let is_full = async {
        while caller.metric("mon3tr_connections_replaced_total ").await? < 50 {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        Outcome::Ok(())
    };
    tokio::time::timeout(PATIENCE, is_full).await??;
    let path = room.path();
    for number in 0..20 {
        let honest = caller.at([127, 0, 0, 90])?;
        let health = within_two_tries(|| honest.get("/healthz", "")).await?;
        assert_eq!(health, StatusCode::OK, "number {number}");
        let status = within_two_tries(|| honest.get(&path, &room.viewer)).await?;
        assert_eq!(status, StatusCode::OK, "number {number}");
    }
    // The presence has had its connection all the while.
    caller.meet(&room, &mut sender).await?;
    assert!(!hostile.iter().any(tokio::task::JoinHandle::is_finished));
    hostile.iter().for_each(tokio::task::JoinHandle::abort);
    Ok(())
}

/// The status of an answer: of the second try where the first one had none.
async fn within_two_tries<F>(ask: impl Fn() -> F) -> Outcome<StatusCode>
where
    F: Future<Output = Outcome<reqwest::Response>>,
{
    let in_time = || tokio::time::timeout(Duration::from_secs(10), ask());
    let answer = match in_time().await? {
        Ok(answer) => answer,
        Err(_) => in_time().await??,
    };
    Ok(answer.status())
}

#[tokio::test(flavor = "multi_thread")]
async fn preflight_requests_of_browsers_count_for_the_rate_limit_too() -> Outcome {
    let server = TestServer::start_with(|c| {
        c.limits.requests_per_second = 1;
        c.limits.request_burst = 5;
    })
    .await?;
    let caller = &server.caller;
    let mut refused = None;
    for _ in 0..100 {
        let request = caller.request(Method::OPTIONS, "/v1/rooms", "");
        let request = request.header("origin", "https://elsewhere.example");
        let request = request.header("access-control-request-method", "POST");
        let answer = request.send().await?;
        if answer.status() == StatusCode::TOO_MANY_REQUESTS {
            refused = Some(answer);
            break;
        }
    }
    let refused = refused.ok_or("never refused")?;
    let origin = &refused.headers()["access-control-allow-origin"];
    assert_eq!(origin, "*", "a page reads why");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_blocked_address_is_served_no_longer_and_its_connections_end() -> Outcome {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("blocked");
    let list = file.clone();
    let server = TestServer::start_with(|config| config.blocked = Some(list)).await?;
    let caller = &server.caller;
    let hostile = caller.at([127, 0, 0, 66])?;
    assert_eq!(hostile.get("/healthz", "").await?.status(), StatusCode::OK);
    let mut open = hostile.connect().await?;
    std::fs::write(&file, "127.0.0.64/29 # abuse\n")?;
    let mut nothing = Vec::new();
    let ended = tokio::time::timeout(PATIENCE, open.read_to_end(&mut nothing)).await?;
    assert!(ended.is_err() || nothing.is_empty(), "closed");
    assert!(hostile.get("/healthz", "").await.is_err(), "nor another");
    // A new one: the client may have kept one from before.
    let mut another = hostile.connect().await?;
    let ended = tokio::time::timeout(PATIENCE, another.read_to_end(&mut nothing)).await?;
    assert!(ended.is_err() || nothing.is_empty(), "closed");
    assert_eq!(caller.get("/healthz", "").await?.status(), StatusCode::OK);
    assert!(caller.metric("mon3tr_blocked_total ").await? > 0, "counted");
    std::fs::remove_file(&file)?;
    let again = async {
        while hostile.get("/healthz", "").await.is_err() {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    Ok(tokio::time::timeout(PATIENCE, again).await?)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_rate_limit_counts_by_the_connections_address_and_ignores_x_forwarded_for() -> Outcome {
    let server = TestServer::start_with(|c| {
        c.limits.requests_per_second = 1;
        c.limits.request_burst = 5;
    })
    .await?;
    let caller = &server.caller;
    let mut told = None;
    for number in 0..100 {
        let request = caller.request(Method::GET, "/healthz", "");
        let answer = request
            .header("x-forwarded-for", format!("10.0.0.{number}"))
            .send()
            .await?;
        if answer.status() == StatusCode::TOO_MANY_REQUESTS {
            told = Some(answer);
            break;
        }
    }
    let told = told.ok_or("never refused")?;
    let seconds: u64 = told.headers()["retry-after"].to_str()?.parse()?;
    assert!((1..=5).contains(&seconds), "after {seconds} s");
    tokio::time::sleep(Duration::from_secs(seconds)).await;
    assert_eq!(
        caller.get("/healthz", "").await?.status(),
        StatusCode::OK,
        "and then it may"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn behind_a_proxy_the_address_counts_that_the_proxy_adds() -> Outcome {
    let server = TestServer::start_with(|c| {
        c.limits.requests_per_second = 1;
        c.limits.request_burst = 5;
        c.limits.behind_proxy = true;
        c.limits.connections_per_address = 1;
    })
    .await?;
    let ask = async |forwarded: String| -> Outcome<StatusCode> {
        let request = server.caller.request(Method::GET, "/healthz", "");
        let answer = request.header("x-forwarded-for", forwarded).send().await?;
        Ok(answer.status())
    };
    for number in 0..20 {
        let status = ask(format!("10.0.0.{number}")).await?;
        assert_eq!(status, StatusCode::OK, "client {number}");
    }
    // What a client says itself comes first, and is no way out.
    let mut last = StatusCode::OK;
    for number in 0..20 {
        last = ask(format!("10.1.0.{number}, 192.0.2.7")).await?;
    }
    assert_eq!(last, StatusCode::TOO_MANY_REQUESTS, "one client");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_browser_may_call_from_any_page() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let url = format!("http://{}{}", caller.address, package().path());
    let asked = caller
        .client
        .request(Method::OPTIONS, &url)
        .header("origin", "https://elsewhere.example")
        .header("access-control-request-method", "PUT")
        .header("access-control-request-headers", "authorization,range")
        .send()
        .await?;
    assert_eq!(asked.status(), StatusCode::OK, "it may ask without a token");
    let allowed = |name: &str| {
        let value = asked.headers().get(name);
        value
            .and_then(|v| v.to_str().ok())
            .unwrap_or_default()
            .to_lowercase()
    };
    assert_eq!(allowed("access-control-allow-origin"), "*", "any page");
    assert!(
        allowed("access-control-allow-methods").contains("put"),
        "this method"
    );
    assert!(
        allowed("access-control-allow-headers").contains("authorization"),
        "with a token"
    );
    let refused = caller
        .client
        .get(&url)
        .header("origin", "https://elsewhere.example")
        .send()
        .await?;
    assert_eq!(
        refused.status(),
        StatusCode::UNAUTHORIZED,
        "a token is needed all the same"
    );
    assert_eq!(
        refused.headers()["access-control-allow-origin"],
        "*",
        "and the page sees that"
    );
    Ok(())
}
