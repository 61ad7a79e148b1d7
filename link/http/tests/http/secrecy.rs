//! The token goes to the server and nowhere else.

use std::{
    error::Error,
    fmt::Write,
    sync::{Mutex, Once, PoisonError},
};

use axum::http::header;
use link_http::{HttpError, PackageCache};

use crate::{
    client,
    server::{Fault, Server, TOKEN, random_bytes},
};

/// Every line that any crate logs in this process, at any level.
struct Log;

static LINES: Mutex<String> = Mutex::new(String::new());

impl log::Log for Log {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        let mut lines = LINES.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = writeln!(lines, "{} {}", record.target(), record.args());
    }

    fn flush(&self) {}
}

fn listen() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        log::set_logger(&Log).expect("the first logger");
        log::set_max_level(log::LevelFilter::Trace);
    });
}

/// All texts of an error: `Display` and `Debug`, with its causes.
fn shown(error: &HttpError) -> String {
    let mut text = format!("{error:?} {error:#?} {error}");
    let mut next = error.source();
    while let Some(cause) = next {
        let _ = write!(text, " {cause} {cause:?}");
        next = cause.source();
    }
    text
}

#[tokio::test]
async fn no_error_and_no_log_shows_the_token() {
    listen();
    let faults = [
        vec![Fault::Echo],
        vec![Fault::Status(401, "no")],
        vec![Fault::Status(404, "no")],
        vec![Fault::Cut(10); 6],
        vec![Fault::Status(500, "no"); 6],
        vec![Fault::CallsItGzip],
        vec![Fault::Length(1)],
        vec![Fault::Redirect(format!(
            "http://elsewhere.invalid/{TOKEN}?{TOKEN}"
        ))],
        vec![Fault::WrongByte, Fault::WrongByte],
    ];
    for faults in faults {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = PackageCache::new(folder.path()).expect("a cache");
        let server = Server::start(random_bytes(9, 100_000), faults.clone()).await;
        let error = client()
            .fetch_package(&server.link(), &server.avatar(), &cache, |_| ())
            .await
            .expect_err("a fault");
        let shown = shown(&error);
        assert!(!shown.contains(TOKEN), "{faults:?}: {shown}");
        let sent = server.requests().iter().all(|request| {
            request.header(header::AUTHORIZATION) == Some(&format!("Bearer {TOKEN}"))
                && !request.path.contains(TOKEN)
        });
        assert!(sent, "the server gets it, in its header only");
    }
    let lines = LINES.lock().unwrap_or_else(PoisonError::into_inner);
    assert!(lines.contains("reqwest"), "the log is heard");
    let shows = lines.lines().find(|line| line.contains(TOKEN));
    assert!(shows.is_none(), "{shows:?}");
}

#[tokio::test]
async fn no_redirect_is_followed() {
    let other = Server::start(random_bytes(9, 1000), []).await;
    let folder = tempfile::tempdir().expect("a folder");
    let cache = PackageCache::new(folder.path()).expect("a cache");
    let path = format!("/v1/packages/{}", other.avatar().sha256);
    for to in [
        format!("http://{}{path}", other.address),
        format!("{path}?again"),
    ] {
        let server = Server::start(random_bytes(9, 1000), [Fault::Redirect(to.clone())]).await;
        let error = client()
            .fetch_package(&server.link(), &server.avatar(), &cache, |_| ())
            .await
            .expect_err("a redirect");
        assert!(
            matches!(error, HttpError::Redirected { .. }),
            "{to}: {error:?}"
        );
        assert_eq!(
            (server.requests().len(), other.requests().len()),
            (1, 0),
            "{to}: no other server was asked"
        );
    }
}

#[tokio::test]
async fn what_a_server_says_is_shown_on_one_line() {
    let server = Server::without_package([Fault::Echo]).await;
    let error = client()
        .announcement(&server.link())
        .await
        .expect_err("a refusal");
    let HttpError::Refused {
        said, status: 418, ..
    } = &error
    else {
        panic!("{error:?}")
    };
    assert_eq!(
        said, "you said  Bearer [token]",
        "without the token, without a line break"
    );
}
