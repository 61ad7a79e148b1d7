//! The server and `link-http`'s client, which were written apart from the same specification.

use crate::support::{ANSWER, OFFER, Outcome, TestServer, announcement, package};
use link_codec::Codec;
use link_http::{Client, HttpError, PackageCache};
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::calls::EnterRoom;
use link_protocol::presence::PresenceEvent;
use link_protocol::room_link::ServerUrl;
use link_protocol::{Announcement, PackageId};
use std::fs;
use tempfile::tempdir;

#[tokio::test(flavor = "multi_thread")]
async fn our_client_puts_opens_enters_joins_fetches_and_leaves() -> Outcome {
    let (server, folder) = (TestServer::start().await?, tempdir()?);
    let url: ServerUrl = format!("http://{}", server.caller.address).parse()?;
    let owner = server.caller.owner("ada");
    let (client, file) = (Client::new(None)?, folder.path().join("avatar.m3a"));
    fs::write(&file, &package().bytes)?;
    let avatar = AvatarRef::of_file(&file)?;
    assert!(
        !client.has_package(&url, &owner, &avatar.sha256).await?,
        "not yet"
    );
    client.put_package(&url, &owner, &file, |_, _| {}).await?;
    assert!(
        client.has_package(&url, &owner, &avatar.sha256).await?,
        "it is there"
    );

    let room = client.open_room(&url, &owner, None).await?;
    assert_eq!(
        client.announcement(&room.viewer).await?,
        None,
        "no sender is there"
    );
    let early = client.offer(&room.viewer, OFFER).await;
    assert!(
        matches!(early, Err(HttpError::SenderAbsent { .. })),
        "{early:?}"
    );
    let announcement = Announcement {
        avatar,
        channel: ChannelMode::Unreliable,
        codec: Codec::Compact,
        rate_hz: 30.0,
    };
    let mut presence = client
        .open_presence(&room.sender, &announcement.into())
        .await?;
    assert_eq!(
        client.announcement(&room.viewer).await?,
        Some(announcement),
        "announced"
    );

    let sender = async {
        let PresenceEvent::Offer { session, sdp, .. } = presence.next().await? else {
            panic!("the first event is the offer");
        };
        assert_eq!(sdp, OFFER, "the viewer's own offer");
        client.answer(&room.sender, &session, ANSWER).await?;
        Ok::<_, HttpError>(session)
    };
    let (answer, session) = tokio::join!(client.offer(&room.viewer, OFFER), sender);
    let (answer, session) = (answer?, session?);
    assert_eq!(answer.sdp, ANSWER, "the sender's own answer");
    assert_eq!(answer.session, session, "one name for it");
    client.leave(&room.viewer, &session).await?;
    assert_eq!(
        presence.next().await?,
        PresenceEvent::Leave { session },
        "the sender gets the event"
    );

    // Half of it is here already, so that the server's ranges are asked for too.
    let cache = PackageCache::new(folder.path().join("cache"))?;
    let part = cache.folder().join(format!("{}.part", avatar.sha256));
    let half = package().bytes.len() / 2;
    fs::write(part, &package().bytes[..half])?;
    let mut downloaded = 0;
    let path = client
        .fetch_package(&room.viewer, &avatar, &cache, |step| {
            downloaded = step.downloaded;
        })
        .await?;
    assert!(fs::read(path)? == package().bytes, "the package's bytes");
    assert_eq!(downloaded, avatar.bytes - half as u64, "only the rest");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn our_client_reads_the_server_s_refusals() -> Outcome {
    let (server, folder) = (TestServer::start().await?, tempdir()?);
    let url: ServerUrl = format!("http://{}", server.caller.address).parse()?;
    let owner = server.caller.owner("ada");
    let (client, file) = (Client::new(None)?, folder.path().join("avatar.m3a"));
    fs::write(&file, "no package")?;
    let put = client.put_package(&url, &owner, &file, |_, _| {}).await;
    assert!(
        matches!(put, Err(HttpError::Refused { status: 422, .. })),
        "{put:?}"
    );
    let forged = client.open_room(&url, "forged", None).await;
    assert!(
        matches!(forged, Err(HttpError::Unauthorized { .. })),
        "{forged:?}"
    );
    let room = client.open_room(&url, &owner, None).await?;
    let missing = AvatarRef {
        sha256: PackageId::of_bytes(b"missing"),
        bytes: 7,
    };
    let cache = PackageCache::new(folder.path().join("cache"))?;
    let stored = server.caller.put_package(package(), &owner).await?;
    assert!(stored.status().is_success(), "{stored:?}");
    let shown: EnterRoom = serde_json::from_value(announcement())?;
    let _presence = client.open_presence(&room.sender, &shown).await?;
    let fetched = client
        .fetch_package(&room.viewer, &missing, &cache, |_| {})
        .await;
    assert!(
        matches!(fetched, Err(HttpError::NotFound { .. })),
        "{fetched:?}"
    );
    let opened = client
        .open_room(&url, &room_token(&room.viewer), None)
        .await;
    assert!(
        matches!(opened, Err(HttpError::NotFound { .. })),
        "{opened:?}"
    );
    Ok(())
}

/// The token at a link's end.
fn room_token(link: &link_protocol::RoomLink) -> String {
    let text = link.to_string();
    text.rsplit('#').next().unwrap_or_default().to_owned()
}
