use std::{
    convert::Infallible,
    sync::{Arc, Mutex},
    time::Duration,
};

use axum::{
    Router,
    body::{Body, Bytes},
    http::{Response, header},
};
use futures_util::stream;
use link_codec::Codec;
use link_http::{HttpError, presence::Presence};
use link_protocol::{
    Announcement, Name, PackageId, RoomLink,
    announcement::{AvatarRef, ChannelMode},
    presence::PresenceEvent,
};
use tokio::sync::mpsc;

use crate::{
    client,
    server::{Fault, Server, TOKEN},
};

const STREAM: &str = ": hello\n\nevent: offer\ndata: {\"session\": \"S1\",\ndata:  \"sdp\": \"v=0\\r\\n\"}\n\nevent: later\ndata: 1\n\n\
                      event: leave\r\ndata: {\"session\": \"S1\"}\r\n\r\nevent: replaced\ndata\n\n";

fn announcement() -> Announcement {
    let avatar = AvatarRef {
        sha256: PackageId::of_bytes(b"abc"),
        bytes: 3,
    };
    Announcement {
        avatar,
        channel: ChannelMode::Unreliable,
        codec: Codec::Compact,
        rate_hz: 60.0,
    }
}

/// A presence and the server's end of it.
async fn present() -> (Presence, mpsc::Sender<Bytes>) {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0")
        .await
        .expect("a port");
    let link: RoomLink = format!(
        "http://{}/rooms/R#{TOKEN}",
        listener.local_addr().expect("bound")
    )
    .parse()
    .expect("a link");
    let (say, said) = mpsc::channel(1000);
    let said = Arc::new(Mutex::new(Some(said)));
    let router = Router::new().fallback(move |body: Bytes| {
        let sent: Announcement = serde_json::from_slice(&body).expect("an announcement");
        assert_eq!(sent, announcement(), "as it was made");
        let said = said
            .lock()
            .expect("unpoisoned")
            .take()
            .expect("one presence");
        let pieces = stream::unfold(said, async |mut said: mpsc::Receiver<Bytes>| {
            Some((Ok::<_, Infallible>(said.recv().await?), said))
        });
        let builder =
            Response::builder().header(header::CONTENT_TYPE, "text/event-stream; charset=utf-8");
        std::future::ready(builder.body(Body::from_stream(pieces)).expect("a response"))
    });
    tokio::spawn(async move { axum::serve(listener, router).await });
    (
        client()
            .open_presence(&link, &announcement().into())
            .await
            .expect("present"),
        say,
    )
}

/// The session's name in [`STREAM`].
fn s1() -> Name {
    "S1".parse().expect("a name")
}

async fn all(presence: &mut Presence) {
    let offer = PresenceEvent::Offer {
        session: s1(),
        sdp: "v=0\r\n".to_owned(),
        forwards: false,
        token: None,
        network: None,
    };
    assert_eq!(presence.next().await.expect("an event"), offer, "first");
    assert_eq!(
        presence.next().await.expect("an event"),
        PresenceEvent::Leave { session: s1() },
        "second"
    );
    assert_eq!(
        presence.next().await.expect("an event"),
        PresenceEvent::Replaced,
        "third"
    );
    assert!(
        matches!(presence.next().await, Err(HttpError::PresenceEnded { .. })),
        "nothing follows"
    );
}

#[tokio::test]
async fn events_come_in_order_and_unknown_ones_are_passed_over() {
    let (mut presence, say) = present().await;
    say.send(STREAM.into()).await.expect("said");
    all(&mut presence).await;
}

#[tokio::test]
async fn events_may_come_a_byte_at_a_time() {
    let (mut presence, say) = present().await;
    for byte in STREAM.bytes() {
        say.send(Bytes::copy_from_slice(&[byte]))
            .await
            .expect("said");
    }
    all(&mut presence).await;
}

#[tokio::test]
async fn comments_keep_a_presence_alive_and_silence_ends_it() {
    let (mut presence, say) = present().await;
    // 1 s, twice as long as a silence may be; waiting in short turns must not lengthen that.
    for _ in 0..10 {
        say.send(": still here\n".into()).await.expect("said");
        let heard = tokio::time::timeout(Duration::from_millis(100), presence.next()).await;
        assert!(heard.is_err(), "nothing yet: {heard:?}");
    }
    let silent = async {
        loop {
            if let Ok(event) =
                tokio::time::timeout(Duration::from_millis(50), presence.next()).await
            {
                return event;
            }
        }
    };
    let event = tokio::time::timeout(Duration::from_secs(5), silent)
        .await
        .expect("silence is noticed");
    assert!(
        matches!(event, Err(HttpError::PresenceSilent { .. })),
        "{event:?}"
    );
}

#[tokio::test]
async fn a_stream_that_ends_or_makes_no_sense_is_an_error() {
    let (mut presence, say) = present().await;
    drop(say);
    assert!(
        matches!(presence.next().await, Err(HttpError::PresenceEnded { .. })),
        "the end"
    );
    for text in [
        "event: offer\ndata: {\"session\": \"S1\"}\n\n".to_owned(),
        "event: leave\ndata: {\"session\": \"../S1\"}\n\n".to_owned(),
        "event: leave\ndata: nonsense\n\n".to_owned(),
        "x".repeat(1 << 20),
    ] {
        let (mut presence, say) = present().await;
        say.send(text.clone().into()).await.expect("said");
        let event = presence.next().await;
        assert!(
            matches!(event, Err(HttpError::InvalidResponse { .. })),
            "{}: {event:?}",
            &text[..20]
        );
    }
}

#[tokio::test]
async fn a_refused_presence_says_why() {
    for (code, right) in [(401_u16, "accept"), (404, "link"), (500, "log")] {
        let server = Server::without_package([Fault::Status(code, "no")]).await;
        let error = client()
            .open_presence(&server.link(), &announcement().into())
            .await
            .expect_err("refused")
            .to_string();
        assert!(error.contains(right), "{code}: {error}");
    }
    let server = Server::without_package([Fault::Status(200, "not a stream")]).await;
    let error = client()
        .open_presence(&server.link(), &announcement().into())
        .await
        .expect_err("no stream");
    assert!(
        matches!(error, HttpError::InvalidResponse { .. }),
        "{error:?}"
    );
}
