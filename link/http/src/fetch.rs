//! Fetches a package into the cache: one streaming request where all goes well, resumed where the connection breaks, and nothing is
//! called whole whose hash is not its name.

use std::{
    fs, io,
    path::{Path, PathBuf},
    time::Duration,
};

use reqwest::{
    Method, Response, StatusCode,
    header::{ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_RANGE, IF_RANGE, RANGE},
};

use crate::{
    Client, HttpError, PackageCache,
    cache::Lock,
    client::{PACKAGE, next_piece, unintelligible},
    error::with_causes,
    part::PartWriter,
};
use link_protocol::{PackageId, RoomLink, announcement::AvatarRef};

/// Attempts in a row that bring nothing to speak of.
const ATTEMPTS: u32 = 6;
/// Bytes that make an attempt count as a success: it bounds how often a server that cuts every connection is asked.
const WORTH: u64 = 64 << 10;
const LONGEST_PAUSE: Duration = Duration::from_secs(4);
const LONGEST_WAIT: Duration = Duration::from_secs(30);

/// How far a download is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Bytes that are here, with those of the part that was here before.
    pub done: u64,
    /// Bytes in all.
    pub total: u64,
    /// Bytes that crossed the network for it now.
    pub downloaded: u64,
}

/// How an attempt ended where it did not fail.
enum Outcome {
    Whole,
    /// All the bytes, and not the package.
    Damaged,
}

/// One package on its way.
struct Fetch<'a> {
    client: &'a Client,
    link: &'a RoomLink,
    avatar: &'a AvatarRef,
    cache: &'a PackageCache,
    lock: Lock,
    part: PathBuf,
}

impl Client {
    /// The path of the whole package, hash-checked. It is fetched only if the cache lacks it; what an interrupted download left is
    /// gone on from; who else fetches the same package into the same cache is waited for. May be cancelled at any time.
    ///
    /// # Errors
    /// [`HttpError::NotFound`], [`HttpError::NotAccepted`], [`HttpError::WrongSize`], [`HttpError::Damaged`],
    /// [`HttpError::GaveUp`], [`HttpError::DiskFull`], [`HttpError::Cache`], and those of any request.
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
        // Who held the lock may have fetched it.
        if let Some(path) = look_up(cache, avatar).await? {
            return Ok(path);
        }
        let part = cache.part(&avatar.sha256);
        Fetch {
            client: self,
            link,
            avatar,
            cache,
            lock,
            part,
        }
        .run(&mut progress)
        .await
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

impl Fetch<'_> {
    async fn run(self, progress: &mut impl FnMut(Progress)) -> Result<PathBuf, HttpError> {
        let (mut fruitless, mut damaged, mut downloaded) = (0, false, 0);
        let mut pause = self.client.patience().pause;
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
                        "package {} arrived damaged; fetching it once more",
                        self.avatar.sha256
                    );
                }
                Err(error) => {
                    let Some(wait) = may_be_tried_again(&error) else {
                        return Err(error);
                    };
                    let have = self.part_bytes()?;
                    if have >= had.saturating_add(WORTH) {
                        (fruitless, pause) = (0, self.client.patience().pause);
                    }
                    fruitless += 1;
                    if fruitless >= ATTEMPTS {
                        return Err(HttpError::GaveUp {
                            package: self.avatar.sha256,
                            attempts: fruitless,
                            have,
                            total: self.avatar.bytes,
                            last: Box::new(error),
                        });
                    }
                    let after = wait.max(spread(pause));
                    log::info!("{}; going on from byte {have}", with_causes(&error));
                    tokio::time::sleep(after).await;
                    pause = (pause * 2).min(LONGEST_PAUSE);
                }
            }
        }
    }

    /// One request, and its body to the part.
    async fn attempt(
        &self,
        had: u64,
        downloaded: &mut u64,
        progress: &mut impl FnMut(Progress),
    ) -> Result<Outcome, HttpError> {
        let total = self.avatar.bytes;
        if had >= total {
            // Whoever wrote it was stopped between its last byte and its rename; or it is nonsense, as its hash will tell.
            let writer = PartWriter::begin(&self.part, had, self.lock.clone());
            return self.judge(had, writer).await;
        }
        let (mut answer, kept) = self.ask_for(had).await?;
        let writer = PartWriter::begin(&self.part, kept, self.lock.clone());
        let mut bytes = kept;
        progress(Progress {
            done: kept,
            total,
            downloaded: *downloaded,
        });
        let ended = loop {
            match self.next_piece(&mut answer).await {
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
            Ok(()) => self.judge(bytes, writer).await,
            Err(error) => {
                self.written(bytes, writer).await?;
                if matches!(error, HttpError::WrongSize { .. }) {
                    self.discard()?;
                }
                Err(error)
            }
        }
    }

    /// The answer's head, and how many bytes of the part it goes on from.
    async fn ask_for(&self, had: u64) -> Result<(Response, u64), HttpError> {
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
            // No range: from the beginning, whatever we have.
            StatusCode::OK => 0,
            StatusCode::PARTIAL_CONTENT if had > 0 => had,
            StatusCode::RANGE_NOT_SATISFIABLE if had > 0 => {
                self.discard()?;
                return Err(HttpError::Broken {
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
            let encoding = token.struck_from(&String::from_utf8_lossy(encoding.as_bytes()));
            return Err(HttpError::Encoded {
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
                .ok_or_else(|| unintelligible(server, PACKAGE, "a part without saying which"))?;
            if size.is_some_and(|size| size != self.avatar.bytes) {
                return Err(self.wrong_size(size.unwrap_or_default()));
            }
            if first != kept {
                return Err(unintelligible(
                    server,
                    PACKAGE,
                    "another part than was asked for",
                ));
            }
        }
        if let Some(length) = answer.content_length() {
            // A range may end early; more than the whole never comes.
            let sent = kept.saturating_add(length);
            if sent > self.avatar.bytes || kept == 0 && sent != self.avatar.bytes {
                return Err(self.wrong_size(sent));
            }
        }
        Ok((answer, kept))
    }

    async fn next_piece(&self, answer: &mut Response) -> Result<Option<bytes::Bytes>, HttpError> {
        let limit = self.client.patience().silence;
        let server = self.link.server();
        tokio::time::timeout(limit, next_piece(server, answer))
            .await
            .map_err(|_| HttpError::TimedOut {
                server: server.clone(),
                what: PACKAGE,
                limit,
            })?
    }

    /// What the part is now that no more comes.
    async fn judge(&self, bytes: u64, writer: PartWriter) -> Result<Outcome, HttpError> {
        let hash = self.written(bytes, writer).await?;
        if bytes < self.avatar.bytes {
            return Err(HttpError::Broken {
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
            .map_err(|source| self.cache.wrong("write", &self.part, needed, source))
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
            Err(source) => Err(self.cache.wrong("read", &self.part, 0, source)),
        }
    }

    fn discard(&self) -> Result<(), HttpError> {
        remove(&self.part).map_err(|source| self.cache.wrong("remove", &self.part, 0, source))
    }

    /// Gives the part its name.
    fn keep(self) -> Result<PathBuf, HttpError> {
        let whole = self.cache.whole(&self.avatar.sha256);
        fs::rename(&self.part, &whole)
            .map_err(|source| self.cache.wrong("rename", &self.part, 0, source))?;
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

/// `bytes FIRST-LAST/SIZE`: the first byte, and the whole's size where it is told.
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

/// How long to wait at least before trying once more, where that may help.
pub(crate) fn may_be_tried_again(error: &HttpError) -> Option<Duration> {
    match error {
        HttpError::Broken { .. } | HttpError::TimedOut { .. } | HttpError::Unreachable { .. } => {
            Some(Duration::ZERO)
        }
        HttpError::Unavailable { retry_after, .. } | HttpError::RateLimited { retry_after, .. } => {
            Some(retry_after.unwrap_or_default().min(LONGEST_WAIT))
        }
        _ => None,
    }
}

/// Half to all of a pause, at random: a room full of viewers does not come back at once.
pub(crate) fn spread(pause: Duration) -> Duration {
    let random = getrandom::u32().unwrap_or(u32::MAX);
    pause.mul_f64(0.5 + 0.5 * f64::from(random) / f64::from(u32::MAX))
}
