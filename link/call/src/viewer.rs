//! The receiving side of a call: joins a room and hands over what arrives, through outages and restarts, until either side hangs up.

mod arrivals;

use crate::introduction::Authentication;
use crate::path::Path;
use crate::peer::PeerEvent;
use crate::plan::Planner;
use crate::session::Session;
use crate::signaling::{HttpRoom, Signaling};
use crate::{Backoff, CallError, addresses, answer_bye, is_set, renew, send_bye};
use arrivals::Handled;
use identity::PublicKey;
use link_codec::decode_error::DecodeErrorCounts;
use link_codec::{Micros, MotionFrame};
use link_http::Client;
use link_playout::Clock;
use link_protocol::data_channel::PersonState;
use link_protocol::{Announcement, PersonName, Refusal, RoomLink};
use link_voice::VoiceQueue;
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

/// Silence after which a second connection is made beside the silent one: SCTP alone takes 15 s to recover from an outage of 10 s.
const SILENCE: Duration = Duration::from_millis(800);

/// From the offer to the open channel, on a path whose round trip is unknown ...
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// ... and on one whose round trip is known, besides ten round trips. ICE gives up its checks after 1.4 s, so an attempt during an outage
/// fails, and the next one must not wait for it.
const RECONNECT_TIMEOUT: Duration = Duration::from_millis(2_500);

/// For the server to return the announcement, and to take the end of a session.
const ANNOUNCEMENT_TIMEOUT: Duration = Duration::from_secs(3);
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);

/// Between two offers while the performer is asked to let this side in.
const KNOCK: Duration = Duration::from_secs(2);

/// Between two lines on why a call does not begin.
const TOLD_APART: Duration = Duration::from_secs(10);

/// How often silence and feedback are checked.
const TICK: Duration = Duration::from_millis(50);

/// Frames that may wait for [`Viewer::next`]: 8 s at 60 Hz.
const MAX_WAITING: usize = 512;

/// What happens in a call.
#[derive(Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "frames are nearly all of them, and a box would be an allocation for each"
)]
pub enum CallEvent {
    /// The sender's announcement: once before the first connection, and again after each change.
    Announced(Announcement),
    /// A connection is open; sequence numbers begin again.
    Joined,
    /// A frame that passed every check of the decoder.
    Frame {
        /// What was captured, its time by the sender's clock.
        frame: MotionFrame,
        /// When it was captured, by this side's clock; `None` until the clocks are compared.
        captured: Option<Micros>,
        /// When it arrived, by this side's clock.
        arrived: Micros,
    },
    /// Whether the person is heard and seen, when it becomes known and after each change.
    State(PersonState),
    /// The sender hung up; the last event.
    HungUp,
    /// The call cannot go on; the last event.
    Failed(CallError),
}

/// What has arrived so far.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ViewerStatistics {
    /// Connections that were made.
    pub sessions: u32,
    /// Frames that passed every check.
    pub frames: u64,
    /// Frames and states dropped because too many waited for [`Viewer::next`].
    pub overrun: u64,
    /// Bytes of all messages, without any header.
    pub payload_bytes: u64,
    /// Packets of voice.
    pub voice: u64,
    /// Bytes of the same, without any header.
    pub voice_bytes: u64,
    /// Messages refused, by reason.
    pub refused: DecodeErrorCounts,
    /// The sender's clock less this side's, microseconds.
    pub clock_offset_us: Option<i64>,
    /// Shortest round trip of the last 16 s, microseconds.
    pub round_trip_us: Option<u64>,
    /// The way that the last connection took.
    pub path: Option<Path>,
    /// The key of its sender, where it proved to have one.
    pub sender: Option<PublicKey>,
    /// What its sender is called, as they signed with their key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub person: Option<PersonName>,
    /// Why the last try to join did not succeed, until one does; nothing while the sender is only awaited.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_joined: Option<String>,
    /// Whether the last try was answered that the sender's side is asked to let this one in.
    #[serde(skip)]
    pub waits: bool,
}

/// A viewer's place in a room.
#[derive(Debug)]
pub struct Viewer {
    events: Receiver<CallEvent>,
    waiting: Arc<AtomicUsize>,
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
    statistics: Arc<Mutex<ViewerStatistics>>,
}

impl Viewer {
    /// Joins `room` in tasks of the current tokio runtime, and joins again after every outage until either side hangs up. What is said goes
    /// to `voice` as it arrives; it does not wait for [`Self::next`], nor motion for it. A sender that `authentication` does not take ends the call.
    #[must_use]
    pub fn join(
        client: Client,
        room: RoomLink,
        authentication: Authentication,
        clock: Clock,
        voice: VoiceQueue,
    ) -> Self {
        let (sender, events) = channel();
        let waiting = Arc::<AtomicUsize>::default();
        let (stop, stopped) = watch::channel(false);
        let statistics = Arc::<Mutex<ViewerStatistics>>::default();
        let call = Call {
            client,
            planner: Planner::default(),
            room,
            authentication,
            clock,
            voice,
            events: sender,
            waiting: Arc::clone(&waiting),
            stop: stopped,
            statistics: Arc::clone(&statistics),
            announced: None,
            state: None,
            told: None,
            met: None,
        };
        Self {
            events,
            waiting,
            stop,
            task: tokio::spawn(call.run()),
            statistics,
        }
    }

    /// Waits for the next event for `longest` at most. Blocks: not for an async task.
    ///
    /// # Errors
    /// [`RecvTimeoutError::Timeout`] if there was none, [`RecvTimeoutError::Disconnected`] after the last event.
    pub fn next(&self, longest: Duration) -> Result<CallEvent, RecvTimeoutError> {
        let event = self.events.recv_timeout(longest)?;
        self.waiting.fetch_sub(1, Relaxed);
        Ok(event)
    }

    /// What has arrived so far.
    #[must_use]
    pub fn statistics(&self) -> ViewerStatistics {
        locked(&self.statistics).clone()
    }

    /// Begins to hang up: from now on nothing more arrives.
    pub fn leave(&self) {
        let begins = |left: &mut bool| !std::mem::replace(left, true);
        self.stop.send_if_modified(begins);
    }

    /// Hangs up and leaves the room.
    pub async fn hang_up(self) {
        self.leave();
        if let Err(error) = self.task.await {
            log::error!("a task of the call failed: {error}");
        }
    }
}

/// The task behind a [`Viewer`].
#[derive(Debug)]
struct Call {
    client: Client,
    planner: Planner,
    room: RoomLink,
    authentication: Authentication,
    clock: Clock,
    voice: VoiceQueue,
    events: Sender<CallEvent>,
    waiting: Arc<AtomicUsize>,
    stop: watch::Receiver<bool>,
    statistics: Arc<Mutex<ViewerStatistics>>,
    announced: Option<Announcement>,
    state: Option<PersonState>,
    /// When it was last told why the call does not begin.
    told: Option<Instant>,
    /// Who the sender is, once there was one; whether they showed a key.
    met: Option<Option<PublicKey>>,
}

/// The task that opens a connection.
type Joining = JoinHandle<Result<Box<(Announcement, Session)>, CallError>>;

/// What [`Call::run`] waits for.
enum Turn {
    Event(PeerEvent),
    Joined(Result<Box<(Announcement, Session)>, CallError>),
    Tick,
    /// This machine has lost an address.
    Moved,
    Stop,
}

impl Call {
    async fn run(mut self) {
        let mut current: Option<Session> = None;
        let mut joining: Option<Joining> = Some(self.start_joining(Duration::ZERO));
        let mut backoff = Backoff::default();
        let mut out = Vec::with_capacity(64);
        let mut here = addresses::Watch::begin();
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let turn = self.turn(&mut current, &mut joining, &mut ticks, &mut here);
            match turn.await {
                Turn::Event(PeerEvent::Message(bytes)) => {
                    let Some(session) = &mut current else {
                        continue;
                    };
                    session.last_heard = Instant::now();
                    if !session.cannot_open() {
                        backoff.reset();
                    }
                    match self.handle(session, bytes, &mut out).await {
                        Handled::Goes => {}
                        Handled::Bye => {
                            answer_bye(&session.peer, session.id).await;
                            while let Some(voice) = session.peer.voice_that_waits() {
                                self.hear(session, voice);
                            }
                            self.emit(CallEvent::HungUp);
                            self.finish(current.as_ref(), joining).await;
                            return;
                        }
                        Handled::Refused(error) => {
                            self.emit(CallEvent::Failed(error));
                            break;
                        }
                    }
                    // The silent connection has recovered: no second one is needed.
                    if !session.cannot_open()
                        && let Some(second) = joining.take()
                    {
                        second.abort();
                        self.with_statistics(|s| s.waits = false);
                    }
                }
                Turn::Event(PeerEvent::Voice(voice)) => {
                    if let Some(session) = &mut current {
                        self.hear(session, voice);
                    }
                }
                Turn::Event(PeerEvent::Closed) => {
                    current = None;
                    if joining.is_none() {
                        joining = Some(self.start_joining(backoff.next()));
                    }
                }
                Turn::Event(PeerEvent::Open) => {}
                Turn::Joined(Ok(joined)) => {
                    let (announcement, session) = *joined;
                    joining = None;
                    let (path, sender) = (session.path.clone(), session.sender);
                    let is_known = !session.awaits_seal();
                    if is_known && let Err(error) = self.meet(sender, session.person.clone()) {
                        session.peer.close().await;
                        self.emit(CallEvent::Failed(error));
                        break;
                    }
                    log::info!(
                        "joined (session {:08x}): {}",
                        session.id,
                        Path::told(path.as_ref())
                    );
                    current = Some(session);
                    self.announce(announcement);
                    self.with_statistics(|s| {
                        s.sessions += 1;
                        s.path = path;
                        s.not_joined = None;
                        s.waits = false;
                    });
                    if is_known {
                        self.voice.begin_connection();
                        self.emit(CallEvent::Joined);
                    }
                }
                // A connection that is only silent may recover, whatever the server answers.
                Turn::Joined(Err(error)) if error.is_final() && current.is_none() => {
                    self.emit(CallEvent::Failed(error));
                    break;
                }
                Turn::Joined(Err(error)) => {
                    let why = (!error.is_absence()).then(|| error.to_string());
                    let waits = matches!(error, CallError::Refused(_));
                    let is_asked = matches!(error, CallError::Refused(Refusal::Wait));
                    self.with_statistics(|s| {
                        s.not_joined = why;
                        s.waits = is_asked;
                    });
                    // Trying again may help, and so may who reads this.
                    let matters = matches!(
                        error,
                        CallError::NoWay { .. } | CallError::TooManyViewers | CallError::Refused(_)
                    );
                    let told = self.told.is_some_and(|at| at.elapsed() < TOLD_APART);
                    if matters && current.is_none() && !told {
                        self.told = Some(Instant::now());
                        log::warn!("{error}");
                    } else {
                        log::debug!("not joined yet: {error}");
                    }
                    let pause = if waits { KNOCK } else { backoff.next() };
                    joining = Some(self.start_joining(pause));
                }
                Turn::Tick => {
                    let Some(session) = &mut current else {
                        continue;
                    };
                    let is_silent = session.last_heard.elapsed() > SILENCE || session.cannot_open();
                    if is_silent && joining.is_none() {
                        log::warn!("the sender is silent: connecting again");
                        // All viewers of a forwarder notice another sender at once.
                        let pause = match session.cannot_open() {
                            true => backoff.next(),
                            false => Duration::ZERO,
                        };
                        joining = Some(self.start_joining(pause));
                    }
                    session.send_feedback(self.clock, &mut out).await;
                }
                Turn::Moved => {
                    // Connections to the server that began at an address which is gone lead nowhere.
                    renew(&mut self.client);
                    let path = current.as_ref().and_then(|session| session.path.as_ref());
                    if path.is_some_and(Path::is_cut) {
                        log::warn!("this machine's address has changed: connecting again");
                        if let Some(stale) = joining.take() {
                            stale.abort();
                        }
                        joining = Some(self.start_joining(Duration::ZERO));
                    }
                }
                Turn::Stop => break,
            }
        }
        if let Some(session) = &mut current
            && !send_bye(&mut session.peer, session.id).await
        {
            // The sender did not answer the bye: so the server is asked to tell the sender.
            let left = self.client.leave(&self.room, &session.name);
            if !matches!(timeout(LEAVE_TIMEOUT, left).await, Ok(Ok(()))) {
                log::debug!("the server was not told that this viewer left");
            }
        }
        self.finish(current.as_ref(), joining).await;
    }

    async fn finish(&self, current: Option<&Session>, joining: Option<Joining>) {
        if let Some(joining) = joining {
            joining.abort();
        }
        if let Some(session) = current {
            session.peer.close().await;
        }
    }

    /// Waits for the first [`Wake`].
    async fn turn(
        &mut self,
        current: &mut Option<Session>,
        joining: &mut Option<Joining>,
        ticks: &mut tokio::time::Interval,
        here: &mut addresses::Watch,
    ) -> Turn {
        let event = async {
            match current {
                Some(session) => session.peer.next().await,
                None => std::future::pending().await,
            }
        };
        let joined = async {
            match joining {
                Some(task) => task.await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            () = is_set(&mut self.stop) => Turn::Stop,
            event = event => Turn::Event(event),
            joined = joined => Turn::Joined(joined.unwrap_or_else(|error| Err(error.into()))),
            _ = ticks.tick() => Turn::Tick,
            () = here.lost() => Turn::Moved,
        }
    }

    fn start_joining(&self, after: Duration) -> Joining {
        let (room, clock) = (self.room.clone(), self.clock);
        let server = room.server().clone();
        let signaling = HttpRoom {
            client: self.client.clone(),
            room,
        };
        let (planner, authentication) = (self.planner.clone(), self.authentication.clone());
        let limit = match self.with_statistics(|s| s.round_trip_us) {
            // Some ten messages cross until the channel is open.
            Some(us) => RECONNECT_TIMEOUT + 10 * Duration::from_micros(us),
            None => CONNECT_TIMEOUT,
        };
        tokio::spawn(async move {
            tokio::time::sleep(after).await;
            // An idle connection to the server may be dead, which shows in a timeout only.
            let status = timeout(ANNOUNCEMENT_TIMEOUT, signaling.status())
                .await
                .map_err(|_| CallError::NotConnected)??;
            let announcement = status.announcement;
            let plan = planner.plan(&server, &status.ice_servers).await;
            let session = Session::open(
                &signaling,
                &announcement,
                plan,
                &authentication,
                clock,
                limit,
            )
            .await?;
            Ok(Box::new((announcement, session)))
        })
    }

    /// Takes the sender of another connection, who has to be the one of the first: who has another key is another person, whom someone else would take for
    /// the first.
    fn meet(
        &mut self,
        sender: Option<PublicKey>,
        person: Option<PersonName>,
    ) -> Result<(), CallError> {
        let first = *self.met.get_or_insert(sender);
        if first != sender {
            let fingerprint = |key: Option<PublicKey>| key.map(|key| key.fingerprint());
            return Err(CallError::AnotherSender {
                before: fingerprint(first),
                found: fingerprint(sender),
            });
        }
        self.with_statistics(|s| (s.sender, s.person) = (sender, person));
        Ok(())
    }

    fn announce(&mut self, announcement: Announcement) {
        if self.announced.as_ref() != Some(&announcement) {
            self.announced = Some(announcement);
            self.emit(CallEvent::Announced(announcement));
        }
    }

    /// Hands an event on; whether there was room for it.
    fn emit(&self, event: CallEvent) -> bool {
        // What a sender may send any number of is dropped where the caller is slow; what a connection brings once is not.
        let droppable = matches!(event, CallEvent::Frame { .. } | CallEvent::State(_));
        if droppable && self.waiting.load(Relaxed) >= MAX_WAITING {
            self.with_statistics(|s| s.overrun += 1);
            return false;
        }
        self.waiting.fetch_add(1, Relaxed);
        // Without a receiver the viewer is being dropped, which stops this task.
        let _ = self.events.send(event);
        true
    }

    fn with_statistics<T>(&self, look: impl FnOnce(&mut ViewerStatistics) -> T) -> T {
        look(&mut locked(&self.statistics))
    }
}

fn locked(statistics: &Mutex<ViewerStatistics>) -> MutexGuard<'_, ViewerStatistics> {
    // Counts stay valid after a panic elsewhere.
    statistics.lock().unwrap_or_else(PoisonError::into_inner)
}
