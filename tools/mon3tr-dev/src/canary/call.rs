//! One call through a server: a sender in a room of its own, viewers, the relay.

use super::failure::{Failure, Step};
use identity::Identity;
use link_call::reach::Reach;
use link_call::{Authentication, CallEvent, Credentials, Door, Relay, Sender, Viewer};
use link_codec::Codec;
use link_http::{Client, HttpError};
use link_playout::Clock;
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::ice::{IceKind, IceServer};
use link_protocol::limits::MAX_PEOPLE;
use link_protocol::room_link::ServerUrl;
use link_protocol::{Announcement, IceServers, RoomLink};
use link_voice::VoiceQueue;
use mon3tr::network::Network;
use serde::Serialize;
use spmm3::MotionParams;
use std::path::Path;
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// Motion frames a second, and those that a measured viewer has to receive.
const RATE_HZ: f64 = 30.0;
const FRAMES: u64 = 30;

/// How long one step may take besides the HTTP client's own bounds, and a viewer until it has its frames.
const STEP_WITHIN: Duration = Duration::from_secs(15);
const VIEW_WITHIN: Duration = Duration::from_secs(15);

/// How long a forwarder may take to say that it has viewers: it does so once a second.
const WATCHING_WITHIN: Duration = Duration::from_millis(2_500);

/// How long the room's links hold.
const LIFETIME: Duration = Duration::from_secs(600);

/// What a canary needs for each call.
pub(super) struct Canary<'a> {
    pub(super) network: &'a Network,
    pub(super) client: &'a Client,
    pub(super) own: Credentials,
    pub(super) avatar: &'a Path,
    pub(super) clock: Clock,
}

/// What was measured.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Measured {
    /// The viewer whom the sender serves.
    pub(super) direct: Arrived,
    /// The relay that lends an address, where the server names one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) relay: Option<Relay>,
    /// The viewer whom the server serves, where it forwards.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) forwarded: Option<Arrived>,
}

/// What one viewer had.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Arrived {
    /// From the beginning to the first frame.
    pub(super) join_s: f64,
    /// Frames from the first to the last one, and those of them that did not arrive.
    pub(super) frames: u64,
    pub(super) lost: u64,
}

impl Canary<'_> {
    /// Holds a call through `server` with an owner's token.
    pub(super) fn call(&self, server: &ServerUrl, token: &str) -> Result<Measured, Failure> {
        let (sender, viewers) = self.open(server, token)?;
        let mut stage = Stage {
            network: self.network,
            sender,
            viewers: Vec::new(),
            clock: self.clock,
            next: Instant::now(),
        };
        let measured = self.measure(server, &viewers, &mut stage);
        stage.end();
        measured
    }

    /// A sender in a room of its own, and the viewers' link.
    fn open(&self, server: &ServerUrl, token: &str) -> Result<(Sender, RoomLink), Failure> {
        let client = self.client;
        let room = self.http(Step::Room, client.open_room(server, token, Some(LIFETIME)))?;
        let store = async {
            let avatar = AvatarRef::of_file(self.avatar)?;
            if client.has_package(server, token, &avatar.sha256).await? {
                return Ok(avatar);
            }
            client
                .put_package(server, token, self.avatar, |_, _| {})
                .await
        };
        let avatar = self.http(Step::Store, store)?;
        let secret =
            sender::new_secret().map_err(|error| Failure::new(Step::Room, error.to_string()))?;
        let announcement = Announcement {
            avatar,
            channel: ChannelMode::Unreliable,
            codec: Codec::Compact,
            rate_hz: RATE_HZ,
        };
        let entering = Sender::enter(
            client.clone(),
            room.sender.with_secret(secret.clone()),
            announcement,
            Some(self.own.clone()),
            Door::default(),
            self.clock,
        );
        let sender = self.within(Step::Presence, entering)?;
        let sender = sender.map_err(|error| Failure::of_call(Step::Presence, &error))?;
        let viewers = room.viewer.with_secret(secret);
        Ok((sender, viewers.with_key(self.own.key().hash())))
    }

    fn measure(
        &self,
        server: &ServerUrl,
        link: &RoomLink,
        stage: &mut Stage<'_>,
    ) -> Result<Measured, Failure> {
        let direct = stage.view(self.join(link), FRAMES)?;
        let status = self.http(Step::Offer, self.client.room_status(link))?;
        let status = status.ok_or_else(|| {
            let why = "the server says that the sender is not in its room, where it answered a moment ago";
            Failure::new(Step::Offer, why)
        })?;
        let relay = self.relay(server, &status.ice_servers)?;
        // A sender whose server forwards serves so many itself.
        for _ in 1..MAX_PEOPLE {
            stage.view(self.join(link), 1)?;
        }
        let last = stage.view(self.join(link), FRAMES);
        let last = last.map_err(|failure| Failure {
            step: Step::Forwarding,
            ..failure
        })?;
        Ok(Measured {
            direct,
            relay,
            forwarded: stage.is_watched().then_some(last),
        })
    }

    fn join(&self, link: &RoomLink) -> Viewer {
        self.network.block_on(async {
            let authentication = Authentication {
                own: Some(self.own.clone()),
                signer: None,
            };
            Viewer::join(
                self.client.clone(),
                link.clone(),
                authentication,
                self.clock,
                VoiceQueue::default(),
            )
        })
    }

    /// That the relay lends an address, if the server names one.
    fn relay(&self, server: &ServerUrl, servers: &IceServers) -> Result<Option<Relay>, Failure> {
        let mut urls = servers.as_slice().iter().flat_map(IceServer::addresses);
        let Some(named) = urls.find(|url| url.kind != IceKind::Stun) else {
            return Ok(None);
        };
        let reach = self.within(Step::Relay, Reach::find(server, servers, &[]))?;
        let reach = reach.map_err(|error| Failure::of_call(Step::Relay, &error))?;
        match reach.relay {
            None => Err(Failure::new(
                Step::Relay,
                format!("{named} answers neither over UDP nor over TCP"),
            )),
            Some(relay) if !reach.is_lent => Err(Failure::new(
                Step::Relay,
                format!("{relay} lends no address"),
            )),
            relay => Ok(relay),
        }
    }

    fn http<T>(
        &self,
        step: Step,
        request: impl Future<Output = Result<T, HttpError>>,
    ) -> Result<T, Failure> {
        let answer = self.within(step, request)?;
        answer.map_err(|error| Failure::of_http(step, &error))
    }

    fn within<T>(&self, step: Step, task: impl Future<Output = T>) -> Result<T, Failure> {
        let done = self
            .network
            .block_on(async { timeout(STEP_WITHIN, task).await });
        done.map_err(|_| {
            let seconds = STEP_WITHIN.as_secs();
            Failure::new(step, format!("it took longer than {seconds} s"))
        })
    }
}

/// The sender, and the viewers that are there.
struct Stage<'a> {
    network: &'a Network,
    sender: Sender,
    viewers: Vec<Viewer>,
    clock: Clock,
    /// When the next frame is due.
    next: Instant,
}

impl Stage<'_> {
    /// Sends motion until `viewer` has had so many frames.
    fn view(&mut self, viewer: Viewer, frames: u64) -> Result<Arrived, Failure> {
        let begun = Instant::now();
        let mut joined = None;
        let (mut first, mut last, mut arrived) = (u32::MAX, 0, 0);
        while arrived < frames {
            if begun.elapsed() > VIEW_WITHIN {
                let statistics = viewer.statistics();
                self.viewers.push(viewer);
                return Err(match (statistics.sessions, arrived) {
                    (0, _) => Failure::of_viewer(statistics.not_joined),
                    (_, 0) => Failure::new(
                        Step::FirstFrame,
                        "a viewer is connected and no frame arrives",
                    ),
                    (..) => Failure::new(
                        Step::Frames,
                        format!(
                            "{arrived} frames arrived in {} s, {frames} were expected",
                            VIEW_WITHIN.as_secs()
                        ),
                    ),
                });
            }
            self.publish();
            match viewer.next(Duration::from_millis(5)) {
                Ok(CallEvent::Frame { frame, .. }) => {
                    joined.get_or_insert_with(|| begun.elapsed());
                    (first, last) = (first.min(frame.sequence), last.max(frame.sequence));
                    arrived += 1;
                }
                Ok(CallEvent::Failed(error)) => return Err(Failure::of_call(Step::Offer, &error)),
                Ok(CallEvent::HungUp) => {
                    return Err(Failure::new(Step::Frames, "the connection ended"));
                }
                Ok(_) | Err(_) => {}
            }
        }
        self.viewers.push(viewer);
        let frames = u64::from(last.saturating_sub(first)) + 1;
        Ok(Arrived {
            join_s: joined.unwrap_or_default().as_secs_f64(),
            frames,
            lost: frames.saturating_sub(arrived),
        })
    }

    /// Whether the server says that it has a viewer.
    fn is_watched(&mut self) -> bool {
        let begun = Instant::now();
        while begun.elapsed() < WATCHING_WITHIN {
            if self.sender.statistics().watching > 0 {
                return true;
            }
            self.publish();
            std::thread::sleep(Duration::from_millis(5));
        }
        false
    }

    /// Sends the frame that is due, and drops what has arrived at viewers that were measured.
    fn publish(&mut self) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        self.next = now + Duration::from_secs_f64(1.0 / RATE_HZ);
        self.sender
            .publish(self.clock.now(), &MotionParams::default());
        for viewer in &self.viewers {
            while viewer.next(Duration::ZERO).is_ok() {}
        }
    }

    fn end(self) {
        let Self {
            network,
            sender,
            viewers,
            ..
        } = self;
        network.block_on(async {
            let leaving: Vec<_> = viewers
                .into_iter()
                .map(|one| tokio::spawn(one.hang_up()))
                .collect();
            for left in leaving {
                // One that failed has been reported.
                let _ = left.await;
            }
            sender.hang_up().await;
        });
    }
}

/// A key for this process alone.
pub(super) fn own() -> anyhow::Result<Credentials> {
    Ok(Credentials::new(Identity::generate()?))
}
