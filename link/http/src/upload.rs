//! Uploads an owner's package to the server's store, unless the store has it.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use bytes::Bytes;
use futures_util::stream;
use reqwest::{
    Body, Method, Response, StatusCode,
    header::{CONTENT_LENGTH, CONTENT_TYPE},
};
use tokio::{
    sync::mpsc,
    task::JoinHandle,
    time::{Instant, MissedTickBehavior, interval},
};

use crate::{
    Client, HttpError,
    client::{HAS_PACKAGE, PUT_PACKAGE},
    download::{jittered, retry_delay},
    error::of_request,
};
use link_protocol::{
    PackageId, ProtocolError, Token, announcement::AvatarRef, room_link::ServerUrl,
};

const ATTEMPTS: u32 = 3;
const PIECE: usize = 256 << 10;
const QUEUE: usize = 4;
/// How often progress is reported.
const TICK: Duration = Duration::from_millis(100);

impl Client {
    /// Whether the owner's store has this package.
    ///
    /// # Errors
    /// [`HttpError::Unauthorized`] if this is no owner's token of that server, and those of any request.
    pub async fn has_package(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        package: &PackageId,
    ) -> Result<bool, HttpError> {
        let token = Token::new(owner_token)?;
        let request = self.request(
            Method::HEAD,
            server,
            &token,
            &["packages", &package.to_string()],
        )?;
        let reply = self.exchange(server, HAS_PACKAGE, request).await?;
        match reply.status {
            StatusCode::OK => Ok(true),
            StatusCode::NOT_FOUND => Ok(false),
            _ => Err(reply.refusal(server, &token, HAS_PACKAGE)),
        }
    }

    /// Uploads a package unless the store has it, and returns what to announce. `progress` gets the bytes sent and the package's bytes.
    ///
    /// # Errors
    /// [`ProtocolError::File`] if it cannot be read, [`ProtocolError::Announcement`] if it is empty or larger than [`MAX_PACKAGE_BYTES`](link_protocol::limits::MAX_PACKAGE_BYTES),
    /// [`HttpError::TooLarge`], [`HttpError::StoreFull`], and as [`Client::has_package`].
    pub async fn put_package(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        path: &Path,
        progress: impl Fn(u64, u64),
    ) -> Result<AvatarRef, HttpError> {
        let token = Token::new(owner_token)?;
        let unread = |source| ProtocolError::File {
            path: path.to_owned(),
            source,
        };
        let file = path.to_owned();
        let avatar = tokio::task::spawn_blocking(move || AvatarRef::of_file(&file))
            .await
            .map_err(|error| unread(io::Error::other(error)))??;
        avatar.checked()?;
        let mut pause = self.timeouts().retry;
        let mut attempt = 1;
        loop {
            // Also before a retry: the attempt before may have succeeded without its response arriving.
            let tried = match self.has_package(server, owner_token, &avatar.sha256).await {
                Ok(true) => return Ok(avatar),
                Ok(false) => self.upload(server, &token, path, &avatar, &progress).await,
                Err(error) => Err(error),
            };
            let error = match tried {
                Ok(()) => return Ok(avatar),
                Err(error) => error,
            };
            let Some(wait) = retry_delay(&error).filter(|_| attempt < ATTEMPTS) else {
                return Err(error);
            };
            attempt += 1;
            tokio::time::sleep(wait.max(jittered(pause))).await;
            pause *= 2;
        }
    }

    async fn upload(
        &self,
        server: &ServerUrl,
        token: &Token,
        path: &Path,
        avatar: &AvatarRef,
        progress: &impl Fn(u64, u64),
    ) -> Result<(), HttpError> {
        let sent = Arc::new(AtomicU64::new(0));
        let (body, reader) = stream_file(path, avatar.bytes, sent.clone());
        let request = self
            .request(
                Method::PUT,
                server,
                token,
                &["packages", &avatar.sha256.to_string()],
            )?
            .header(CONTENT_TYPE, "application/octet-stream")
            .header(CONTENT_LENGTH, avatar.bytes)
            .body(body);
        let answer = self
            .watch(server, request, avatar.bytes, &sent, progress)
            .await;
        match answer {
            Ok(answer) if matches!(answer.status(), StatusCode::OK | StatusCode::CREATED) => Ok(()),
            Ok(answer) => Err(self.refusal(server, token, PUT_PACKAGE, answer).await),
            // The body was dropped with the request, so the reader has ended; its error is the cause.
            Err(error) => match reader.await {
                Ok(Err(source)) => Err(ProtocolError::File {
                    path: path.to_owned(),
                    source,
                }
                .into()),
                Ok(Ok(())) | Err(_) => Err(error),
            },
        }
    }

    /// Waits for the response as long as bytes are sent.
    async fn watch(
        &self,
        server: &ServerUrl,
        request: reqwest::RequestBuilder,
        total: u64,
        sent: &AtomicU64,
        progress: &impl Fn(u64, u64),
    ) -> Result<Response, HttpError> {
        let mut answer = std::pin::pin!(request.send());
        let mut tick = interval(TICK);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (mut last, mut moved) = (0, Instant::now());
        loop {
            tokio::select! {
                answer = &mut answer => {
                    progress(sent.load(Ordering::Relaxed), total);
                    return answer.map_err(|error| of_request(server, error));
                }
                _ = tick.tick() => {
                    let now = sent.load(Ordering::Relaxed);
                    if now != last {
                        (last, moved) = (now, Instant::now());
                        progress(now, total);
                    }
                    let limit = if now == total { self.timeouts().store } else { self.timeouts().idle };
                    if moved.elapsed() > limit {
                        return Err(HttpError::TimedOut { server: server.clone(), what: PUT_PACKAGE, limit });
                    }
                }
            }
        }
    }
}

/// A request's body that is a file of this many bytes; `sent` counts the bytes that the connection has taken.
fn stream_file(
    path: &Path,
    bytes: u64,
    sent: Arc<AtomicU64>,
) -> (Body, JoinHandle<io::Result<()>>) {
    let (pieces, queue) = mpsc::channel::<io::Result<Bytes>>(QUEUE);
    let path = path.to_owned();
    let reader = tokio::task::spawn_blocking(move || {
        let result = read_pieces(&path, bytes, &pieces);
        if result.is_err() {
            // Without this error the body would end as if it were complete.
            let _ = pieces.blocking_send(Err(io::ErrorKind::UnexpectedEof.into()));
        }
        result
    });
    let stream = stream::unfold((queue, sent), async |(mut queue, sent)| {
        let piece = queue.recv().await?;
        if let Ok(piece) = &piece {
            sent.fetch_add(piece.len() as u64, Ordering::Relaxed);
        }
        Some((piece, (queue, sent)))
    });
    (Body::wrap_stream(stream), reader)
}

fn read_pieces(
    path: &Path,
    bytes: u64,
    pieces: &mpsc::Sender<io::Result<Bytes>>,
) -> io::Result<()> {
    let mut file = File::open(path)?;
    let mut left = bytes;
    while left > 0 {
        let mut piece = vec![0; usize::try_from(left).map_or(PIECE, |left| left.min(PIECE))];
        file.read_exact(&mut piece)?;
        left -= piece.len() as u64;
        if pieces.blocking_send(Ok(piece.into())).is_err() {
            return Ok(());
        }
    }
    Ok(())
}
