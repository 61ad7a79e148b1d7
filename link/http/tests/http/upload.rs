use std::{cell::RefCell, fs};

use axum::http::{Method, header};
use link_http::HttpError;
use link_protocol::{ProtocolError, announcement::AvatarRef};

use crate::{
    client,
    server::{Fault, Server, TOKEN, random_bytes},
};

const SIZE: usize = 3_000_000;

async fn upload(
    faults: impl IntoIterator<Item = Fault>,
) -> (Result<AvatarRef, HttpError>, Server, Vec<(u64, u64)>) {
    let server = Server::without_package(faults).await;
    let file = tempfile::NamedTempFile::new().expect("a file");
    fs::write(file.path(), random_bytes(8, SIZE)).expect("written");
    let reported = RefCell::new(Vec::new());
    let tell = |sent, total| reported.borrow_mut().push((sent, total));
    let result = client()
        .put_package(&server.url(), TOKEN, file.path(), tell)
        .await;
    (result, server, reported.into_inner())
}

fn methods(server: &Server) -> Vec<Method> {
    server
        .requests()
        .into_iter()
        .map(|request| request.method)
        .collect()
}

#[tokio::test]
async fn a_package_is_uploaded_once_with_its_length() {
    let (result, server, reported) = upload([]).await;
    assert_eq!(
        result.expect("uploaded"),
        server.avatar(),
        "it arrived, and is announced as what it is"
    );
    assert_eq!(
        methods(&server),
        [Method::HEAD, Method::PUT],
        "looked for, then sent"
    );
    let put = &server.requests()[1];
    assert_eq!(
        (put.header(header::CONTENT_LENGTH), put.body),
        (Some("3000000"), SIZE),
        "its length is declared"
    );
    assert!(
        put.header(header::TRANSFER_ENCODING).is_none(),
        "and so it is not chunked"
    );
    assert_eq!(
        reported.last(),
        Some(&(SIZE as u64, SIZE as u64)),
        "its progress"
    );
    let avatar = server.avatar();
    assert!(
        client()
            .has_package(&server.url(), TOKEN, &avatar.sha256)
            .await
            .expect("reported"),
        "it is there"
    );
}

#[tokio::test]
async fn a_package_that_is_there_is_not_sent() {
    let server = Server::start(random_bytes(8, SIZE), []).await;
    let file = tempfile::NamedTempFile::new().expect("a file");
    fs::write(file.path(), random_bytes(8, SIZE)).expect("written");
    client()
        .put_package(&server.url(), TOKEN, file.path(), |_, _| {
            panic!("nothing to tell")
        })
        .await
        .expect("there");
    assert_eq!(methods(&server), [Method::HEAD], "looked for");
}

#[tokio::test]
async fn a_broken_upload_is_tried_again_and_not_without_end() {
    let (result, server, _) = upload([Fault::None, Fault::Status(500, "oops")]).await;
    result.expect("uploaded at the second time");
    assert_eq!(
        methods(&server),
        [Method::HEAD, Method::PUT, Method::HEAD, Method::PUT],
        "looked for again"
    );
    let (result, server, _) = upload(vec![Fault::Status(500, "oops"); 10]).await;
    assert!(
        matches!(result, Err(HttpError::Unavailable { .. })),
        "{result:?}"
    );
    assert_eq!(methods(&server).len(), 3, "three times");
}

#[tokio::test]
async fn a_refused_upload_says_why() {
    for code in [401, 413, 507] {
        let (result, server, _) = upload([Fault::None, Fault::Status(code, "no")]).await;
        let right = matches!(
            (code, &result),
            (401, Err(HttpError::Unauthorized { .. }))
                | (413, Err(HttpError::TooLarge { .. }))
                | (507, Err(HttpError::StoreFull { .. }))
        );
        assert!(right, "{code}: {result:?}");
        assert_eq!(
            methods(&server),
            [Method::HEAD, Method::PUT],
            "{code}: once"
        );
    }
}

#[tokio::test]
async fn a_file_that_is_no_package_is_named() {
    let server = Server::without_package([]).await;
    let folder = tempfile::tempdir().expect("a folder");
    let missing = folder.path().join("missing.m3a");
    let error = client()
        .put_package(&server.url(), TOKEN, &missing, |_, _| ())
        .await
        .expect_err("no file");
    assert!(
        matches!(&error, HttpError::Protocol(ProtocolError::File { path, .. }) if *path == missing),
        "{error:?}"
    );
    let empty = folder.path().join("empty.m3a");
    fs::write(&empty, b"").expect("written");
    let error = client()
        .put_package(&server.url(), TOKEN, &empty, |_, _| ())
        .await
        .expect_err("empty");
    assert!(
        matches!(error, HttpError::Protocol(ProtocolError::Announcement(_))),
        "{error:?}"
    );
    assert!(server.requests().is_empty(), "no request was sent");
}
