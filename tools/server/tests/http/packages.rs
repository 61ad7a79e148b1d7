//! Packages: put, read in parts, removed; and every upload that must leave nothing.

use crate::support::{Outcome, PATIENCE, Package, TestServer, package};
use bytes::Bytes;
use futures_util::stream;
use reqwest::{Body, Method, StatusCode};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

#[tokio::test(flavor = "multi_thread")]
async fn a_package_is_put_once_read_back_whole_and_in_parts_and_removed() -> Outcome {
    let server = TestServer::start().await?;
    let (caller, package) = (&server.caller, package());
    let owner = caller.owner("ada");
    let path = package.path();
    assert_eq!(
        caller.get(&path, &owner).await?.status(),
        StatusCode::NOT_FOUND,
        "not yet"
    );
    assert_eq!(
        caller.put_package(package, &owner).await?.status(),
        StatusCode::CREATED,
        "new"
    );
    assert_eq!(
        caller.put_package(package, &owner).await?.status(),
        StatusCode::OK,
        "known"
    );

    let tag = format!("\"{}\"", package.hash);
    let size = package.bytes.len();
    let whole = caller.get(&path, &owner).await?;
    let header = |name: &str| {
        let value = whole.headers().get(name);
        value
            .and_then(|v| v.to_str().ok())
            .unwrap_or_default()
            .to_owned()
    };
    assert_eq!(header("etag"), tag, "the hash is the tag");
    assert_eq!(header("accept-ranges"), "bytes", "ranges");
    assert!(header("cache-control").contains("immutable"), "immutable");
    assert_eq!(header("content-length"), size.to_string(), "length");
    assert!(whole.bytes().await? == package.bytes, "the same bytes");

    let head = caller.request(Method::HEAD, &path, &owner).send().await?;
    assert_eq!(
        head.headers()["content-length"],
        size.to_string().as_str(),
        "as GET"
    );
    assert_eq!(head.headers()["etag"], tag.as_str(), "as GET");
    assert!(head.bytes().await?.is_empty(), "no body");

    // A download that broke goes on where it was.
    let mut resumed = package.bytes[..size / 3].to_vec();
    let rest = caller
        .request(Method::GET, &path, &owner)
        .header("range", format!("bytes={}-", resumed.len()))
        .header("if-range", &tag)
        .send()
        .await?;
    assert_eq!(rest.status(), StatusCode::PARTIAL_CONTENT, "the rest");
    let range = format!("bytes {}-{}/{size}", resumed.len(), size - 1);
    assert_eq!(
        rest.headers()["content-range"],
        range.as_str(),
        "which part"
    );
    resumed.extend_from_slice(&rest.bytes().await?);
    assert!(resumed == package.bytes, "put together it is whole");

    for (name, value, status) in [
        ("if-none-match", tag.clone(), StatusCode::NOT_MODIFIED),
        (
            "if-none-match",
            format!("\"x\", W/{tag}"),
            StatusCode::NOT_MODIFIED,
        ),
        ("if-none-match", "\"x\"".to_owned(), StatusCode::OK),
        (
            "range",
            format!("bytes={size}-"),
            StatusCode::RANGE_NOT_SATISFIABLE,
        ),
        ("range", "bytes=0-1,5-6".to_owned(), StatusCode::OK),
        ("range", "bytes=-5".to_owned(), StatusCode::PARTIAL_CONTENT),
    ] {
        let request = caller
            .request(Method::GET, &path, &owner)
            .header(name, &value);
        assert_eq!(request.send().await?.status(), status, "{name}: {value}");
    }
    let other = caller
        .request(Method::GET, &path, &owner)
        .header("range", "bytes=0-1")
        .header("if-range", "\"x\"");
    assert_eq!(
        other.send().await?.status(),
        StatusCode::OK,
        "a part of something else"
    );

    assert_eq!(
        caller.delete(&path, &owner).await?,
        StatusCode::NO_CONTENT,
        "removed"
    );
    assert_eq!(
        caller.get(&path, &owner).await?.status(),
        StatusCode::NOT_FOUND,
        "gone"
    );
    assert_eq!(
        caller.delete(&path, &owner).await?,
        StatusCode::NOT_FOUND,
        "gone already"
    );
    assert!(
        server.files()?.is_empty(),
        "nothing is left: {:?}",
        server.files()?
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn two_owners_of_the_same_bytes_cannot_learn_of_each_other() -> Outcome {
    let server = TestServer::start().await?;
    let (caller, package) = (&server.caller, package());
    let (ada, eve) = (caller.owner("ada"), caller.owner("eve"));
    assert_eq!(
        caller.put_package(package, &ada).await?.status(),
        StatusCode::CREATED,
        "ada's"
    );
    let path = package.path();
    assert_eq!(
        caller.get(&path, &eve).await?.status(),
        StatusCode::NOT_FOUND,
        "not eve's"
    );
    assert_eq!(
        caller.delete(&path, &eve).await?,
        StatusCode::NOT_FOUND,
        "not hers to remove"
    );
    assert_eq!(
        caller.put_package(package, &eve).await?.status(),
        StatusCode::CREATED,
        "new to her"
    );
    assert_eq!(
        server.files()?.len(),
        5,
        "one copy, and two names for each owner: {:?}",
        server.files()?
    );
    assert_eq!(
        caller.delete(&path, &ada).await?,
        StatusCode::NO_CONTENT,
        "ada's is removed"
    );
    assert_eq!(
        caller.get(&path, &ada).await?.status(),
        StatusCode::NOT_FOUND,
        "for ada"
    );
    assert_eq!(
        caller.get(&path, &eve).await?.status(),
        StatusCode::OK,
        "not for eve"
    );
    assert_eq!(
        caller.delete(&path, &eve).await?,
        StatusCode::NO_CONTENT,
        "nor hers"
    );
    assert!(server.files()?.is_empty(), "the last takes the bytes along");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_is_no_package_or_has_another_hash_is_refused_and_leaves_nothing() -> Outcome
{
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let owner = caller.owner("ada");
    let mut damaged = package().bytes.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    let cut = package().bytes[..middle].to_vec();
    for (what, bytes) in [
        ("empty", Vec::new()),
        ("text", b"hello".to_vec()),
        ("a flipped bit", damaged),
        ("half", cut),
    ] {
        let answer = caller.put_package(&Package::of(bytes), &owner).await?;
        assert_eq!(answer.status(), StatusCode::UNPROCESSABLE_ENTITY, "{what}");
        let error = answer.text().await?;
        assert!(error.contains("package"), "{what}: {error}");
    }
    let wrong = Package {
        bytes: package().bytes.clone(),
        hash: "0".repeat(64),
    };
    let answer = caller.put_package(&wrong, &owner).await?;
    assert_eq!(
        answer.status(),
        StatusCode::UNPROCESSABLE_ENTITY,
        "another hash"
    );
    assert!(
        answer.text().await?.contains(&package().hash),
        "says which it has"
    );
    assert!(
        server.files()?.is_empty(),
        "nothing is kept: {:?}",
        server.files()?
    );
    let refused = |reason| format!("mon3tr_uploads_refused_total{{reason=\"{reason}\"}} ");
    assert_eq!(caller.metric(&refused("Package")).await?, 4, "counted");
    assert_eq!(caller.metric(&refused("Hash")).await?, 1, "counted");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_oversized_upload_is_refused_by_its_declared_length_and_while_it_streams() -> Outcome {
    let limit = package().bytes.len() as u64 - 1;
    let server = TestServer::start_with(|c| c.limits.package_bytes = limit).await?;
    let caller = &server.caller;
    let owner = caller.owner("ada");
    // Nothing but the head is sent.
    let mut stream = TcpStream::connect(caller.address).await?;
    let head = format!(
        "PUT {} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {owner}\r\nContent-Length: 99999999999\r\n\r\n",
        package().path()
    );
    stream.write_all(head.as_bytes()).await?;
    let mut answer = [0; 12];
    tokio::time::timeout(PATIENCE, stream.read_exact(&mut answer)).await??;
    assert_eq!(&answer, b"HTTP/1.1 413", "before any byte of it");
    // The whole package, with and without a declared length.
    let declared = caller.put_package(package(), &owner).await?;
    assert_eq!(declared.status(), StatusCode::PAYLOAD_TOO_LARGE, "declared");
    let chunks: Vec<_> = package().bytes.chunks(10_000).collect();
    let chunks = chunks
        .into_iter()
        .map(|c| Ok::<_, std::io::Error>(Bytes::copy_from_slice(c)));
    let request = caller.request(Method::PUT, &package().path(), &owner);
    let streamed = request
        .body(Body::wrap_stream(stream::iter(chunks)))
        .send()
        .await?;
    assert_eq!(
        streamed.status(),
        StatusCode::PAYLOAD_TOO_LARGE,
        "undeclared"
    );
    assert!(server.files()?.is_empty(), "nothing is kept");
    let line = "mon3tr_uploads_refused_total{reason=\"TooLarge\"} ";
    assert_eq!(caller.metric(line).await?, 3, "counted");
    Ok(())
}

/// Sends the head of an upload and half of its body.
async fn half_an_upload(server: &TestServer, chunked: bool) -> Outcome<TcpStream> {
    let (caller, package) = (&server.caller, package());
    let owner = caller.owner("ada");
    let mut stream = TcpStream::connect(caller.address).await?;
    let (path, size) = (package.path(), package.bytes.len());
    let length = if chunked {
        "Transfer-Encoding: chunked".to_owned()
    } else {
        format!("Content-Length: {size}")
    };
    let head = format!(
        "PUT {path} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {owner}\r\n{length}\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await?;
    if chunked {
        stream.write_all(format!("{size:x}\r\n").as_bytes()).await?;
    }
    stream.write_all(&package.bytes[..size / 2]).await?;
    Ok(stream)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_breaks_off_or_pauses_too_long_leaves_nothing_and_may_be_repeated() -> Outcome
{
    let server = TestServer::start_with(|c| c.limits.pause = Duration::from_millis(500)).await?;
    let caller = &server.caller;
    let line = "mon3tr_uploads_refused_total{reason=\"Incomplete\"} ";
    let mut expected = 0;
    for chunked in [false, true] {
        drop(half_an_upload(&server, chunked).await?);
        expected += 1;
        while caller.metric(line).await? < expected {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        let mut paused = half_an_upload(&server, chunked).await?;
        expected += 1;
        let mut answer = [0; 12];
        tokio::time::timeout(PATIENCE, paused.read_exact(&mut answer)).await??;
        assert_eq!(&answer, b"HTTP/1.1 408", "a pause is answered");
    }
    assert_eq!(caller.metric(line).await?, expected, "counted");
    assert!(
        server.files()?.is_empty(),
        "nothing is kept: {:?}",
        server.files()?
    );
    let owner = caller.owner("ada");
    assert_eq!(
        caller.put_package(package(), &owner).await?.status(),
        StatusCode::CREATED,
        "again"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn uploads_over_the_limit_are_asked_to_retry_later() -> Outcome {
    let server = TestServer::start_with(|c| c.limits.uploads_at_once = 1).await?;
    let caller = &server.caller;
    let owner = caller.owner("ada");
    let first = half_an_upload(&server, false).await?;
    while caller
        .metric("mon3tr_package_bytes_received_total ")
        .await?
        == 0
    {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let second = caller.put_package(package(), &owner).await?;
    assert_eq!(second.status(), StatusCode::SERVICE_UNAVAILABLE, "busy");
    assert!(
        second.headers().contains_key("retry-after"),
        "when to come back"
    );
    drop(first);
    let mut status = StatusCode::SERVICE_UNAVAILABLE;
    for _ in 0..100 {
        status = caller.put_package(package(), &owner).await?.status();
        if status == StatusCode::CREATED {
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(status, StatusCode::CREATED, "its place is free again");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn many_owners_putting_and_removing_the_same_bytes_at_once_never_lose_a_package() -> Outcome {
    let server = TestServer::start_with(|c| {
        c.limits.uploads_at_once = 64;
        c.limits.requests_per_second = 0;
    })
    .await?;
    let caller = &server.caller;
    let work = (0..12).map(|number| {
        let (caller, owner) = (caller.clone(), caller.owner(&format!("owner {number}")));
        tokio::spawn(async move {
            for _ in 0..3 {
                let put = caller.put_package(package(), &owner).await?.status();
                assert!(put.is_success(), "put: {put}");
                let got = caller.get(&package().path(), &owner).await?;
                assert_eq!(got.status(), StatusCode::OK, "what was put is there");
                assert!(got.bytes().await? == package().bytes, "and whole");
                let removed = caller.delete(&package().path(), &owner).await?;
                assert_eq!(removed, StatusCode::NO_CONTENT, "and removed");
            }
            Outcome::Ok(())
        })
    });
    for one in work.collect::<Vec<_>>() {
        one.await??;
    }
    assert!(
        server.files()?.is_empty(),
        "all is gone: {:?}",
        server.files()?
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn unfinished_uploads_of_a_dead_server_are_swept_and_a_folder_has_one_server() -> Outcome {
    let folder = tempfile::tempdir()?;
    let packages = folder.path().join("packages");
    std::fs::create_dir_all(&packages)?;
    let orphan = packages.join("0".repeat(64));
    let staged = packages.join(format!("{}#1", "1".repeat(64)));
    std::fs::write(&orphan, "bytes whose record was removed")?;
    std::fs::write(&staged, "half a pack")?;
    let path = folder.path().to_path_buf();
    let server = TestServer::start_with(|c| c.store = server::StoreConfig::Local(path)).await?;
    assert!(!staged.exists(), "swept before a client is served");
    for _ in 0..200 {
        if !orphan.exists() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert!(!orphan.exists(), "swept");
    let path = folder.path().to_path_buf();
    let second = TestServer::start_with(|c| c.store = server::StoreConfig::Local(path)).await;
    let error = second.err().ok_or("two servers in one folder")?.to_string();
    assert!(error.contains("another server uses"), "{error}");
    server.server.stop().await;
    Ok(())
}
