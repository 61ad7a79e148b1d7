//! A running lab between real sockets: an HTTP server behind it, and two UDP programs that exchange packets through it.

use std::{
    convert::Infallible,
    net::{Ipv4Addr, SocketAddr},
    sync::Arc,
    time::{Duration, Instant},
};

use axum::{
    Router,
    body::{Body, Bytes},
    extract::Request,
    http::{HeaderMap, Method, StatusCode},
    response::{IntoResponse as _, Response},
    routing::{get, post},
};
use futures_util::StreamExt as _;
use http_body_util::BodyExt as _;
use hyper_util::rt::TokioIo;
use netlab::{
    BitRate, Direction, Impairment, Jitter, Lab, LabConfig, Loss, Probability, Reordering,
    TcpImpairment, TcpRelay,
};
use tokio::{
    net::{TcpListener, TcpStream, UdpSocket},
    sync::{Semaphore, mpsc},
};

const MS: Duration = Duration::from_millis(1);

async fn serve(app: Router) -> SocketAddr {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
        .await
        .expect("a port");
    let address = listener.local_addr().expect("its address");
    tokio::spawn(axum::serve(listener, app).into_future());
    address
}

/// One request over a connection of its own, as any client would make it.
async fn ask(
    to: SocketAddr,
    method: Method,
    target: &str,
    headers: &[(&str, &str)],
    body: Body,
) -> Response {
    let stream = TcpStream::connect(to).await.expect("a connection");
    let (mut requests, connection) =
        hyper::client::conn::http1::handshake::<_, Body>(TokioIo::new(stream))
            .await
            .expect("a handshake");
    tokio::spawn(connection);
    let mut request = axum::http::Request::builder()
        .method(method)
        .uri(target)
        .header("host", to.to_string());
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    requests
        .send_request(request.body(body).expect("a request"))
        .await
        .expect("an answer")
        .map(Body::new)
}

async fn bytes(answer: Response) -> Bytes {
    let body = answer.into_body().collect().await;
    body.expect("a whole body").to_bytes()
}

fn sdp(address: SocketAddr) -> String {
    format!(
        "v=0\r\no=- 1 1 IN IP4 0.0.0.0\r\ns=-\r\nt=0 0\r\nm=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\nc=IN IP4 0.0.0.0\r\n\
         a=mid:0\r\na=candidate:1 1 udp 2130706431 {} {} typ host\r\na=end-of-candidates\r\n",
        address.ip(),
        address.port()
    )
}

fn candidate(sdp: &str) -> SocketAddr {
    let line = sdp
        .lines()
        .find_map(|l| l.strip_prefix("a=candidate:"))
        .expect("a candidate");
    let words: Vec<&str> = line.split(' ').collect();
    let [_, _, _, _, ip, port, ..] = words[..] else {
        panic!("a candidate is longer: {line}");
    };
    format!("{ip}:{port}").parse().expect("an address")
}

/// A lab with a viewer and a sender that have exchanged descriptions through it.
struct Call {
    lab: Lab,
    viewer: Arc<UdpSocket>,
    sender: Arc<UdpSocket>,
    /// Where the viewer sends to reach the sender.
    to_sender: SocketAddr,
    /// The reverse.
    to_viewer: SocketAddr,
}

async fn call(down: Impairment, up: Impairment, seed: u64) -> Call {
    let viewer = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))
        .await
        .expect("a socket");
    let sender = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))
        .await
        .expect("a socket");
    let answer = sdp(sender.local_addr().expect("its address"));
    let (tell, mut offers) = mpsc::unbounded_channel();
    let whep = post(move |headers: HeaderMap, offer: String| async move {
        assert_eq!(headers["authorization"], "Bearer t", "headers come through");
        assert_eq!(
            headers["content-length"],
            offer.len().to_string().as_str(),
            "the length is the rewritten body's"
        );
        tell.send(offer).expect("the test waits");
        let headers = [
            ("location", "/v1/rooms/r/sessions/s"),
            ("content-type", "application/sdp"),
        ];
        (StatusCode::CREATED, headers, answer)
    });
    let mut config = LabConfig::new(serve(Router::new().route("/v1/rooms/r/whep", whep)).await);
    (config.down, config.up, config.seed) = (down, up, seed);
    let lab = Lab::start(config).await.expect("a lab");
    let offer = sdp(viewer.local_addr().expect("its address"));
    let headers = [
        ("authorization", "Bearer t"),
        ("content-type", "application/sdp"),
    ];
    let answer = ask(
        lab.address(),
        Method::POST,
        "/v1/rooms/r/whep",
        &headers,
        offer.into(),
    )
    .await;
    assert_eq!(answer.status(), StatusCode::CREATED, "the call is answered");
    assert_eq!(
        answer.headers()["location"],
        "/v1/rooms/r/sessions/s",
        "headers come back"
    );
    let answer = String::from_utf8(bytes(answer).await.into()).expect("text");
    let offer = offers.recv().await.expect("an offer");
    Call {
        lab,
        to_sender: candidate(&answer),
        to_viewer: candidate(&offer),
        viewer: viewer.into(),
        sender: sender.into(),
    }
}

/// What arrives until nothing has for a while: each packet's number.
async fn collect(socket: Arc<UdpSocket>, quiet: Duration) -> Vec<u32> {
    let mut got = Vec::new();
    let mut buffer = [0; 2048];
    while let Ok(Ok(length)) = tokio::time::timeout(quiet, socket.recv(&mut buffer)).await {
        assert_eq!(length, 100, "packets come whole");
        let number = buffer.first_chunk().expect("four bytes");
        got.push(u32::from_le_bytes(*number));
    }
    got
}

async fn send_numbered(socket: &UdpSocket, to: SocketAddr, count: u32) {
    let mut packet = [0; 100];
    for number in 0..count {
        packet[..4].copy_from_slice(&number.to_le_bytes());
        socket.send_to(&packet, to).await.expect("sent");
        tokio::time::sleep(MS).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn packets_reach_the_other_side_both_ways_and_from_the_labs_address() {
    let call = call(Impairment::default(), Impairment::default(), 1).await;
    let mut buffer = [0; 100];
    // The sender speaks first: the lab knows the viewer from its offer.
    call.sender
        .send_to(b"down", call.to_viewer)
        .await
        .expect("sent");
    let (length, from) = call.viewer.recv_from(&mut buffer).await.expect("received");
    assert_eq!((&buffer[..length], from), (&b"down"[..], call.to_sender));
    call.viewer
        .send_to(b"upwards", call.to_sender)
        .await
        .expect("sent");
    let (length, from) = call.sender.recv_from(&mut buffer).await.expect("received");
    assert_eq!((&buffer[..length], from), (&b"upwards"[..], call.to_viewer));
    // Packets from a third address are not forwarded.
    let stranger = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))
        .await
        .expect("a socket");
    stranger
        .send_to(b"boo", call.to_sender)
        .await
        .expect("sent");
    call.viewer
        .send_to(b"again", call.to_sender)
        .await
        .expect("sent");
    let (length, _) = call.sender.recv_from(&mut buffer).await.expect("received");
    assert_eq!(&buffer[..length], b"again");

    let seen = call.lab.stop().await;
    assert_eq!((seen.calls, seen.strangers), (1, 1), "{seen:?}");
    assert_eq!(
        (seen.down.offered.packets, seen.down.offered.bytes),
        (1, 4 + 28),
        "headers count"
    );
    assert_eq!(
        (seen.up.delivered.packets, seen.up.delivered.bytes),
        (2, 7 + 5 + 56)
    );
    let drawn: f64 = seen.up.seconds.iter().map(|s| s.delivered_kbit_s).sum();
    assert!((drawn - 68.0 * 8.0 / 1000.0).abs() < 1e-9, "{drawn}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_impaired_path_loses_doubles_and_reorders_packets_and_counts_them() {
    let p = |q| Probability::new(q).expect("a probability");
    let down = Impairment {
        delay: 20 * MS,
        jitter: Jitter::Uniform(2 * MS),
        loss: Loss::Independent(p(0.1)),
        reordering: Reordering {
            probability: p(0.1),
            hold: 20 * MS,
        },
        duplication: p(0.05),
        ..Impairment::default()
    };
    let mut lost = Vec::new();
    for _ in 0..2 {
        let call = call(down.clone(), Impairment::default(), 7).await;
        let got = tokio::spawn(collect(call.viewer.clone(), 2000 * MS));
        send_numbered(&call.sender, call.to_viewer, 400).await;
        let got = got.await.expect("collected");
        let seen = call.lab.stop().await.down;

        let mut newest = 0;
        let late = got
            .iter()
            .filter(|&&n| {
                newest = newest.max(n);
                n < newest
            })
            .count();
        let mut distinct = got.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(seen.offered.packets, 400);
        assert_eq!(seen.delivered.packets, got.len() as u64);
        assert_eq!(seen.duplicated, (got.len() - distinct.len()) as u64);
        assert_eq!(seen.lost.chance, 400 - distinct.len() as u64);
        assert_eq!(seen.lost.total(), seen.lost.chance, "{:?}", seen.lost);
        // Copies that come late are not counted as reordered, though here they are seen so.
        assert!(
            seen.reordered > 0 && seen.reordered <= late as u64,
            "{} of {late}",
            seen.reordered
        );
        lost.push(
            (0..400)
                .filter(|n| distinct.binary_search(n).is_err())
                .collect::<Vec<u32>>(),
        );
    }
    assert_eq!(
        lost.first(),
        lost.last(),
        "the same seed loses the same packets"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn the_network_can_be_changed_and_cut_while_it_runs() {
    let call = call(Impairment::default(), Impairment::default(), 1).await;
    let all = Impairment {
        loss: Loss::Independent(Probability::new(1.0).expect("a probability")),
        ..Impairment::default()
    };
    call.lab.set(Direction::Down, all);
    let got = tokio::spawn(collect(call.viewer.clone(), 300 * MS));
    send_numbered(&call.sender, call.to_viewer, 10).await;
    assert_eq!(got.await.expect("collected").len(), 0, "everything is lost");
    call.lab.set(Direction::Down, Impairment::default());
    let got = tokio::spawn(collect(call.viewer.clone(), 300 * MS));
    send_numbered(&call.sender, call.to_viewer, 10).await;
    assert_eq!(
        got.await.expect("collected"),
        Vec::from_iter(0..10),
        "nothing is"
    );
    call.lab.cut(Duration::from_secs(3600));
    let got = tokio::spawn(collect(call.viewer.clone(), 300 * MS));
    send_numbered(&call.sender, call.to_viewer, 10).await;
    assert_eq!(
        got.await.expect("collected").len(),
        0,
        "the network is gone"
    );
    let seen = call.lab.stop().await.down;
    assert_eq!((seen.lost.chance, seen.lost.outage), (10, 10), "{seen:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_address_of_a_viewer_without_candidates_is_learned_from_its_packets() {
    let call = call(Impairment::default(), Impairment::default(), 1).await;
    // A second socket of the viewer's, as one whose offer named another interface: it is the first to speak.
    let other = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))
        .await
        .expect("a socket");
    other.send_to(b"hello", call.to_sender).await.expect("sent");
    let mut buffer = [0; 100];
    let (_, from) = call.sender.recv_from(&mut buffer).await.expect("received");
    call.sender.send_to(b"answer", from).await.expect("sent");
    let (length, from) = other.recv_from(&mut buffer).await.expect("received");
    assert_eq!((&buffer[..length], from), (&b"answer"[..], call.to_sender));
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_and_answers_pass_unchanged() {
    let app = Router::new().fallback(|request: Request| async move {
        let (head, body) = request.into_parts();
        let body = body.collect().await.expect("a body").to_bytes();
        let said = format!(
            "{} {} {:?} {:?} {}",
            head.method,
            head.uri,
            head.headers.get("host"),
            head.headers.get("range"),
            body.len()
        );
        (
            StatusCode::IM_A_TEAPOT,
            [("etag", "\"x\""), ("retry-after", "3")],
            said,
        )
    });
    let server = serve(app).await;
    let lab = Lab::start(LabConfig::new(server)).await.expect("a lab");
    let target = "/v1/packages/../%2e%2e/a%20b//c?x=1&y=%2F";
    let answer = ask(
        lab.address(),
        Method::PUT,
        target,
        &[("range", "bytes=5-")],
        "12345".into(),
    )
    .await;
    assert_eq!(answer.status(), StatusCode::IM_A_TEAPOT);
    assert_eq!(answer.headers()["etag"], "\"x\"");
    assert_eq!(answer.headers()["retry-after"], "3");
    let said = String::from_utf8(bytes(answer).await.into()).expect("text");
    let host = lab.address();
    assert_eq!(
        said,
        format!("PUT {target} Some(\"{host}\") Some(\"bytes=5-\") 5")
    );
    let answer = ask(host, Method::HEAD, "/", &[], Body::empty()).await;
    assert!(
        answer.headers().contains_key("content-length"),
        "HEAD tells the length"
    );
    assert_eq!(bytes(answer).await.len(), 0, "and only that");
    lab.stop().await;
    // The server is gone from behind a lab: answered as a gateway does.
    let no_server = (Ipv4Addr::LOCALHOST, 1).into();
    let lab = Lab::start(LabConfig::new(no_server)).await.expect("a lab");
    let answer = ask(lab.address(), Method::GET, "/healthz", &[], Body::empty()).await;
    assert_eq!(answer.status(), StatusCode::BAD_GATEWAY);
    let answer = ask(
        lab.address(),
        Method::POST,
        "/v1/rooms/r/whep",
        &[],
        "x".into(),
    )
    .await;
    assert_eq!(answer.status(), StatusCode::BAD_REQUEST, "that is no offer");
}

#[tokio::test(flavor = "multi_thread")]
async fn events_and_bodies_stream_as_they_come() {
    // Each event is made only once the client has had the one before; a lab that buffered would wait for ever.
    let allowed = Arc::new(Semaphore::new(0));
    let events = {
        let allowed = allowed.clone();
        get(async move || {
            let events = futures_util::stream::unfold(0, move |n| {
                let allowed = allowed.clone();
                async move {
                    allowed.acquire().await.expect("open").forget();
                    let event = format!("event: offer\ndata: {n}\n\n");
                    Some((Ok::<_, Infallible>(event), n + 1))
                }
            });
            let headers = [("content-type", "text/event-stream")];
            (headers, Body::from_stream(events)).into_response()
        })
    };
    // The upload's first part is answered for before its second is sent.
    let (tell, mut told) = mpsc::unbounded_channel();
    let upload = post(move |request: Request| async move {
        let mut length = 0;
        let mut parts = request.into_body().into_data_stream();
        while let Some(part) = parts.next().await {
            length += part.expect("a part").len();
            tell.send(length).expect("the test listens");
        }
        length.to_string()
    });
    let app = Router::new()
        .route("/events", events)
        .route("/upload", upload);
    let lab = Lab::start(LabConfig::new(serve(app).await))
        .await
        .expect("a lab");

    let answer = ask(lab.address(), Method::POST, "/events", &[], Body::empty()).await;
    assert_eq!(answer.status(), StatusCode::METHOD_NOT_ALLOWED);
    let answer = ask(lab.address(), Method::GET, "/events", &[], Body::empty()).await;
    let mut stream = answer.into_body().into_data_stream();
    for n in 0..20 {
        allowed.add_permits(1);
        let event = stream.next().await.expect("an event").expect("whole");
        assert_eq!(event, format!("event: offer\ndata: {n}\n\n"));
    }

    let (push, queue) = mpsc::unbounded_channel::<Bytes>();
    push.send(Bytes::from(vec![1; 1000])).expect("queued");
    let body = Body::from_stream(futures_util::stream::unfold(
        queue,
        |mut queue| async move {
            let part = queue.recv().await?;
            Some((Ok::<_, Infallible>(part), queue))
        },
    ));
    let address = lab.address();
    let answer =
        tokio::spawn(async move { ask(address, Method::POST, "/upload", &[], body).await });
    assert_eq!(told.recv().await, Some(1000), "the first part is there");
    push.send(Bytes::from(vec![2; 500])).expect("queued");
    assert_eq!(told.recv().await, Some(1500), "the second too");
    drop(push);
    assert_eq!(bytes(answer.await.expect("answered")).await, "1500");

    // Stopping the lab breaks what streams.
    lab.stop().await;
    allowed.add_permits(1);
    assert!(
        !matches!(stream.next().await, Some(Ok(_))),
        "no event comes after the end"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_that_goes_away_closes_its_connection_to_the_server() {
    let gone = Arc::new(Semaphore::new(0));
    struct Tell(Arc<Semaphore>);
    impl Drop for Tell {
        fn drop(&mut self) {
            self.0.add_permits(1);
        }
    }
    let tell = gone.clone();
    let app = Router::new().route(
        "/events",
        get(async move || {
            let guard = Tell(tell);
            let stream = futures_util::stream::pending::<Result<Bytes, Infallible>>();
            Body::from_stream(
                futures_util::stream::iter([Ok(Bytes::from_static(b":\n\n"))])
                    .chain(stream)
                    .inspect(move |_| {
                        let _held = &guard;
                    }),
            )
        }),
    );
    let lab = Lab::start(LabConfig::new(serve(app).await))
        .await
        .expect("a lab");
    let answer = ask(lab.address(), Method::GET, "/events", &[], Body::empty()).await;
    let mut stream = answer.into_body().into_data_stream();
    assert!(stream.next().await.is_some(), "the stream runs");
    drop(stream);
    gone.acquire()
        .await
        .expect("the server's stream is dropped")
        .forget();
}

fn package() -> Bytes {
    let mut rng = fastrand::Rng::with_seed(3);
    (0..20_000_000).map(|_| rng.u8(..)).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn twenty_megabytes_come_whole_with_their_length_through_lab_and_tcp_relay() {
    let package = package();
    let served = package.clone();
    let app = Router::new().route("/package", get(async move || served));
    let mut config = LabConfig::new(serve(app).await);
    let rate = BitRate::from_kbit_s(400_000.0).expect("a rate");
    config.http = Some(TcpImpairment::symmetric(20 * MS, Some(rate)));
    let lab = Lab::start(config).await.expect("a lab");
    let started = Instant::now();
    let answer = ask(lab.address(), Method::GET, "/package", &[], Body::empty()).await;
    assert_eq!(answer.headers()["content-length"], "20000000");
    assert!(bytes(answer).await == package, "every byte is right");
    // A bound from below only, which no load can break: what the rate alone takes, headers and all.
    let least = 20e6 * 8.0 / 400e6 * 1500.0 / 1448.0;
    let took = started.elapsed().as_secs_f64();
    assert!(took > least, "{took} s, where {least} s are the least");
    println!("20 MB over 20 ms and 400 Mbit/s: {took:.3} s, the rate alone takes {least:.3} s");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tcp_path_takes_its_round_trips_and_ends_both_ways() {
    let app = Router::new().route("/", get(async || "hello"));
    let server = serve(app).await;
    let path = TcpImpairment::symmetric(40 * MS, None);
    let relay = TcpRelay::start((Ipv4Addr::LOCALHOST, 0).into(), server, path)
        .await
        .expect("a relay");
    let started = Instant::now();
    let answer = ask(
        relay.address(),
        Method::GET,
        "/",
        &[("connection", "close")],
        Body::empty(),
    );
    assert_eq!(bytes(answer.await).await, "hello");
    let took = started.elapsed();
    assert!(
        took >= 80 * MS,
        "one round trip to connect and one to ask: {took:?}"
    );
    println!("a request over a round trip of 40 ms: {took:?}");
}
