use std::{
    fs::{self, File},
    time::{Duration, SystemTime},
};

use link_http::{HttpError, PackageCache};

use crate::{
    client,
    server::{Fault, Server, random_bytes},
};

#[tokio::test]
async fn a_second_call_sends_no_request() {
    let server = Server::start(random_bytes(2, 100_000), []).await;
    let folder = tempfile::tempdir().expect("a folder");
    let cache = PackageCache::new(folder.path().join("made/when/needed")).expect("a cache");
    let (link, avatar) = (server.link(), server.avatar());
    let first = client()
        .fetch_package(&link, &avatar, &cache, |_| ())
        .await
        .expect("fetched");
    let second = client()
        .fetch_package(&link, &avatar, &cache, |reported| panic!("{reported:?}"))
        .await
        .expect("kept");
    assert_eq!(
        (first, server.requests().len()),
        (second, 1),
        "the same file, one request"
    );
}

#[tokio::test]
async fn a_changed_package_in_the_cache_is_fetched_again() {
    let server = Server::start(random_bytes(2, 100_000), []).await;
    let folder = tempfile::tempdir().expect("a folder");
    let cache = PackageCache::new(folder.path()).expect("a cache");
    let (link, avatar) = (server.link(), server.avatar());
    let path = client()
        .fetch_package(&link, &avatar, &cache, |_| ())
        .await
        .expect("fetched");
    let good = fs::read(&path).expect("read");
    let mut wrong = good.clone();
    wrong[50_000] ^= 1;
    for bad in [wrong, good[..99_999].to_vec(), Vec::new()] {
        fs::write(&path, &bad).expect("damaged");
        client()
            .fetch_package(&link, &avatar, &cache, |_| ())
            .await
            .expect("fetched again");
        assert_eq!(fs::read(&path).expect("read"), good, "good again");
    }
    assert_eq!(server.requests().len(), 4, "once, and once for each damage");
}

#[tokio::test]
async fn two_tasks_that_want_the_same_package_fetch_it_once() {
    let server = Server::start(
        random_bytes(3, 1_000_000),
        [Fault::Slow(100_000, Duration::from_millis(30))],
    )
    .await;
    let folder = tempfile::tempdir().expect("a folder");
    let cache = PackageCache::new(folder.path()).expect("a cache");
    let (link, avatar) = (server.link(), server.avatar());
    let fetch = async || {
        client()
            .fetch_package(&link, &avatar, &cache, |_| ())
            .await
            .expect("fetched")
    };
    let (one, other) = tokio::join!(fetch(), fetch());
    assert_eq!(one, other, "the same file");
    assert_eq!(server.requests().len(), 1, "one request");
}

#[tokio::test]
async fn a_cancelled_download_is_resumed() {
    let server = Server::start(random_bytes(4, 1_000_000), [Fault::Stall(400_000)]).await;
    let folder = tempfile::tempdir().expect("a folder");
    let cache = PackageCache::new(folder.path()).expect("a cache");
    let (link, avatar) = (server.link(), server.avatar());
    let part = folder.path().join(format!("{}.part", avatar.sha256));
    let client = client();
    tokio::select! {
        _ = client.fetch_package(&link, &avatar, &cache, |_| ()) => panic!("it stalls"),
        () = async { while part.metadata().map_or(0, |part| part.len()) < 400_000 { tokio::task::yield_now().await; } } => {}
    }
    client
        .fetch_package(&link, &avatar, &cache, |_| ())
        .await
        .expect("fetched");
    assert_eq!(
        server.ranges(),
        [None, Some("bytes=400000-".to_owned())],
        "the rest only"
    );
}

#[tokio::test]
async fn the_least_recently_used_package_is_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let cache = PackageCache::new(folder.path())
        .expect("a cache")
        .with_limit(250_000);
    let stranger = folder.path().join("notes.m3a");
    fs::write(&stranger, vec![0; 1_000_000]).expect("written");
    let mut fetched = Vec::new();
    for seed in 10..14_u64 {
        let server = Server::start(random_bytes(seed, 100_000), []).await;
        let path = client()
            .fetch_package(&server.link(), &server.avatar(), &cache, |_| ())
            .await
            .expect("fetched");
        if seed == 12 {
            // The first is used again, so the second is now the oldest; it and its successor go for the last.
            assert!(
                !fetched
                    .iter()
                    .all(|(_, path): &(Server, std::path::PathBuf)| path.exists()),
                "one made room"
            );
        }
        let age = SystemTime::now() - Duration::from_secs(1000 - seed * 10);
        File::options()
            .append(true)
            .open(&path)
            .and_then(|file| file.set_modified(age))
            .expect("aged");
        fetched.push((server, path));
        if seed == 11 {
            let (server, _) = &fetched[0];
            client()
                .fetch_package(&server.link(), &server.avatar(), &cache, |_| ())
                .await
                .expect("used again");
        }
    }
    let left: Vec<bool> = fetched.iter().map(|(_, path)| path.exists()).collect();
    assert_eq!(
        left,
        [true, false, false, true],
        "the one that was used again and the newest"
    );
    assert!(stranger.exists(), "a file that is not the cache's stays");
}

#[tokio::test]
async fn a_package_stays_while_it_is_in_use() {
    let folder = tempfile::tempdir().expect("a folder");
    let open = || PackageCache::new(folder.path()).expect("a cache");
    let cache = open().with_limit(150_000);
    let fetch = async |seed| {
        let server = Server::start(random_bytes(seed, 100_000), []).await;
        let path = client()
            .fetch_package(&server.link(), &server.avatar(), &cache, |_| ())
            .await
            .expect("fetched");
        (server.avatar().sha256, path)
    };
    let (package, used) = fetch(20).await;
    // Marked by another `PackageCache` of the same folder, as another process would.
    let in_use = open().in_use(&package).expect("a lock");
    assert!(in_use.is_some(), "no program writes it");
    let (_, newer) = fetch(21).await;
    assert!(used.exists() && newer.exists(), "both, over the bound");
    cache.tidy();
    assert_eq!(
        (used.exists(), newer.exists()),
        (true, false),
        "the package that is not in use was removed"
    );
    drop(in_use);
    cache.clone().with_limit(0).tidy();
    assert!(!used.exists(), "now it may go as well");
}

#[tokio::test]
async fn a_cache_folder_that_is_a_file_is_named() {
    let file = tempfile::NamedTempFile::new().expect("a file");
    let error = PackageCache::new(file.path()).expect_err("a file is no folder");
    assert!(
        matches!(&error, HttpError::Cache { path, .. } if path == file.path()),
        "{error}"
    );
}
