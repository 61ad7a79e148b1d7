//! Fetching a package: resumed where it broke off, checked against its hash, kept.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use futures_util::StreamExt;
use reqwest::header::{CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_RANGE, IF_RANGE, RANGE};
use reqwest::{Method, Response, StatusCode};
use sha2::{Digest, Sha256};
use tokio::fs::File;
use tokio::io::{AsyncSeekExt, AsyncWriteExt, BufWriter};

use super::cache::cannot;
use super::client::{ANSWERING, Request};
use super::error::of_request;
use super::package_id::hash_reader;
use super::rooms::about;
use super::{AvatarRef, Client, HttpError, PackageCache, PackageId, RoomLink};

/// Attempts in a row that bring nothing before this gives up, and the pause between two, which doubles.
const ATTEMPTS: u32 = 5;
const PAUSE: Duration = Duration::from_millis(200);
/// Silence after which a download counts as broken.
const SILENCE: Duration = Duration::from_secs(10);
/// Bytes gathered before they go to the disk.
const BUFFER: usize = 1 << 20;

/// How far a download is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Bytes that are here, of the part that was here before too.
    pub done: u64,
    /// Bytes in all.
    pub total: u64,
    /// Bytes that crossed the network for it now.
    pub downloaded: u64,
}

/// A package on its way.
struct Download<'a> {
    about: Request<'a>,
    avatar: &'a AvatarRef,
    cache: &'a PackageCache,
    file: BufWriter<File>,
    hash: Sha256,
    progress: Progress,
}

impl Client {
    /// The announced package, out of the cache or fetched into it, as a file of its whole and checked bytes. `progress` is
    /// told how far it is.
    ///
    /// # Errors
    /// If the server cannot be reached or refuses, the package is not what was announced, or the cache cannot hold it. What has
    /// come is kept, and the next call goes on from there.
    pub async fn fetch_package(
        &self,
        room: &RoomLink,
        avatar: &AvatarRef,
        cache: &PackageCache,
        mut progress: impl FnMut(Progress),
    ) -> Result<PathBuf, HttpError> {
        let (looked_in, wanted) = (cache.clone(), *avatar);
        let (lock, found) = blocking(cache, move || {
            let lock = looked_in.lock(&wanted.sha256)?;
            let found = looked_in.find(&wanted.sha256, wanted.bytes)?;
            Ok((lock, found))
        })
        .await?;
        if let Some(path) = found {
            return Ok(path);
        }
        let mut download = Download::open(room, avatar, cache).await?;
        // What was here before may be damaged; then all of it is fetched once more.
        for again in [true, false] {
            download.run(self, &mut progress).await?;
            if download.is_intact() {
                let path = download.keep().await?;
                drop(lock);
                return Ok(path);
            }
            if again {
                log::warn!(
                    "package {} arrived damaged: fetching it again",
                    avatar.sha256
                );
            }
            download.start_over().await?;
        }
        Err(HttpError::Damaged {
            server: room.server().clone(),
            package: avatar.sha256,
        })
    }
}

impl<'a> Download<'a> {
    /// With the part that is here already, hashed.
    async fn open(
        room: &'a RoomLink,
        avatar: &'a AvatarRef,
        cache: &'a PackageCache,
    ) -> Result<Self, HttpError> {
        let path = cache.part(&avatar.sha256);
        let opened = path.clone();
        let bytes = avatar.bytes;
        let (file, hash, done) = blocking(cache, move || {
            let open = || -> io::Result<_> {
                let mut file = std::fs::File::options()
                    .create(true)
                    .read(true)
                    .write(true)
                    .truncate(false)
                    .open(&opened)?;
                let mut hash = Sha256::new();
                let mut done = hash_reader(&mut hash, &mut file)?;
                if done > bytes {
                    file.set_len(0)?;
                    io::Seek::rewind(&mut file)?;
                    (hash, done) = (Sha256::new(), 0);
                }
                Ok((file, hash, done))
            };
            open().map_err(|source| cannot("open", &opened, source))
        })
        .await?;
        Ok(Self {
            about: about(room, "the avatar's package"),
            avatar,
            cache,
            file: BufWriter::with_capacity(BUFFER, File::from_std(file)),
            hash,
            progress: Progress {
                done,
                total: avatar.bytes,
                downloaded: 0,
            },
        })
    }

    /// Until all bytes are here, through as many connections as it takes.
    async fn run(
        &mut self,
        client: &Client,
        progress: &mut impl FnMut(Progress),
    ) -> Result<(), HttpError> {
        let mut attempts = 0;
        while self.progress.done < self.progress.total {
            let before = self.progress.downloaded;
            let outcome = self.attempt(client, progress).await;
            let flushed = self.file.flush().await;
            flushed.map_err(|source| self.cannot_write(source))?;
            let Err(error) = outcome else {
                continue;
            };
            if !is_passing(&error) {
                return Err(error);
            }
            attempts = if self.progress.downloaded > before {
                1
            } else {
                attempts + 1
            };
            if attempts == ATTEMPTS {
                return Err(HttpError::GaveUp {
                    package: self.avatar.sha256,
                    attempts,
                    have: self.progress.done,
                    total: self.progress.total,
                    last: Box::new(error),
                });
            }
            log::info!("{error}; going on from byte {}", self.progress.done);
            tokio::time::sleep(PAUSE * 2u32.pow(attempts - 1)).await;
        }
        Ok(())
    }

    /// One request for all that is missing.
    async fn attempt(
        &mut self,
        client: &Client,
        progress: &mut impl FnMut(Progress),
    ) -> Result<(), HttpError> {
        let name = self.avatar.sha256.to_string();
        let mut request = client.request(&self.about, Method::GET, &["packages", &name])?;
        if self.progress.done > 0 {
            request = request
                .header(RANGE, format!("bytes={}-", self.progress.done))
                .header(IF_RANGE, format!("\"{name}\""));
        }
        let response = self.about.send(request, ANSWERING).await?;
        self.check_head(&response)?;
        if response.status() != StatusCode::PARTIAL_CONTENT {
            self.start_over().await?;
        }
        let mut pieces = response.bytes_stream();
        loop {
            let broken = |source| HttpError::Broken {
                server: self.about.server.clone(),
                source,
            };
            let piece = match tokio::time::timeout(SILENCE, pieces.next()).await {
                Err(_) => return Err(broken(None)),
                Ok(None) if self.progress.done < self.progress.total => return Err(broken(None)),
                Ok(None) => return Ok(()),
                Ok(Some(piece)) => piece.map_err(|error| of_request(self.about.server, error))?,
            };
            let done = self.progress.done + piece.len() as u64;
            if done > self.progress.total {
                return Err(self.wrong_size(done));
            }
            self.hash.update(&piece);
            let written = self.file.write_all(&piece).await;
            written.map_err(|source| self.cannot_write(source))?;
            self.progress.done = done;
            self.progress.downloaded += piece.len() as u64;
            progress(self.progress);
        }
    }

    /// Refuses an answer that cannot be the rest of this package.
    fn check_head(&self, response: &Response) -> Result<(), HttpError> {
        let text = |name| {
            response
                .headers()
                .get(name)
                .and_then(|value| value.to_str().ok())
        };
        if let Some(encoding) = text(CONTENT_ENCODING).filter(|encoding| *encoding != "identity") {
            return Err(HttpError::Encoded {
                server: self.about.server.clone(),
                encoding: encoding.to_owned(),
            });
        }
        let length: Option<u64> = text(CONTENT_LENGTH).and_then(|length| length.parse().ok());
        let begins = match response.status() {
            StatusCode::PARTIAL_CONTENT => {
                let begins = text(CONTENT_RANGE).and_then(|range| {
                    range
                        .strip_prefix("bytes ")?
                        .split('-')
                        .next()?
                        .parse()
                        .ok()
                });
                if begins != Some(self.progress.done) {
                    return Err(self
                        .about
                        .unintelligible("it is another part than was asked for"));
                }
                self.progress.done
            }
            _ => 0,
        };
        match length {
            Some(length) if begins.saturating_add(length) != self.progress.total => {
                Err(self.wrong_size(begins.saturating_add(length)))
            }
            _ => Ok(()),
        }
    }

    /// Whether the hash is the announced one.
    fn is_intact(&self) -> bool {
        PackageId::finish(self.hash.clone()) == self.avatar.sha256
    }

    /// Forgets what has come.
    async fn start_over(&mut self) -> Result<(), HttpError> {
        self.hash = Sha256::new();
        self.progress.done = 0;
        let empty = async {
            self.file.flush().await?;
            self.file.get_mut().set_len(0).await?;
            self.file.get_mut().rewind().await.map(drop)
        };
        empty.await.map_err(|source| self.cannot_write(source))
    }

    /// Gives the whole package its name.
    async fn keep(mut self) -> Result<PathBuf, HttpError> {
        let flushed = async {
            self.file.flush().await?;
            self.file.get_ref().sync_all().await
        };
        flushed.await.map_err(|source| self.cannot_write(source))?;
        let (part, whole) = (
            self.cache.part(&self.avatar.sha256),
            self.cache.whole(&self.avatar.sha256),
        );
        drop(self.file);
        tokio::fs::rename(&part, &whole)
            .await
            .map_err(|source| cannot("rename", &part, source))?;
        self.cache.evict(&whole);
        Ok(whole)
    }

    fn wrong_size(&self, sent: u64) -> HttpError {
        HttpError::WrongSize {
            package: self.avatar.sha256,
            announced: self.avatar.bytes,
            sent,
        }
    }

    fn cannot_write(&self, source: io::Error) -> HttpError {
        if matches!(
            source.kind(),
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
        ) {
            return HttpError::DiskFull {
                folder: self.cache.folder().to_owned(),
                needed: self.progress.total - self.progress.done.min(self.progress.total),
            };
        }
        cannot("write", &self.cache.part(&self.avatar.sha256), source)
    }
}

/// Whether trying again may help.
fn is_passing(error: &HttpError) -> bool {
    matches!(
        error,
        HttpError::Broken { .. }
            | HttpError::TimedOut { .. }
            | HttpError::Unreachable { .. }
            | HttpError::Unavailable { .. }
            | HttpError::RateLimited { .. }
    )
}

/// Runs what waits for the disk on a thread for that.
async fn blocking<T: Send + 'static>(
    cache: &PackageCache,
    task: impl FnOnce() -> Result<T, HttpError> + Send + 'static,
) -> Result<T, HttpError> {
    let done = tokio::task::spawn_blocking(task).await;
    done.map_err(|error| cannot("use", cache.folder(), io::Error::other(error)))?
}
