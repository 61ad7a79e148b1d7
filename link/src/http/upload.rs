//! Putting a package into the server's store.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use futures_util::stream;
use reqwest::header::{CONTENT_LENGTH, CONTENT_TYPE};
use reqwest::{Body, Method};
use tokio::fs::File;
use tokio::io::AsyncReadExt;

use super::client::{ANSWERING, Request};
use super::room_link::Token;
use super::{Client, HttpError, PackageId, ServerUrl};

/// The server checks the package before it answers, and a slow line has to carry it first.
const UPLOADING: Duration = Duration::from_secs(900);
const CHUNK: usize = 256 << 10;

impl Client {
    /// Whether the owner has put this package there.
    ///
    /// # Errors
    /// If the server cannot be reached or does not accept the token.
    pub async fn has_package(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        package: &PackageId,
    ) -> Result<bool, HttpError> {
        let token = Token::new(owner_token)?;
        let about = about(server, &token);
        let request = self.request(&about, Method::HEAD, &["packages", &package.to_string()])?;
        match about.send(request, ANSWERING).await {
            Ok(_) => Ok(true),
            Err(HttpError::NotFound { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Puts the package file `path` there, telling `progress` the bytes sent and in all.
    ///
    /// # Errors
    /// If the file cannot be read, the server cannot be reached, or it refuses the token or the package.
    pub async fn put_package(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        path: &Path,
        progress: impl Fn(u64, u64) + Send + Sync + 'static,
    ) -> Result<PackageId, HttpError> {
        let token = Token::new(owner_token)?;
        let about = about(server, &token);
        let unread = |source| HttpError::File {
            path: path.to_owned(),
            source,
        };
        let hashed = path.to_owned();
        let package = tokio::task::spawn_blocking(move || PackageId::of_file(&hashed))
            .await
            .map_err(|error| unread(std::io::Error::other(error)))??;
        let file = File::open(path).await.map_err(unread)?;
        let total = file.metadata().await.map_err(unread)?.len();
        let progress = Arc::new(progress);
        let pieces = stream::try_unfold((file, 0), move |(mut file, done)| {
            let progress = Arc::clone(&progress);
            async move {
                let mut piece = vec![0; CHUNK];
                let got = file.read(&mut piece).await?;
                if got == 0 {
                    return Ok::<_, std::io::Error>(None);
                }
                piece.truncate(got);
                let done = done + got as u64;
                progress(done, total);
                Ok(Some((piece, (file, done))))
            }
        });
        let request = self
            .request(&about, Method::PUT, &["packages", &package.to_string()])?
            .header(CONTENT_TYPE, "application/zip")
            .header(CONTENT_LENGTH, total)
            .body(Body::wrap_stream(pieces));
        about.send(request, UPLOADING).await?;
        Ok(package)
    }
}

fn about<'a>(server: &'a ServerUrl, token: &'a Token) -> Request<'a> {
    Request {
        server,
        token,
        what: "the package",
        advice: "packages are put with an owner's token",
    }
}
