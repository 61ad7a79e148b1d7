//! A viewer's connection while it is open, and the feedback that it gives.

use crate::CallError;
use crate::epochs::{Exchange, ViewerKeys};
use crate::introduction::{self, Answered, Authentication};
use crate::path::Path;
use crate::peer::Peer;
use crate::plan::Plan;
use crate::sdp::Description;
use crate::seal::{Opened, Opener, Terms};
use crate::signaling::Signaling;
use crate::voice_track::VoicePacket;
use bytes::Bytes;
use identity::PublicKey;
use link_codec::{Decoder, Micros};
use link_playout::Clock;
use link_playout::clock::{self, ClockOffset};
use link_protocol::data_channel::{Feedback, Message, Pong};
use link_protocol::{Announcement, Name, PackageId, PersonName, RoomLink, sealed};
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

/// What a forwarder hands on is opened after so long, or never.
const UNSEALED: Duration = Duration::from_secs(4);

/// The same after the sender's seal has changed: where another sender has come, which does not know this viewer.
const UNSEALED_AGAIN: Duration = Duration::from_secs(1);

/// A connection that is open.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) peer: Peer,
    /// The way that it takes.
    pub(crate) path: Option<Path>,
    /// Who the sender is, where it says so.
    pub(crate) sender: Option<PublicKey>,
    /// What the sender is called, as it signed.
    pub(crate) person: Option<PersonName>,
    /// Nothing where the sender itself is at the other end.
    seal: Option<Seal>,
    /// Whose seals are taken, and for what.
    authentication: Authentication,
    room: RoomLink,
    avatar: PackageId,
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

/// A message that arrived, as the sender wrote it.
pub(crate) enum Arrived {
    /// None of motion.
    Message(Message),
    /// A motion frame, for the decoder to check.
    Motion(Bytes),
    /// The lines by which all that comes from now on is opened.
    Unsealed,
    /// Nothing to be looked at.
    Nothing,
}

/// What opens the messages of a sender that hands this viewer over.
#[derive(Debug)]
struct Seal {
    keys: ViewerKeys,
    /// Nothing until the lines of the seal have come.
    opener: Option<Box<Opener>>,
    /// Until when something has to be opened, if it has not been yet.
    deadline: Option<Instant>,
}

impl Seal {
    /// Opens a sealed message of `session`; nothing for any other message, and before the lines of the seal have come.
    fn open(&mut self, session: u32, bytes: &[u8]) -> Option<Opened> {
        let opened = (self.opener.as_mut()?).message(&mut self.keys, session, bytes)?;
        match opened {
            Opened::Message(_) | Opened::Keys { for_us: true } => self.deadline = None,
            Opened::Keys { for_us: false } => {}
            Opened::Nothing => {
                self.deadline
                    .get_or_insert_with(|| Instant::now() + UNSEALED);
            }
        }
        Some(opened)
    }

    /// Opens by these lines from now on, unless they are of the same seal or of an older one; whether it does.
    fn begin_or_renew(&mut self, terms: Terms) -> Result<bool, CallError> {
        if let Some(opener) = &mut self.opener {
            if opener.is_newer_than(&terms) || opener.renew(&terms) {
                return Ok(false);
            }
            self.deadline = Some(Instant::now() + UNSEALED_AGAIN);
        }
        self.opener = Some(Box::new(Opener::new(terms)?));
        Ok(true)
    }
}

impl Session {
    /// Offers a connection, takes the answer of the sender that `authentication` takes, and waits for the open channel, for `limit` at most.
    pub(crate) async fn open(
        signaling: &dyn Signaling,
        announcement: &Announcement,
        plan: Plan,
        authentication: &Authentication,
        clock: Clock,
        limit: Duration,
    ) -> Result<Self, CallError> {
        let id = getrandom::u32()?;
        let relay = plan.relay.clone();
        let (mut peer, mut offer) = Peer::offer(plan, announcement.channel).await?;
        let room = signaling.room();
        let mut exchange = None;
        if introduction::may_be_handed_over(room) {
            let own = Exchange::new()?;
            offer = introduction::with_exchange(&offer, &own.text());
            exchange = Some(own);
        }
        let signed = authentication.introduce(room, &offer)?;
        let answer = timeout(limit, signaling.offer(&signed)).await;
        let answer = answer.map_err(|_| CallError::NotConnected)??;
        let avatar = announcement.avatar.sha256;
        let answered = Description::read(&answer.sdp)?;
        let (sender, person, keys) = match authentication.check(room, avatar, &offer, &answered)? {
            Answered::Sender(sender, person) => (sender, person, None),
            Answered::Forwarder => {
                let own = exchange.ok_or(CallError::NoExchange)?;
                let signed = |half: &str| own.signed(room, avatar, half);
                let half = authentication.check_exchange(room, &answered, signed)?;
                (None, None, Some(own.accept(half, room, avatar)?))
            }
        };
        peer.accept(&answered).await?;
        match timeout(limit, peer.opened()).await {
            Ok(Ok(())) => {}
            Ok(Err(CallError::NotConnected)) | Err(_) if peer.path().await.is_some() => {
                return Err(CallError::NoHandshake);
            }
            Ok(Err(CallError::NotConnected)) | Err(_) => return Err(CallError::NoWay { relay }),
            Ok(Err(error)) => return Err(error),
        }
        let path = peer.path().await;
        let now = Instant::now();
        let mut session = Self {
            peer,
            path,
            sender,
            person,
            seal: keys.map(|keys| Seal {
                keys,
                opener: None,
                deadline: Some(now + UNSEALED),
            }),
            authentication: authentication.clone(),
            room: room.clone(),
            avatar,
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

    /// Reads a message, and opens it where a forwarder hands on what is sealed; nothing else is taken from the forwarder then but what is
    /// its own: pongs, byes, and under which session the sender writes.
    ///
    /// # Errors
    /// If it is sealed by someone else than the sender that is taken.
    pub(crate) fn read(&mut self, bytes: Bytes) -> Result<Arrived, CallError> {
        let Some(seal) = &mut self.seal else {
            let message = Message::read(&bytes, self.id);
            return Ok(message.map_or(Arrived::Motion(bytes), Arrived::Message));
        };
        if let Some(opened) = seal.open(self.motion, &bytes) {
            return Ok(match opened {
                Opened::Message(message) => match Message::read(&message, self.motion) {
                    Some(state @ Message::State(_)) => Arrived::Message(state),
                    Some(_) => Arrived::Nothing,
                    None => Arrived::Motion(message.into()),
                },
                Opened::Keys { .. } | Opened::Nothing => Arrived::Nothing,
            });
        }
        if let Some(lines) = sealed::read_seal(&bytes, self.id) {
            let terms = Terms::read(&self.authentication, &self.room, self.avatar, lines)?;
            let sender = terms.sender();
            return Ok(if seal.begin_or_renew(terms)? {
                self.sender = sender;
                Arrived::Unsealed
            } else {
                Arrived::Nothing
            });
        }
        Ok(match Message::read(&bytes, self.id) {
            None | Some(Message::State(_)) => Arrived::Nothing,
            Some(message) => Arrived::Message(message),
        })
    }

    /// Whether what is handed on cannot be opened: its keys have not come, or are of another sender's.
    pub(crate) fn cannot_open(&self) -> bool {
        let deadline = self.seal.as_ref().and_then(|seal| seal.deadline);
        deadline.is_some_and(|deadline| Instant::now() > deadline)
    }

    /// Whether something has still to come by which what is handed on is opened.
    pub(crate) fn awaits_seal(&self) -> bool {
        self.seal.as_ref().is_some_and(|seal| seal.opener.is_none())
    }

    /// Whether what is handed on is opened here.
    pub(crate) fn is_sealed(&self) -> bool {
        self.seal.is_some()
    }

    /// A packet of voice as it was said; nothing for one that is not the sender's.
    pub(crate) fn hear(&mut self, packet: VoicePacket) -> Option<VoicePacket> {
        match &mut self.seal {
            None => Some(packet),
            Some(Seal { keys, opener, .. }) => opener.as_mut()?.voice(keys, &packet),
        }
    }

    /// Reads motion of this session from now on, which is forwarded; whether that is another one than before.
    pub(crate) fn follow(&mut self, of: u32) -> bool {
        if self.motion == of {
            return false;
        }
        self.motion = of;
        self.decoder = Decoder::new(of);
        self.newest_captured = None;
        // The sender may be on another machine now, whose clock is another one.
        self.offset = ClockOffset::new();
        (self.pings, self.next_ping) = (0, Instant::now());
        true
    }

    /// Compares the two sides' clocks by a pong that has just arrived.
    pub(crate) fn compare_clocks(&mut self, pong: Pong, here: Clock) {
        let exchange = clock::Exchange {
            sent: pong.asked,
            arrived: pong.arrived,
            left: pong.left,
            returned: here.now(),
        };
        if let Err(error) = self.offset.observe(&exchange) {
            log::debug!("ignored a pong: {error}");
        }
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
