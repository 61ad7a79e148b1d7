//! A viewer's connection while it is open, and the feedback that it gives.

use crate::CallError;
use crate::introduction::Authentication;
use crate::path::Path;
use crate::peer::Peer;
use crate::plan::Plan;
use identity::PublicKey;
use link_codec::{Decoder, Micros};
use link_http::Client;
use link_playout::Clock;
use link_playout::clock::ClockOffset;
use link_protocol::data_channel::{Feedback, Message};
use link_protocol::{Announcement, Name, RoomLink};
use std::time::Duration;
use tokio::time::{Instant, timeout};

/// Silence of the sender after which every feedback asks for a pong.
const QUIET: Duration = Duration::from_millis(300);

/// A feedback at least this often, and one for every third frame. More feedback would cost more in SCTP's own acknowledgements than it
/// saves by frames predicted from newer ones.
const FEEDBACK_INTERVAL: Duration = Duration::from_millis(200);
const FRAMES_A_FEEDBACK: u32 = 3;

/// Time between feedbacks that ask for a pong: short at first, to learn the sender's clock, then long, to follow its drift.
const FIRST_PING_INTERVAL: Duration = Duration::from_millis(50);
const PING_INTERVAL: Duration = Duration::from_secs(1);
const FIRST_PINGS: u32 = 10;

/// A connection that is open.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) peer: Peer,
    /// The way that it takes.
    pub(crate) path: Option<Path>,
    /// Who the sender is, where it says so.
    pub(crate) sender: Option<PublicKey>,
    /// The session's number in messages.
    pub(crate) id: u32,
    /// The session's name on the server.
    pub(crate) name: Name,
    /// The session of motion frames: this one, or another that is forwarded.
    motion: u32,
    pub(crate) decoder: Decoder,
    pub(crate) offset: ClockOffset,
    /// Capture of the last frame, by the sender's clock.
    pub(crate) newest_captured: Option<Micros>,
    /// Frames since the last feedback.
    pub(crate) fresh_frames: u32,
    next_feedback: Instant,
    next_ping: Instant,
    pings: u32,
    /// When a message of the sender last arrived.
    pub(crate) last_heard: Instant,
}

impl Session {
    /// Offers a connection, takes the answer of the sender that `authentication` takes, and waits for the open channel, for `limit` at most.
    pub(crate) async fn open(
        client: &Client,
        room: &RoomLink,
        announcement: &Announcement,
        plan: Plan,
        authentication: &Authentication,
        clock: Clock,
        limit: Duration,
    ) -> Result<Self, CallError> {
        let id = getrandom::u32()?;
        let relay = plan.relay.clone();
        let (mut peer, offer) = Peer::offer(plan, announcement.channel).await?;
        let signed = authentication.introduce(room, &offer)?;
        let answer = timeout(limit, client.offer(room, &signed)).await;
        let answer = answer.map_err(|_| CallError::NotConnected)??;
        let sender = authentication.check(room, announcement.avatar.sha256, &offer, &answer.sdp)?;
        peer.accept(answer.sdp).await?;
        match timeout(limit, peer.opened()).await {
            Ok(Ok(())) => {}
            Ok(Err(CallError::NotConnected)) | Err(_) => return Err(CallError::NoWay { relay }),
            Ok(Err(error)) => return Err(error),
        }
        let path = peer.path().await;
        let now = Instant::now();
        let mut session = Self {
            peer,
            path,
            sender,
            id,
            name: answer.session,
            motion: id,
            decoder: Decoder::new(id),
            offset: ClockOffset::new(),
            newest_captured: None,
            fresh_frames: 0,
            next_feedback: now,
            next_ping: now,
            pings: 0,
            last_heard: now,
        };
        session.send_feedback(clock, &mut Vec::new()).await;
        Ok(session)
    }

    /// Reads motion of this session from now on, which is forwarded; whether that is another one than before.
    pub(crate) fn follow(&mut self, of: u32) -> bool {
        if self.motion == of {
            return false;
        }
        self.motion = of;
        self.decoder = Decoder::new(of);
        self.newest_captured = None;
        true
    }

    /// Sends a feedback if one is due.
    pub(crate) async fn send_feedback(&mut self, clock: Clock, out: &mut Vec<u8>) {
        let now = Instant::now();
        // A sender without motion to send answers with pongs; one that is gone does not.
        let quiet = self.last_heard.elapsed() > QUIET && now >= self.next_feedback;
        let ping = quiet || now >= self.next_ping;
        if !ping && now < self.next_feedback && self.fresh_frames < FRAMES_A_FEEDBACK {
            return;
        }
        if ping {
            self.pings += 1;
            let settled = self.pings >= FIRST_PINGS;
            self.next_ping = now
                + if settled {
                    PING_INTERVAL
                } else {
                    FIRST_PING_INTERVAL
                };
        }
        let (newest, received) = self.decoder.feedback();
        let feedback = Feedback {
            newest,
            received,
            sent: if ping { clock.now() } else { Micros(0) },
        };
        Message::Feedback(feedback).write(self.id, out);
        self.peer.try_send(out).await;
        self.fresh_frames = 0;
        self.next_feedback = now + FEEDBACK_INTERVAL;
    }
}
