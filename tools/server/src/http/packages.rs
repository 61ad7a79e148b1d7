//! Putting, reading and removing packages.

use super::guard::{Client, discard};
use super::member_uploads::MemberUpload;
use super::rooms::{refused, viewer_of};
use super::{App, HttpError, NO_STORE};
use crate::metrics::UploadRefusal;
use crate::packages::{ByteRange, Conditions, Owned, Shelf, UploadError};
use crate::rooms::{RoomReply, RoomRequest};
use crate::token::{Claims, Role, now};
use axum::Json;
use axum::body::Body;
use axum::extract::{Extension, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::TryStreamExt;
use futures_util::future::join_all;
use link_protocol::PackageId;
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

/// How long the store may take to say what it has.
const STORE_WITHIN: Duration = Duration::from_secs(15);

pub(super) async fn store(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Extension(Client(address)): Extension<Client>,
    Path(hash): Path<String>,
    request: Request,
) -> Result<StatusCode, HttpError> {
    let (hash, counted) = match may_put(&app, &claims, address, &hash).await {
        Ok(MayPut::Package(hash, counted)) => (hash, counted),
        Ok(MayPut::IsThere) => {
            discard(request.into_body());
            return Ok(StatusCode::OK);
        }
        Err(refusal) => {
            match &refusal {
                HttpError::CallUploads { .. } => app.metrics.upload_refused(UploadRefusal::Call),
                HttpError::TooManyTries { .. } => app.metrics.upload_refused(UploadRefusal::Tries),
                _ => {}
            }
            discard(request.into_body());
            return Err(refusal);
        }
    };
    let (shelf, party) = (Shelf::of(&claims), Shelf::party(&claims));
    let declared = request.headers().get(header::CONTENT_LENGTH);
    let declared = declared.and_then(|value| value.to_str().ok()?.parse().ok());
    let mut body = request.into_body().into_data_stream();
    let whole = async {
        let upload = app
            .packages
            .receive((shelf, party, address), hash, declared, &mut body)
            .await?;
        Ok(upload)
    };
    let received = tokio::time::timeout(app.limits.upload_within, whole)
        .await
        .unwrap_or(Err(UploadError::Paused));
    let app_again = Arc::clone(&app);
    let stored = match received {
        // Once it is whole it is stored, even if the client does not wait for it.
        Ok(upload) => {
            let keep = async move {
                let shown = app_again.rooms.shown(claims.owner);
                let stored = app_again.packages.keep(shelf, upload, &shown).await;
                if let (Ok(_), Some(counted)) = (&stored, counted) {
                    counted.stored();
                }
                stored
            };
            match tokio::spawn(keep).await {
                Ok(stored) => stored,
                Err(e) => Err(UploadError::Spool(std::io::Error::other(e))),
            }
        }
        Err(e) => {
            discard(Body::from_stream(body));
            Err(e)
        }
    };
    match stored {
        Ok(true) => {
            log::info!("package {hash} is stored");
            Ok(StatusCode::CREATED)
        }
        // Two members put the same one at the same moment.
        Ok(false) => Ok(StatusCode::OK),
        Err(e) => {
            app.metrics.upload_refused(e.reason());
            Err(logged(e).into())
        }
    }
}

/// What the bearer may do with a package.
enum MayPut {
    /// This one; a member's is counted.
    Package(PackageId, Option<MemberUpload>),
    /// Nothing: it is there.
    IsThere,
}

/// An owner may put any package, a call's member so many that are not there yet.
async fn may_put(
    app: &App,
    claims: &Claims,
    address: IpAddr,
    hash: &str,
) -> Result<MayPut, HttpError> {
    let hash = hash.parse().map_err(|_| HttpError::NotFound)?;
    if !matches!(claims.role, Role::Owner | Role::Member) {
        return Err(HttpError::NotFound);
    }
    // What was checked once is neither received nor checked again.
    if in_time(app.packages.size(Shelf::of(claims), hash))
        .await?
        .is_some()
    {
        return Ok(MayPut::IsThere);
    }
    let counted = match claims.role {
        Role::Member => Some(app.member_uploads.begin(claims, address, now())?),
        _ => None,
    };
    Ok(MayPut::Package(hash, counted))
}

/// What the operator has to know of a refused upload goes to the log.
fn logged(error: UploadError) -> UploadError {
    match &error {
        UploadError::DiskFull => log::error!("an upload is refused because the disk is full"),
        UploadError::Spool(cause) => log::error!("an upload cannot be stored: {cause}"),
        UploadError::Store(cause) => log::error!("an upload cannot be stored: {cause}"),
        _ => {}
    }
    error
}

/// That the bearer sees this avatar, or is its owner: an avatar is a person's likeness, so a link to one room is to give no other one of its owner's.
async fn may_read(
    app: &App,
    claims: &Claims,
    hash: PackageId,
    method: &Method,
) -> Result<(), HttpError> {
    let rooms = match claims.role {
        Role::Owner | Role::Sender => return Ok(()),
        // Who is about to put a package asks whether it is there.
        Role::Member if method == Method::HEAD => return Ok(()),
        Role::Viewer => vec![claims.room()],
        Role::Member => claims.seats(&app.secret).collect(),
    };
    let viewer = viewer_of(claims);
    let asked = rooms.into_iter().map(|room| async move {
        match app.ask(room, RoomRequest::Announcement { viewer }).await {
            RoomReply::Announcement { announcement, .. } => {
                let is_theirs = announcement.avatar.sha256 == hash;
                is_theirs.then_some(()).ok_or(HttpError::NotFound)
            }
            reply => Err(refused(&reply)),
        }
    });
    let answers = join_all(asked).await;
    if answers.iter().any(Result::is_ok) {
        return Ok(());
    }
    // A seat that nobody has says nothing; one that cannot be asked may be whose it is.
    let unasked = answers.into_iter().filter_map(Result::err);
    let absent = |error: &HttpError| matches!(error, HttpError::SenderAbsent);
    let mut unasked = unasked.filter(|error| claims.role == Role::Viewer || !absent(error));
    Err(unasked.next().unwrap_or(HttpError::NotFound))
}

/// `GET` and `HEAD`.
pub(super) async fn read(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(hash): Path<String>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, HttpError> {
    let hash = hash.parse::<PackageId>().ok().ok_or(HttpError::NotFound)?;
    may_read(&app, &claims, hash, &method).await?;
    let size = in_time(app.packages.size(Shelf::of(&claims), hash))
        .await?
        .ok_or(HttpError::NotFound)?;
    let whole = ByteRange {
        first: 0,
        count: size,
    };
    let (status, part) = match Conditions::of(&headers, hash, size) {
        Conditions::NotModified => (StatusCode::NOT_MODIFIED, None),
        Conditions::Whole => (StatusCode::OK, Some(whole)),
        Conditions::Range(part) => (StatusCode::PARTIAL_CONTENT, Some(part)),
        Conditions::Unsatisfiable => {
            let refusal = HttpError::Range { bytes: size };
            let range = [(header::CONTENT_RANGE, format!("bytes */{size}"))];
            return Ok((range, refusal).into_response());
        }
    };
    let body = match part {
        Some(part) if method != Method::HEAD && part.count > 0 => {
            let found = in_time(app.packages.read(hash, part)).await?;
            let metrics = Arc::clone(&app.metrics);
            Body::from_stream(found.inspect_ok(move |chunk| {
                metrics.bytes_down.inc_by(chunk.len() as u64);
            }))
        }
        _ => Body::empty(),
    };
    let mut response = (status, body).into_response();
    let headers = response.headers_mut();
    let mut set = |name, value: String| {
        if let Ok(value) = HeaderValue::from_str(&value) {
            headers.insert(name, value);
        }
    };
    set(header::ETAG, format!("\"{hash}\""));
    set(header::ACCEPT_RANGES, "bytes".into());
    // Only for the bearer of a token; but the bytes of a hash never change.
    let immutable = "private, max-age=31536000, immutable";
    set(header::CACHE_CONTROL, immutable.into());
    if let Some(ByteRange { first, count }) = part {
        set(header::CONTENT_LENGTH, count.to_string());
        set(header::CONTENT_TYPE, "application/octet-stream".into());
        if status == StatusCode::PARTIAL_CONTENT {
            let last = first + count - 1;
            set(
                header::CONTENT_RANGE,
                format!("bytes {first}-{last}/{size}"),
            );
        }
    }
    Ok(response)
}

/// An owner's packages.
#[derive(serde::Serialize)]
struct PackageList {
    packages: Vec<Owned>,
    /// The most of them.
    most: usize,
    /// The most bytes of all of them.
    most_bytes: u64,
    /// What the members of the owner's calls have put, beside these and within the same bounds.
    members: Vec<Owned>,
}

pub(super) async fn list(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
) -> Result<Response, HttpError> {
    if claims.role != Role::Owner {
        return Err(HttpError::NotFound);
    }
    let list = PackageList {
        packages: in_time(app.packages.owned(Shelf::Own(claims.owner))).await?,
        most: app.limits.packages_per_owner,
        most_bytes: app.limits.bytes_per_owner,
        members: in_time(app.packages.owned(Shelf::Members(claims.owner))).await?,
    };
    Ok((NO_STORE, Json(list)).into_response())
}

pub(super) async fn remove(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(hash): Path<String>,
) -> Result<StatusCode, HttpError> {
    let hash = hash
        .parse::<PackageId>()
        .ok()
        .filter(|_| claims.role == Role::Owner)
        .ok_or(HttpError::NotFound)?;
    let mut was_there = false;
    for shelf in [Shelf::Own(claims.owner), Shelf::Members(claims.owner)] {
        was_there |= in_time(app.packages.remove(shelf, hash)).await?;
    }
    if was_there {
        log::info!("package {hash} is removed for one owner");
        Ok(StatusCode::NO_CONTENT)
    } else {
        Err(HttpError::NotFound)
    }
}

async fn in_time<T>(
    asked: impl Future<Output = Result<T, crate::packages::StoreError>>,
) -> Result<T, HttpError> {
    match tokio::time::timeout(STORE_WITHIN, asked).await {
        Ok(answer) => Ok(answer?),
        Err(_) => Err(HttpError::StoreSlow),
    }
}
