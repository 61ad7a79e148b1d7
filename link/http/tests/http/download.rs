use std::{path::Path, time::Duration};

use link_http::{HttpError, PackageCache, download::Progress};
use link_protocol::{PackageId, announcement::AvatarRef};

use crate::{
    client,
    server::{Fault, Server, random_bytes},
};

const SIZE: usize = 3_000_000;

/// The result of a download from a server that begins with these faults.
struct Outcome {
    result: Result<Vec<u8>, HttpError>,
    server: Server,
    reported: Vec<Progress>,
    cache: tempfile::TempDir,
}

impl Outcome {
    fn part(&self) -> Option<u64> {
        let part = self
            .cache
            .path()
            .join(format!("{}.part", self.server.avatar().sha256));
        part.metadata().ok().map(|part| part.len())
    }

    fn is_whole(&self) -> bool {
        let id = self.result.as_ref().map(|bytes| PackageId::of_bytes(bytes));
        id.is_ok_and(|id| id == self.server.avatar().sha256) && self.part().is_none()
    }

    fn error(&self) -> &HttpError {
        self.result.as_ref().expect_err("a failure")
    }
}

async fn download(faults: impl IntoIterator<Item = Fault>) -> Outcome {
    download_after(faults, |_, _| ()).await
}

async fn download_after(
    faults: impl IntoIterator<Item = Fault>,
    prepare: impl FnOnce(&Path, &AvatarRef),
) -> Outcome {
    let server = Server::start(random_bytes(1, SIZE), faults).await;
    let cache = tempfile::tempdir().expect("a folder");
    prepare(cache.path(), &server.avatar());
    let mut reported = Vec::new();
    let packages = PackageCache::new(cache.path()).expect("a cache");
    let path = client()
        .fetch_package(&server.link(), &server.avatar(), &packages, |progress| {
            reported.push(progress);
        })
        .await;
    let result = path.map(|path| std::fs::read(path).expect("what was fetched"));
    Outcome {
        result,
        server,
        reported,
        cache,
    }
}

fn part_of(bytes: &[u8]) -> impl FnOnce(&Path, &AvatarRef) {
    move |folder, avatar| {
        std::fs::write(folder.join(format!("{}.part", avatar.sha256)), bytes).expect("a part");
    }
}

#[tokio::test]
async fn a_package_comes_in_one_request_with_its_progress() {
    let outcome = download([]).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert_eq!(
        outcome.server.ranges(),
        [None],
        "one request, for all of it"
    );
    let total = SIZE as u64;
    let begun = Progress {
        done: 0,
        total,
        downloaded: 0,
    };
    assert_eq!(outcome.reported.first(), Some(&begun), "from the beginning");
    let ended = Progress {
        done: total,
        total,
        downloaded: total,
    };
    assert_eq!(outcome.reported.last(), Some(&ended), "to the end");
}

#[tokio::test]
async fn a_broken_download_is_resumed_where_it_broke() {
    let outcome = download([
        Fault::Cut(1_000_000),
        Fault::Cut(500_000),
        Fault::EndsEarly(700_000),
    ])
    .await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    let ranges = [
        None,
        Some("bytes=1000000-".to_owned()),
        Some("bytes=1500000-".to_owned()),
        Some("bytes=2200000-".to_owned()),
    ];
    assert_eq!(outcome.server.ranges(), ranges, "no byte is fetched twice");
    let total = SIZE as u64;
    let ended = Progress {
        done: total,
        total,
        downloaded: total,
    };
    assert_eq!(
        outcome.reported.last(),
        Some(&ended),
        "all attempts are counted"
    );
}

#[tokio::test]
async fn a_server_that_falls_silent_is_asked_again() {
    let outcome = download([Fault::Stall(1_234_567)]).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert_eq!(
        outcome.server.ranges()[1].as_deref(),
        Some("bytes=1234567-"),
        "from where it fell silent"
    );
}

#[tokio::test]
async fn a_slow_server_is_waited_for_as_long_as_bytes_come() {
    // 30 pieces, 1.2 s in all: longer than a silence may be.
    let outcome = download([Fault::Slow(100_000, Duration::from_millis(40))]).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert_eq!(outcome.server.ranges(), [None], "one request");
}

#[tokio::test]
async fn a_server_that_drips_a_package_is_given_up_in_words() {
    // Never silent for as long as a silence may be, 5 to 50 bytes a second.
    for piece in [1, 10] {
        let drips = (0..6).map(|_| Fault::Slow(piece, Duration::from_millis(200)));
        let outcome = download(drips).await;
        let error = outcome.error();
        assert!(
            matches!(error, HttpError::GaveUp { last, .. } if matches!(**last, HttpError::TooSlow { .. })),
            "{error:?}"
        );
        assert!(
            outcome.part().is_some_and(|part| part > 0),
            "what came is kept"
        );
    }
}

#[tokio::test]
async fn a_server_that_drips_for_a_while_is_asked_again_and_the_package_comes() {
    let drip = Fault::Slow(1, Duration::from_millis(200));
    let outcome = download([drip]).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert_eq!(outcome.server.ranges().len(), 2, "from where it dripped");
}

#[tokio::test]
async fn a_line_of_64_kbit_is_fast_enough() {
    // 30 KB at 8 KB a second: several windows.
    let server = Server::start(
        random_bytes(2, 30_000),
        [Fault::Slow(800, Duration::from_millis(100))],
    )
    .await;
    let cache = tempfile::tempdir().expect("a folder");
    let packages = PackageCache::new(cache.path()).expect("a cache");
    let (client, link, avatar) = (client(), server.link(), server.avatar());
    let fetched = client.fetch_package(&link, &avatar, &packages, |_| ());
    fetched.await.expect("it comes");
    assert_eq!(server.ranges(), [None], "one request");
}

#[tokio::test]
async fn a_server_that_knows_no_ranges_is_read_from_the_beginning() {
    let outcome = download([Fault::Cut(1_000_000), Fault::IgnoresRange]).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert_eq!(outcome.server.ranges().len(), 2, "two requests");
}

#[tokio::test]
async fn a_server_in_trouble_is_asked_again_and_given_up_after_six_times() {
    let outcome = download([500, 503, 502, 429].map(|code| Fault::Status(code, "not now"))).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    let outcome = download(vec![Fault::Status(500, "not now"); 6]).await;
    assert!(
        matches!(
            outcome.error(),
            HttpError::GaveUp {
                attempts: 6,
                have: 0,
                ..
            }
        ),
        "{:?}",
        outcome.error()
    );
    let outcome = download(vec![Fault::Cut(1000); 20]).await;
    let HttpError::GaveUp {
        attempts: 6,
        have: 6000,
        ..
    } = outcome.error()
    else {
        panic!("{:?}", outcome.error())
    };
    assert_eq!(outcome.part(), Some(6000), "what has come is kept");
}

#[tokio::test]
async fn a_damaged_package_is_fetched_once_more_and_then_refused() {
    let outcome = download([Fault::WrongByte]).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert_eq!(outcome.server.ranges(), [None, None], "from the beginning");
    let outcome = download([Fault::WrongByte, Fault::WrongByte]).await;
    assert!(
        matches!(outcome.error(), HttpError::Damaged { .. }),
        "{:?}",
        outcome.error()
    );
    assert_eq!(
        (outcome.server.ranges().len(), outcome.part()),
        (2, None),
        "nothing damaged is left"
    );
}

#[tokio::test]
async fn a_damaged_part_is_thrown_away() {
    for size in [1, 1_000_000, SIZE, SIZE + 1] {
        let outcome = download_after([], part_of(&vec![7; size])).await;
        assert!(
            outcome.is_whole(),
            "a part of {size}: {:?}",
            outcome.result.err()
        );
        assert_eq!(
            outcome.server.ranges().last(),
            Some(&None),
            "a part of {size}: fetched from the beginning in the end"
        );
    }
}

#[tokio::test]
async fn a_part_of_an_earlier_call_is_resumed() {
    let outcome = download_after([], part_of(&random_bytes(1, SIZE)[..1_000_000])).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert_eq!(
        outcome.server.ranges(),
        [Some("bytes=1000000-".to_owned())],
        "the rest only"
    );
    let total = SIZE as u64;
    let ended = Progress {
        done: total,
        total,
        downloaded: total - 1_000_000,
    };
    assert_eq!(
        outcome.reported.last(),
        Some(&ended),
        "what was there was not downloaded"
    );
}

#[tokio::test]
async fn a_complete_part_is_renamed_and_not_fetched() {
    let outcome = download_after([], part_of(&random_bytes(1, SIZE))).await;
    assert!(outcome.is_whole(), "{:?}", outcome.result.err());
    assert!(outcome.server.requests().is_empty(), "no request");
}

#[tokio::test]
async fn a_package_of_another_size_is_refused_at_once() {
    for (fault, reported) in [
        (Fault::Length(SIZE + 1), SIZE + 1),
        (Fault::Length(SIZE - 1), SIZE - 1),
        (Fault::Length(10 * SIZE), 10 * SIZE),
    ] {
        let outcome = download([fault]).await;
        let HttpError::WrongSize {
            announced, sent, ..
        } = outcome.error()
        else {
            panic!("{:?}", outcome.error())
        };
        assert_eq!(
            (*announced, *sent),
            (SIZE as u64, reported as u64),
            "both sizes"
        );
        assert_eq!(
            (outcome.server.ranges().len(), outcome.part()),
            (1, None),
            "asked once, nothing kept"
        );
    }
}

#[tokio::test]
async fn a_package_that_does_not_end_is_cut_off() {
    let outcome = download([Fault::LengthUntold(5 * SIZE)]).await;
    assert!(
        matches!(outcome.error(), HttpError::WrongSize { .. }),
        "{:?}",
        outcome.error()
    );
    assert_eq!(
        (outcome.server.ranges().len(), outcome.part()),
        (1, None),
        "asked once, nothing kept"
    );
}

#[tokio::test]
async fn an_answer_with_false_headers_is_refused() {
    let outcome = download([Fault::CallsItGzip]).await;
    assert!(
        matches!(outcome.error(), HttpError::CompressedPackage { encoding, .. } if encoding == "gzip"),
        "{:?}",
        outcome.error()
    );
    let outcome = download([Fault::Cut(1_000_000), Fault::OtherRange]).await;
    assert!(
        matches!(outcome.error(), HttpError::InvalidResponse { .. }),
        "{:?}",
        outcome.error()
    );
}

#[tokio::test]
async fn a_refusal_is_not_asked_again() {
    for code in [401, 404, 403] {
        let outcome = download([Fault::Status(code, "no")]).await;
        let right = match (code, outcome.error()) {
            (401, HttpError::Unauthorized { .. }) | (404, HttpError::NotFound { .. }) => true,
            (403, HttpError::Refused { status, said, .. }) => *status == 403 && said == "no",
            _ => false,
        };
        assert!(right, "{code}: {:?}", outcome.error());
        assert_eq!(outcome.server.requests().len(), 1, "{code}: one request");
    }
}

#[tokio::test]
async fn a_server_that_is_gone_is_named() {
    let server = Server::start(random_bytes(1, 10), []).await;
    let gone = std::net::TcpListener::bind("127.0.0.1:0")
        .and_then(|socket| socket.local_addr())
        .expect("a free port");
    let link = server
        .link()
        .to_string()
        .replace(&server.address.to_string(), &gone.to_string())
        .parse()
        .expect("a link");
    let error = client()
        .announcement(&link)
        .await
        .expect_err("no server there");
    assert!(
        matches!(error, HttpError::Unreachable { .. })
            && error.to_string().contains(&gone.to_string()),
        "{error}"
    );
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_full_disk_is_named_with_its_folder() {
    // A part that is /dev/full takes no byte, as a full disk.
    let outcome = download_after([], |folder, avatar| {
        std::os::unix::fs::symlink("/dev/full", folder.join(format!("{}.part", avatar.sha256)))
            .expect("a link");
    })
    .await;
    let HttpError::DiskFull { folder, needed } = outcome.error() else {
        panic!("{:?}", outcome.error())
    };
    assert_eq!(
        (folder.as_path(), *needed),
        (outcome.cache.path(), SIZE as u64),
        "where, and how much is needed"
    );
}
