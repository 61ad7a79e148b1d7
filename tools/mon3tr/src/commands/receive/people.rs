//! The people of the rooms: waited for, and their avatars fetched once.

use crate::device_options::cache;
use crate::network::{Line, Network};
use crate::progress;
use crate::stills::load_others_avatar;
use anyhow::Context;
use app_session::arrival::{self, Waiting};
use app_session::call::CallWatch;
use app_session::participant::{NetworkContext, Origin, Participant};
use link_http::{Client, PackageCache};
use link_protocol::{Announcement, RoomLink};
use link_voice::VoiceQueue;
use profile_report::AvatarFigures;
use spmm3::Avatar;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Between two looks whether it is time to leave.
const LOOK: Duration = Duration::from_millis(50);

/// A person who is in a room, with the avatar here.
#[derive(Debug)]
pub(crate) struct Person {
    pub(crate) room: RoomLink,
    pub(crate) announced: Announcement,
    pub(crate) avatar: Arc<Avatar>,
    pub(crate) arrival: Arrival,
    /// What they say, to be played.
    pub(crate) voice: VoiceQueue,
}

/// What a report tells of how a person came.
#[derive(Debug, Clone)]
pub(crate) struct Arrival {
    /// What they are called, where people have names.
    pub(crate) name: Option<String>,
    pub(crate) figures: AvatarFigures,
    pub(crate) download: Download,
    /// What is counted and told of the call with them.
    pub(crate) watch: CallWatch,
}

/// How an avatar came here.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub(crate) struct Download {
    /// Bytes that crossed the network: none where the cache had it.
    pub(crate) bytes: u64,
    pub(crate) seconds: f64,
}

impl Person {
    /// For a session.
    pub(crate) fn participant(&self, sits: bool, network: &NetworkContext) -> Participant {
        Participant {
            avatar: Arc::clone(&self.avatar),
            sits,
            origin: Origin::Room {
                link: self.room.clone(),
                announced: self.announced,
                network: network.clone(),
                voice: self.voice.clone(),
                watch: self.arrival.watch.clone(),
            },
        }
    }
}

/// Waits for all senders, one after the other, and fetches their avatars; nothing if it is time to leave before. Of a sender who has
/// come back, `again` is known what was announced. Of several people, whose avatar cannot be used is left out, which is told. What they say goes to `voices`, in the order of the rooms.
pub(crate) fn gather(
    rooms: &[RoomLink],
    line: &Line,
    again: Option<Announcement>,
    voices: &[VoiceQueue],
) -> anyhow::Result<Option<Vec<Person>>> {
    let Line {
        network,
        client,
        stop,
        ..
    } = line;
    let (mut people, mut refused) = (Vec::new(), None);
    for (room, voice) in rooms.iter().zip(voices) {
        let announced = match again {
            Some(announced) => announced,
            None => match network.block_on(wait_for_sender(client, room, stop))? {
                Some(announced) => announced,
                None => return Ok(None),
            },
        };
        let Some((path, download)) =
            fetch(network, client, room, &announced, &|| stop.load(Relaxed))?
        else {
            return Ok(None);
        };
        let (avatar, figures) = match load_others_avatar(&path) {
            Ok(loaded) => loaded,
            // The others are seen without them.
            Err(error) if rooms.len() > 1 => {
                log::warn!("a person cannot be shown: {error:#}");
                refused = Some(error);
                continue;
            }
            Err(error) => return Err(error),
        };
        people.push(Person {
            room: room.clone(),
            announced,
            avatar,
            arrival: Arrival {
                name: None,
                figures,
                download,
                watch: CallWatch::default(),
            },
            voice: voice.clone(),
        });
    }
    match (people.is_empty(), refused) {
        (true, Some(error)) => Err(error),
        _ => Ok(Some(people)),
    }
}

/// Asks until the sender is in the room, and says what it waits for; nothing if it is time to leave before.
pub(crate) async fn wait_for_sender(
    client: &Client,
    room: &RoomLink,
    stop: &AtomicBool,
) -> anyhow::Result<Option<Announcement>> {
    let told = |waiting: &Waiting| match waiting {
        Waiting::ForSender => println!("waiting for the sender"),
        Waiting::Trouble(why) => log::warn!("{why}; trying again until Ctrl-C"),
    };
    arrival::wait_for_sender(client, room, || stop.load(Relaxed), told)
        .await
        .context("cannot join the room")
}

/// The avatar that was announced in `room`, from this machine's cache or else from the server; nothing if it is time to leave before.
pub(crate) fn fetch(
    network: &Network,
    client: &Client,
    room: &RoomLink,
    announced: &Announcement,
    is_over: &(dyn Fn() -> bool + Sync),
) -> anyhow::Result<Option<(PathBuf, Download)>> {
    let begun = Instant::now();
    let packages = PackageCache::new(cache()?.join("packages"))?;
    let bar = progress::bytes("fetching the avatar");
    let mut bytes = 0;
    let fetching = client.fetch_package(room, &announced.avatar, &packages, |step| {
        bytes = step.downloaded;
        bar.show(step.done, step.total);
    });
    let fetched = network.block_on(async {
        tokio::select! {
            path = fetching => Some(path),
            () = over(is_over) => None,
        }
    });
    bar.finish();
    let Some(path) = fetched else {
        return Ok(None);
    };
    let seconds = begun.elapsed().as_secs_f64();
    let path = path.context("cannot fetch the avatar")?;
    Ok(Some((path, Download { bytes, seconds })))
}

/// Waits until it is over.
async fn over(is_over: &(dyn Fn() -> bool + Sync)) {
    while !is_over() {
        tokio::time::sleep(LOOK).await;
    }
}
