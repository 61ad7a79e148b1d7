//! Downloads a package into the cache: one streaming request, resumed where the connection breaks. A file gets its final name only after
//! its hash was checked.

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering::Relaxed},
    time::Duration,
};

use bytes::Bytes;
use reqwest::{
    Method, Response, StatusCode,
    header::{ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_RANGE, IF_RANGE, RANGE},
};

use tokio::time::{Instant, timeout_at};

use crate::{
    Client, HttpError, PackageCache,
    cache::Lock,
    client::{PACKAGE, invalid_response, next_piece},
    error::with_causes,
    pace::{Pace, longest},
    part::PartWriter,
};
use link_protocol::{PackageId, RoomLink, announcement::AvatarRef};

/// Attempts in a row that bring less than [`MIN_PROGRESS`].
const ATTEMPTS: u32 = 6;
/// Bytes that an attempt must bring to count as progress: this bounds the requests to a server that cuts every connection.
const MIN_PROGRESS: u64 = 64 << 10;
/// Bounds of the waits before a retry: the client's own, and the server's `Retry-After`.
const MAX_RETRY_PAUSE: Duration = Duration::from_secs(4);
const MAX_RETRY_AFTER: Duration = Duration::from_secs(30);
/// What a download has to take at least, by the pace of the moment, before the log says how long it takes.
const WORTH_TELLING: u64 = 120;

/// The progress of a download.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Bytes in the cache, with those of an interrupted download before.
    pub done: u64,
    /// Bytes of the package.
    pub total: u64,
    /// Bytes received by this call.
    pub downloaded: u64,
}

/// How an attempt ended where it did not fail.
enum Outcome {
    Whole,
    /// As many bytes as announced, with another hash.
    Damaged,
}

/// The download of one package.
struct Download<'a> {
    client: &'a Client,
    link: &'a RoomLink,
    avatar: &'a AvatarRef,
    cache: &'a PackageCache,
    lock: Lock,
    part: PathBuf,
    /// The log has said how long this takes.
    is_told: AtomicBool,
}

impl Client {
    /// The path of the package in the cache, hash-checked. It is downloaded only if the cache lacks it, from where an interrupted download
    /// ended. If another program is downloading it into the same cache, waits for that. May be cancelled at any time.
    ///
    /// # Errors
    /// [`HttpError::NotFound`], [`HttpError::Unauthorized`], [`HttpError::WrongSize`], [`HttpError::Damaged`],
    /// [`HttpError::GaveUp`], [`HttpError::TooSlow`], [`HttpError::DiskFull`], [`HttpError::Cache`], and those of any
    /// request.
    pub async fn fetch_package(
        &self,
        link: &RoomLink,
        avatar: &AvatarRef,
        cache: &PackageCache,
        mut progress: impl FnMut(Progress),
    ) -> Result<PathBuf, HttpError> {
        avatar.checked()?;
        if let Some(path) = look_up(cache, avatar).await? {
            return Ok(path);
        }
        let lock = cache.lock(&avatar.sha256).await?;
        // The lock's last holder may have downloaded it.
        if let Some(path) = look_up(cache, avatar).await? {
            return Ok(path);
        }
        let part = cache.part(&avatar.sha256);
        let download = Download {
            client: self,
            link,
            avatar,
            cache,
            lock,
            part,
            is_told: AtomicBool::new(false),
        };
        let over = longest(avatar.bytes);
        let run = tokio::time::timeout(over, download.run(&mut progress));
        run.await.unwrap_or_else(|_| {
            let server = link.server().clone();
            Err(HttpError::TooSlow { server, over })
        })
    }
}

async fn look_up(cache: &PackageCache, avatar: &AvatarRef) -> Result<Option<PathBuf>, HttpError> {
    let (cache, avatar) = (cache.clone(), *avatar);
    let path = cache.whole(&avatar.sha256);
    tokio::task::spawn_blocking(move || cache.look_up(&avatar))
        .await
        .map_err(|error| HttpError::Cache {
            doing: "read",
            path,
            source: io::Error::other(error),
        })
}

impl Download<'_> {
    async fn run(self, progress: &mut impl FnMut(Progress)) -> Result<PathBuf, HttpError> {
        let (mut failures, mut damaged, mut downloaded) = (0, false, 0);
        let mut pause = self.client.timeouts().retry;
        loop {
            let had = self.part_bytes()?;
            match self.attempt(had, &mut downloaded, progress).await {
                Ok(Outcome::Whole) => return self.keep(),
                Ok(Outcome::Damaged) => {
                    self.discard()?;
                    if damaged {
                        return Err(HttpError::Damaged {
                            server: self.link.server().clone(),
                            package: self.avatar.sha256,
                        });
                    }
                    damaged = true;
                    log::warn!(
                        "package {} arrived damaged; downloading it once more",
                        self.avatar.sha256
                    );
                }
                Err(error) => {
                    let Some(wait) = retry_delay(&error) else {
                        return Err(error);
                    };
                    let have = self.part_bytes()?;
                    if have >= had.saturating_add(MIN_PROGRESS) {
                        (failures, pause) = (0, self.client.timeouts().retry);
                    }
                    failures += 1;
                    if failures >= ATTEMPTS {
                        return Err(HttpError::GaveUp {
                            package: self.avatar.sha256,
                            attempts: failures,
                            have,
                            total: self.avatar.bytes,
                            last: Box::new(error),
                        });
                    }
                    let after = wait.max(jittered(pause));
                    log::info!("{}; resuming at byte {have}", with_causes(&error));
                    tokio::time::sleep(after).await;
                    pause = (pause * 2).min(MAX_RETRY_PAUSE);
                }
            }
        }
    }

    /// One request, and its body into the part file.
    async fn attempt(
        &self,
        had: u64,
        downloaded: &mut u64,
        progress: &mut impl FnMut(Progress),
    ) -> Result<Outcome, HttpError> {
        let total = self.avatar.bytes;
        if had >= total {
            // A program was stopped between its last byte and the rename; or the file is damaged, as the hash will show.
            let writer = PartWriter::begin(&self.part, had, self.lock.clone());
            return self.verify(had, writer).await;
        }
        let (mut answer, kept) = self.request_from(had).await?;
        let writer = PartWriter::begin(&self.part, kept, self.lock.clone());
        let mut bytes = kept;
        let mut pace = Pace::new(self.client.timeouts().pace);
        progress(Progress {
            done: kept,
            total,
            downloaded: *downloaded,
        });
        let ended = loop {
            match self.next_piece(&mut answer, &mut pace, bytes).await {
                Ok(Some(piece)) => {
                    let length = piece.len() as u64;
                    bytes += length;
                    if bytes > total {
                        break Err(self.wrong_size(bytes));
                    }
                    if !writer.push(piece).await {
                        break Ok(());
                    }
                    *downloaded += length;
                    progress(Progress {
                        done: bytes,
                        total,
                        downloaded: *downloaded,
                    });
                }
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        match ended {
            Ok(()) => self.verify(bytes, writer).await,
            Err(error) => {
                self.written(bytes, writer).await?;
                if matches!(error, HttpError::WrongSize { .. }) {
                    self.discard()?;
                }
                Err(error)
            }
        }
    }

    /// The response's head, and the byte of the package that its body begins with.
    async fn request_from(&self, had: u64) -> Result<(Response, u64), HttpError> {
        let (server, token) = (self.link.server(), self.link.token());
        let name = self.avatar.sha256.to_string();
        let mut request = self
            .client
            .request(Method::GET, server, token, &["packages", &name])?
            .header(ACCEPT_ENCODING, "identity");
        if had > 0 {
            request = request
                .header(RANGE, format!("bytes={had}-"))
                .header(IF_RANGE, format!("\"{name}\""));
        }
        let answer = self.client.open(server, PACKAGE, request).await?;
        let kept = match answer.status() {
            // The server ignored the range: its body is the whole package.
            StatusCode::OK => 0,
            StatusCode::PARTIAL_CONTENT if had > 0 => had,
            StatusCode::RANGE_NOT_SATISFIABLE if had > 0 => {
                self.discard()?;
                return Err(HttpError::ConnectionLost {
                    server: server.clone(),
                    source: None,
                });
            }
            _ => return Err(self.client.refusal(server, token, PACKAGE, answer).await),
        };
        let headers = answer.headers();
        if let Some(encoding) = headers
            .get(CONTENT_ENCODING)
            .filter(|encoding| *encoding != "identity")
        {
            let encoding = token.redact(&String::from_utf8_lossy(encoding.as_bytes()));
            return Err(HttpError::CompressedPackage {
                server: server.clone(),
                encoding,
            });
        }
        if kept > 0 {
            let range = headers
                .get(CONTENT_RANGE)
                .and_then(|range| range.to_str().ok())
                .unwrap_or_default();
            let (first, size) = read_range(range)
                .ok_or_else(|| invalid_response(server, PACKAGE, "a part without Content-Range"))?;
            if size.is_some_and(|size| size != self.avatar.bytes) {
                return Err(self.wrong_size(size.unwrap_or_default()));
            }
            if first != kept {
                return Err(invalid_response(
                    server,
                    PACKAGE,
                    "another range than was asked for",
                ));
            }
        }
        if let Some(length) = answer.content_length() {
            // A range may end before the package does; more than the package is an error.
            let sent = kept.saturating_add(length);
            if sent > self.avatar.bytes || kept == 0 && sent != self.avatar.bytes {
                return Err(self.wrong_size(sent));
            }
        }
        Ok((answer, kept))
    }

    /// The next piece, after so many `bytes` of the package.
    async fn next_piece(
        &self,
        answer: &mut Response,
        pace: &mut Pace,
        bytes: u64,
    ) -> Result<Option<Bytes>, HttpError> {
        let limit = self.client.timeouts().idle;
        let server = self.link.server();
        let silent = Instant::now() + limit;
        loop {
            let piece = timeout_at(silent.min(pace.ends()), next_piece(server, answer)).await;
            let came = match &piece {
                Ok(Ok(Some(piece))) => piece.len() as u64,
                Ok(_) => return piece.unwrap_or(Ok(None)),
                Err(_) => 0,
            };
            pace.add(came);
            if Instant::now() >= pace.ends() {
                self.check(pace, bytes + came)?;
            }
            if let Ok(piece) = piece {
                return piece;
            }
            if Instant::now() >= silent {
                return Err(HttpError::TimedOut {
                    server: server.clone(),
                    what: PACKAGE,
                    limit,
                });
            }
        }
    }

    /// That enough came in the window that is over. Where much is left, the log says once how long it takes.
    fn check(&self, pace: &mut Pace, bytes: u64) -> Result<(), HttpError> {
        let Some(rate) = pace.next() else {
            return Err(HttpError::TooSlow {
                server: self.link.server().clone(),
                over: self.client.timeouts().pace,
            });
        };
        let left = self.avatar.bytes.saturating_sub(bytes) / rate.max(1);
        if left >= WORTH_TELLING && !self.is_told.swap(true, Relaxed) {
            log::warn!(
                "{} sends the package at {} KiB/s: some {} minutes are left",
                self.link.server(),
                rate >> 10,
                left / 60
            );
        }
        Ok(())
    }

    /// Whether the part file is the package, after its last byte.
    async fn verify(&self, bytes: u64, writer: PartWriter) -> Result<Outcome, HttpError> {
        let hash = self.written(bytes, writer).await?;
        if bytes < self.avatar.bytes {
            return Err(HttpError::ConnectionLost {
                server: self.link.server().clone(),
                source: None,
            });
        }
        Ok(if hash == self.avatar.sha256 {
            Outcome::Whole
        } else {
            Outcome::Damaged
        })
    }

    async fn written(&self, bytes: u64, writer: PartWriter) -> Result<PackageId, HttpError> {
        let needed = self
            .avatar
            .bytes
            .saturating_sub(self.part_bytes()?.min(bytes));
        writer
            .finish()
            .await
            .map_err(|source| self.cache.io_error("write", &self.part, needed, source))
    }

    fn wrong_size(&self, sent: u64) -> HttpError {
        HttpError::WrongSize {
            package: self.avatar.sha256,
            announced: self.avatar.bytes,
            sent,
        }
    }

    fn part_bytes(&self) -> Result<u64, HttpError> {
        match self.part.metadata() {
            Ok(metadata) => Ok(metadata.len()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
            Err(source) => Err(self.cache.io_error("read", &self.part, 0, source)),
        }
    }

    fn discard(&self) -> Result<(), HttpError> {
        remove(&self.part).map_err(|source| self.cache.io_error("remove", &self.part, 0, source))
    }

    /// Renames the part file to its final name.
    fn keep(self) -> Result<PathBuf, HttpError> {
        let whole = self.cache.whole(&self.avatar.sha256);
        fs::rename(&self.part, &whole)
            .map_err(|source| self.cache.io_error("rename", &self.part, 0, source))?;
        self.cache.evict(&self.avatar.sha256);
        Ok(whole)
    }
}

fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// `bytes FIRST-LAST/SIZE`: the first byte, and the whole's size unless it is `*`.
fn read_range(text: &str) -> Option<(u64, Option<u64>)> {
    let (range, size) = text.strip_prefix("bytes ")?.split_once('/')?;
    let (first, _) = range.split_once('-')?;
    let size = if size == "*" {
        None
    } else {
        Some(size.parse().ok()?)
    };
    Some((first.parse().ok()?, size))
}

/// The shortest wait before a retry, if a retry may help.
pub(crate) fn retry_delay(error: &HttpError) -> Option<Duration> {
    match error {
        HttpError::ConnectionLost { .. }
        | HttpError::TimedOut { .. }
        | HttpError::TooSlow { .. }
        | HttpError::Unreachable { .. } => Some(Duration::ZERO),
        HttpError::Unavailable { retry_after, .. } | HttpError::RateLimited { retry_after, .. } => {
            Some(retry_after.unwrap_or_default().min(MAX_RETRY_AFTER))
        }
        _ => None,
    }
}

/// A random half to whole of a pause, so that the viewers of a room do not retry at the same moment.
pub(crate) fn jittered(pause: Duration) -> Duration {
    let random = getrandom::u32().unwrap_or(u32::MAX);
    pause.mul_f64(0.5 + 0.5 * f64::from(random) / f64::from(u32::MAX))
}
