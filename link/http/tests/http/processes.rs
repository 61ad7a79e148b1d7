//! Several processes and one cache. A test starts itself again as the other process.

use std::{
    env,
    path::Path,
    process::{Child, Command, ExitStatus},
    time::{Duration, Instant},
};

use link_http::PackageCache;
use link_protocol::{RoomLink, announcement::AvatarRef};

use crate::{
    client,
    server::{Fault, Server, random_bytes},
};

const TASK: &str = "MON3TR_TEST_FETCH";

/// This test in a process of its own, where [`is_child`] fetches.
fn child(test: &str, server: &Server, cache: &Path) -> Child {
    let AvatarRef { sha256, bytes } = server.avatar();
    let task = format!("{} {sha256} {bytes} {}", server.link(), cache.display());
    // Not `current_exe`: under another dynamic loader that is the loader.
    let mut command = Command::new(env::args_os().next().expect("this program"));
    command
        .args(["--exact", &format!("processes::{test}")])
        .env(TASK, task)
        .spawn()
        .expect("a child")
}

/// In a child: fetches the package that its parent names, and prints the result.
async fn is_child() -> bool {
    let Ok(task) = env::var(TASK) else {
        return false;
    };
    let [link, sha256, bytes, cache] = task.splitn(4, ' ').collect::<Vec<_>>()[..] else {
        panic!("{task}")
    };
    let link: RoomLink = link.parse().expect("a link");
    let avatar = AvatarRef {
        sha256: sha256.parse().expect("a hash"),
        bytes: bytes.parse().expect("a size"),
    };
    let cache = PackageCache::new(Path::new(cache)).expect("a cache");
    let path = client()
        .fetch_package(&link, &avatar, &cache, |_| ())
        .await
        .expect("fetched");
    assert_eq!(
        AvatarRef::of_file(&path).expect("read").sha256,
        avatar.sha256,
        "the package"
    );
    true
}

async fn until(child: &mut Child, what: impl Fn() -> bool) {
    let begun = Instant::now();
    while !what() {
        assert!(begun.elapsed() < Duration::from_secs(60), "it is late");
        let ended = child.try_wait().expect("a child");
        assert!(
            ended.is_none(),
            "the child has ended before its time: {ended:?}"
        );
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

async fn ended(child: &mut Child) -> ExitStatus {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child") {
            return status;
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "it is late");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn the_download_of_a_killed_process_is_resumed() {
    if is_child().await {
        return;
    }
    let server = Server::start(
        random_bytes(5, 2_000_000),
        [Fault::Slow(50_000, Duration::from_millis(100))],
    )
    .await;
    let folder = tempfile::tempdir().expect("a folder");
    let avatar = server.avatar();
    let part = folder.path().join(format!("{}.part", avatar.sha256));
    let mut child = child(
        "the_download_of_a_killed_process_is_resumed",
        &server,
        folder.path(),
    );
    until(&mut child, || {
        part.metadata().map_or(0, |part| part.len()) >= 500_000
    })
    .await;
    child.kill().expect("killed");
    child.wait().expect("gone");
    let left = part.metadata().expect("the part").len();
    let cache = PackageCache::new(folder.path()).expect("a cache");
    let path = client()
        .fetch_package(&server.link(), &avatar, &cache, |_| ())
        .await
        .expect("fetched");
    assert_eq!(
        AvatarRef::of_file(&path).expect("read").sha256,
        avatar.sha256,
        "the package"
    );
    assert_eq!(
        server.ranges(),
        [None, Some(format!("bytes={left}-"))],
        "the rest only"
    );
}

#[tokio::test]
async fn processes_that_want_the_same_package_fetch_it_once() {
    if is_child().await {
        return;
    }
    let server = Server::start(
        random_bytes(6, 1_000_000),
        [Fault::Slow(50_000, Duration::from_millis(30))],
    )
    .await;
    let folder = tempfile::tempdir().expect("a folder");
    let children: Vec<Child> = (0..3)
        .map(|_| {
            child(
                "processes_that_want_the_same_package_fetch_it_once",
                &server,
                folder.path(),
            )
        })
        .collect();
    for mut child in children {
        let status = ended(&mut child).await;
        assert!(status.success(), "each has it");
    }
    assert_eq!(server.requests().len(), 1, "one request");
}

#[tokio::test]
async fn another_process_takes_over_from_one_that_is_killed() {
    if is_child().await {
        return;
    }
    let server = Server::start(
        random_bytes(7, 2_000_000),
        [Fault::Slow(50_000, Duration::from_millis(100))],
    )
    .await;
    let folder = tempfile::tempdir().expect("a folder");
    let test = "another_process_takes_over_from_one_that_is_killed";
    let mut first = child(test, &server, folder.path());
    until(&mut first, || !server.requests().is_empty()).await;
    let mut second = child(test, &server, folder.path());
    let part = folder
        .path()
        .join(format!("{}.part", server.avatar().sha256));
    until(&mut first, || {
        part.metadata().map_or(0, |part| part.len()) >= 500_000
    })
    .await;
    first.kill().expect("killed");
    first.wait().expect("gone");
    let status = ended(&mut second).await;
    assert!(status.success(), "the second has it");
    assert_eq!(
        server.requests().len(),
        2,
        "it goes on from what the first left"
    );
    assert!(
        server.ranges()[1].is_some(),
        "it goes on from what the first left"
    );
}
