//! A viewer's connection while it is open, and the feedback that it gives.

use crate::peer::Peer;
use crate::{CallError, local_addresses};
use link_codec::{Decoder, Micros};
use link_http::Client;
use link_playout::Clock;
use link_playout::clock::ClockOffset;
use link_protocol::message::{Feedback, Message};
use link_protocol::{Announcement, RoomLink};
use std::time::Duration;
use tokio::time::Instant;

/// Quiet after which every feedback asks for an answer.
const QUIET: Duration = Duration::from_millis(300);

/// A feedback at least this often, and one for every third frame: more would cost more in SCTP's own acknowledgements than
/// nearer frames to predict from save.
const FEEDBACK: Duration = Duration::from_millis(200);
const FRAMES_A_FEEDBACK: u32 = 3;

/// Time between questions for the sender's clock: often at first, then to follow its drift.
const ASK_AT_FIRST: Duration = Duration::from_millis(50);
const ASK_LATER: Duration = Duration::from_secs(1);
const ASKED_AT_FIRST: u32 = 10;

/// A connection that is open.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) peer: Peer,
    /// Of the messages.
    pub(crate) id: u32,
    /// The server's name for it.
    pub(crate) name: String,
    pub(crate) decoder: Decoder,
    pub(crate) offset: ClockOffset,
    pub(crate) fresh_frames: u32,
    next_feedback: Instant,
    next_question: Instant,
    questions: u32,
    pub(crate) heard: Instant,
}

impl Session {
    /// Offers, takes the answer and waits for the channel.
    pub(crate) async fn open(
        client: &Client,
        room: &RoomLink,
        announcement: &Announcement,
        clock: Clock,
    ) -> Result<Self, CallError> {
        let id = getrandom::u32().map_err(|error| CallError::Random(error.to_string()))?;
        let local = local_addresses(room.server());
        let (mut peer, offer) = Peer::offer(local, announcement.channel).await?;
        let answer = client.offer(room, &offer).await?;
        peer.accept(answer.sdp).await?;
        peer.opened().await?;
        let now = Instant::now();
        let mut session = Self {
            peer,
            id,
            name: answer.session,
            decoder: Decoder::new(id),
            offset: ClockOffset::new(),
            fresh_frames: 0,
            next_feedback: now,
            next_question: now,
            questions: 0,
            heard: now,
        };
        session.speak(clock, &mut Vec::new()).await;
        Ok(session)
    }

    /// Sends a feedback if it is time for one.
    pub(crate) async fn speak(&mut self, clock: Clock, out: &mut Vec<u8>) {
        let now = Instant::now();
        // A sender that has nothing to send still answers, and is told apart from one that is gone.
        let quiet = self.heard.elapsed() > QUIET && now >= self.next_feedback;
        let ask = quiet || now >= self.next_question;
        if !ask && now < self.next_feedback && self.fresh_frames < FRAMES_A_FEEDBACK {
            return;
        }
        if ask {
            self.questions += 1;
            let settled = self.questions >= ASKED_AT_FIRST;
            self.next_question = now + if settled { ASK_LATER } else { ASK_AT_FIRST };
        }
        let (newest, received) = self.decoder.feedback();
        let feedback = Feedback {
            newest,
            received,
            sent: if ask { clock.now() } else { Micros(0) },
        };
        Message::Feedback(feedback).write(self.id, out);
        self.peer.try_send(out).await;
        self.fresh_frames = 0;
        self.next_feedback = now + FEEDBACK;
    }
}
