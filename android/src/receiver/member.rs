//! A member of a call of several: the wearer is sent, seen and heard, and everyone else is shown and heard.

use super::TaskContext;
use super::call::{config, log_figures, log_pictures, notice, present};
use super::microphone::AllowedMicrophone;
use super::missing::show_until_closed;
use super::network::Network;
use super::shown::ShownFrames;
use crate::first_run;
use crate::settings::Settings;
use anyhow::{Context, anyhow};
use app_pipeline::placement::InferenceBackends;
use app_pipeline::pool::in_own_pool;
use app_session::SetAtEnd;
use app_session::arrival::unless_over;
use app_session::call::CallWatch;
use app_session::headset::{
    FrameCapture, FrameObserver, HeadsetDisplay, HeadsetHandle, NoticeBoard, PresentOptions,
    WearerSlot, show_notice,
};
use app_session::own_motion::OwnMotion;
use app_session::participant::{NetworkContext, Origin, Participant};
use app_session::session::Session;
use call_member::{
    Acquaintances, Members, Newcomer, Performance, PrivacyButtons, Roster, WEARER_RATE,
    WearerCapture, play_voices,
};
use identity::Keyring;
use link_call::{Credentials, Door, Sender};
use link_codec::Codec;
use link_http::PackageCache;
use link_playout::Clock;
use link_protocol::announcement::ChannelMode;
use link_protocol::limits::MAX_PEOPLE;
use link_protocol::{Announcement, CallLink, RoomLink};
use link_voice::VoiceQueue;
use motion_fit::wearer::Stance;
use sender::{Desk, Place};
use spmm3::Avatar;
use spmm3::package::PackageLimits;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::channel;
use std::thread::available_parallelism;
use std::time::{Duration, Instant};
use voice_processing::FarEnd;

/// How long the call waits for the wearer to allow the microphone. It begins without it then, and takes it when it may.
const ASKED_FOR: Duration = Duration::from_secs(20);
/// Between two tries to open the loudspeaker.
const LOUDSPEAKER_AGAIN: Duration = Duration::from_secs(2);
/// Between two looks at what is waited for.
const LOOK: Duration = Duration::from_millis(50);

/// Takes a seat of the call, and stays until the app is closed.
pub(super) fn run(
    task: &TaskContext<'_>,
    settings: &Settings,
    link: &CallLink,
) -> anyhow::Result<()> {
    let name = settings.avatar.value.as_str();
    let avatar = task.launch.folders.avatar(name);
    if !avatar.is_file() {
        log::warn!("there is no avatar {}: no seat is taken", avatar.display());
        let lines = first_run::without_avatar(name);
        return show_until_closed(task, "You need an avatar for this call", lines);
    }
    let threads = Network::start()?;
    let keyring = task.launch.folders.keys()?;
    let member = Member {
        task,
        settings,
        network: NetworkContext {
            network: threads.handle().clone(),
            client: task.client(settings)?,
            own: Some(Credentials::new(keyring.identity().clone())),
            clock: Clock::start(),
        },
        packages: task.launch.folders.packages(settings.cache_bytes.value)?,
        desk: Desk {
            place: Place::Call {
                link: link.clone(),
                name: settings.name.value.clone(),
            },
            avatar,
            codec: Codec::default(),
            channel: ChannelMode::default(),
            rate_hz: WEARER_RATE,
            credentials: None,
            door: Door::default(),
        },
        keyring,
        stop: AtomicBool::new(false),
    };
    let Some((avatar, host)) = member.enter()? else {
        return Ok(());
    };
    let held = match task.find() {
        Ok(Some(headset)) => member.hold(link, headset, &avatar, &host),
        Ok(None) => Ok(()),
        Err(error) => Err(error.into()),
    };
    let sent = threads.handle().block_on(host.hang_up());
    log::info!(
        "sent {} frames of motion and {} packets of voice to {} viewers",
        sent.sent,
        sent.voice_sent,
        sent.joined
    );
    held
}

/// What a member needs.
struct Member<'a> {
    task: &'a TaskContext<'a>,
    settings: &'a Settings,
    network: NetworkContext,
    packages: PackageCache,
    desk: Desk,
    keyring: Keyring,
    /// It is time to leave.
    stop: AtomicBool,
}

impl Member<'_> {
    /// Takes a seat, with a notice in the headset meanwhile; nothing if the app is closed before.
    fn enter(&self) -> anyhow::Result<Option<(Arc<Avatar>, Sender)>> {
        let Some(headset) = self.task.find()? else {
            return Ok(None);
        };
        let board = NoticeBoard::default();
        let (done, closed) = (AtomicBool::new(false), AtomicBool::new(false));
        let is_over = || closed.load(Relaxed) || self.task.control.is_leaving();
        std::thread::scope(|scope| {
            let entering = scope.spawn(|| {
                let _done = SetAtEnd(&done);
                self.ask_for_leave(&board, &is_over);
                self.sit(&board, &is_over)
            });
            let shown = show_notice(headset, &board, self.task.control, || done.load(Relaxed));
            // Also where it failed: the other thread is not to wait on.
            closed.store(!done.load(Relaxed), Relaxed);
            let entered = entering
                .join()
                .map_err(|_| anyhow!("the thread that enters the call failed"))?;
            shown?;
            entered
        })
    }

    /// Has Android ask the wearer whether they may be heard and watched, once, and again for the microphone where they have refused it: Android decides
    /// whether it shows the question then. Who refuses is not heard, and is told so; the call waits for the first answer only.
    fn ask_for_leave(&self, board: &NoticeBoard, is_over: &dyn Fn() -> bool) {
        let (leave, folders) = (&self.task.leave, &self.task.launch.folders);
        let is_first = !folders.was_leave_asked_for();
        if leave.may_record() && !is_first {
            return;
        }
        let lines = first_run::wrapped(
            "With the microphone the others hear you. With body, face and eyes, where your headset has them, your avatar moves as you do; \
             without, head and hands move it, and your voice its lips. You can change your mind in the headset's settings, at the apps' permissions.",
        );
        notice(board, "May the others hear and see you?", lines);
        leave.ask();
        folders.note_leave_asked_for();
        if leave.may_record() {
            return;
        }
        if !is_first {
            log::warn!("the microphone is not allowed: the call goes on without it");
            return;
        }
        let asked = Instant::now();
        while !is_over() && asked.elapsed() < ASKED_FOR {
            if leave.may_record() {
                return;
            }
            std::thread::sleep(LOOK);
        }
        if !is_over() {
            log::warn!("the microphone is not allowed: the call goes on without it");
        }
    }

    fn sit(
        &self,
        board: &NoticeBoard,
        is_over: &dyn Fn() -> bool,
    ) -> anyhow::Result<Option<(Arc<Avatar>, Sender)>> {
        notice(board, "One moment", ["Getting ready ...".to_owned()]);
        let path = &self.desk.avatar;
        let avatar = in_own_pool("package", || Avatar::load(path))?
            .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
        let own = self.keyring.identity();
        let permits = self.keyring.permits()?;
        let credentials = Credentials::for_avatar(own.clone(), avatar.signer, &permits)
            .with_context(|| {
                format!(
                    "this headset may not drive that avatar: its owner runs `mon3tr keys allow {}`, and what that prints goes into the file `permits` beside the avatar",
                    own.public()
                )
            })?;
        let desk = Desk {
            credentials: Some(credentials),
            ..self.desk.clone()
        };
        let server = desk.place.server();
        notice(board, "One moment", [format!("Asking {server} ...")]);
        let progress = {
            let board = board.clone();
            move |done: u64, total: u64| {
                let share = done as f64 * 100.0 / total.max(1) as f64;
                let line = format!("{share:.0} %. It is kept there for the next call.");
                notice(&board, "Handing your avatar to the server", [line]);
            }
        };
        let NetworkContext {
            network,
            client,
            clock,
            ..
        } = &self.network;
        let entering = sender::enter(client, &desk, *clock, progress);
        let Some(entered) = network.block_on(unless_over(is_over, entering)) else {
            return Ok(None);
        };
        let host = entered.context("cannot enter the call")?.host;
        log::info!("in the call");
        Ok(Some((Arc::new(avatar), host)))
    }

    /// Sends the wearer and shows the others, until the app is closed or the seat is lost for good.
    fn hold(
        &self,
        link: &CallLink,
        headset: HeadsetHandle,
        avatar: &Arc<Avatar>,
        host: &Sender,
    ) -> anyhow::Result<()> {
        let (settings, clock) = (self.settings, self.network.clock);
        let runtime = self.task.onnx_runtime()?;
        let compiled = self.task.launch.folders.compiled();
        let backends = InferenceBackends {
            runtime: &runtime,
            threads: available_parallelism().map_or(1, usize::from),
            compiled: &compiled,
        };
        let (slot, own, far_end) = (
            WearerSlot::default(),
            OwnMotion::default(),
            FarEnd::default(),
        );
        let voices: Vec<_> = (0..MAX_PEOPLE).map(|_| VoiceQueue::default()).collect();
        let mut microphone = AllowedMicrophone::new(
            Arc::clone(&self.task.leave),
            self.task.control.clone(),
            far_end.clone(),
        );
        let sits = settings.seat.value;
        let stance = if sits {
            Stance::Seated
        } else {
            Stance::Standing
        };
        let face = (&avatar.expression_basis, &avatar.expressions);
        let mut capture = WearerCapture::new(slot.clone(), &avatar.skeleton, face, stance);
        let roster = Roster {
            link: link.clone(),
            own: host.venue(),
            voices: voices.clone(),
            members: Members::default(),
            acquaintances: Acquaintances::open(self.task.launch.folders.people_met()),
            offers: host.offers(),
            door: self.desk.door.clone(),
            longest: None,
            network: &self.network,
            stop: &self.stop,
            tell: &|line| log::info!("{line}"),
        };
        let (admit, newcomers) = channel();
        let me = Participant {
            avatar: Arc::clone(avatar),
            sits,
            origin: Origin::Own(own),
        };
        if let Some(screen) = settings.gaze_to.value {
            log::warn!(
                "where the wearer looks is not sent to {screen}: a second screen would stand among other people than those of this call"
            );
        }
        let options = PresentOptions {
            wearer: Some(slot.clone()),
            privacy: Some(Arc::new(PrivacyButtons::new(host.privacy()))),
            ..present(settings)
        };
        let mut watch = Watch {
            frames: self.task.frames,
            stop: &self.stop,
        };
        let mut display = HeadsetDisplay::new(headset, options, &mut watch);
        let session = Session::new(
            config(settings, backends),
            vec![me],
            self.task.control.clone(),
        )
        .with_newcomers(newcomers);
        let (shown, sent) = std::thread::scope(|scope| {
            let sent = scope.spawn(|| {
                let _over = SetAtEnd(&self.stop);
                // A performance begins when a viewer is there.
                while host.statistics().viewers == 0 && !self.stop.load(Relaxed) {
                    std::thread::sleep(LOOK);
                }
                let performance = Performance {
                    capture: &mut capture,
                    expressions: &avatar.expressions,
                    voice: Some(&mut microphone),
                    own: None,
                };
                performance.send(host, clock, &self.stop)
            });
            scope.spawn(|| self.play(&voices, &far_end));
            scope.spawn(|| {
                let _over = SetAtEnd(&self.stop);
                roster.follow(
                    |room, announced, watch| self.fetch(room, announced, watch),
                    |newcomer| admit.send(self.participant(newcomer)).is_ok(),
                )
            });
            let shown = {
                let _over = SetAtEnd(&self.stop);
                let _unworn = slot.close_at_end();
                session.run(&mut display)
            };
            (shown, sent.join())
        });
        let shown = shown?;
        log_pictures(&shown, &display.into_figures());
        for person in &shown.people {
            if let Some(error) = &person.error {
                log::warn!("a person was not shown any longer: {error}");
            }
            if let Some(call) = &person.call {
                log_figures(&call.figures);
            }
        }
        sent.map_err(|_| anyhow!("the thread that sends has failed"))?
            .context("the call ended")
    }

    /// Plays what the others say until it is time to leave, as soon as there is a loudspeaker.
    fn play(&self, voices: &[VoiceQueue], far_end: &FarEnd) {
        let (mut played, mut is_told) = (None, false);
        let mut next = Instant::now();
        while !self.stop.load(Relaxed) {
            if played.is_none() && Instant::now() >= next {
                next = Instant::now() + LOUDSPEAKER_AGAIN;
                match play_voices(None, voices, self.network.clock, Some(far_end.clone())) {
                    Ok(loudspeaker) => played = Some(loudspeaker),
                    Err(why) if !std::mem::replace(&mut is_told, true) => {
                        log::warn!("no voice is heard so far: {why}");
                    }
                    Err(_) => {}
                }
            }
            std::thread::sleep(LOOK);
        }
    }

    /// The avatar that someone has announced, from this headset or else from the server; nothing if it is time to leave before.
    fn fetch(
        &self,
        room: &RoomLink,
        announced: &Announcement,
        watch: &CallWatch,
    ) -> anyhow::Result<Option<Arc<Avatar>>> {
        let NetworkContext {
            network, client, ..
        } = &self.network;
        let fetching = client.fetch_package(room, &announced.avatar, &self.packages, |_| {});
        let is_over = || self.stop.load(Relaxed) || watch.is_over();
        let Some(path) = network.block_on(unless_over(is_over, fetching)) else {
            return Ok(None);
        };
        let path: PathBuf = path.context("cannot fetch the avatar")?;
        // Until it is loaded it is not removed for the room that others need.
        let _held = self.packages.in_use(&announced.avatar.sha256)?;
        let avatar = in_own_pool("package", || {
            Avatar::load_within(&path, &PackageLimits::OTHERS)
        })?
        .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
        Ok(Some(Arc::new(avatar)))
    }

    fn participant(&self, newcomer: Newcomer<Arc<Avatar>>) -> Participant {
        Participant {
            avatar: newcomer.avatar,
            sits: self.settings.seat.value,
            origin: Origin::Room {
                link: newcomer.room,
                announced: newcomer.announced,
                network: self.network.clone(),
                voice: newcomer.voice,
                watch: newcomer.watch,
            },
        }
    }
}

/// Counts the frames with people in them, and ends the session when it is time to leave.
struct Watch<'a> {
    frames: &'a ShownFrames,
    stop: &'a AtomicBool,
}

impl FrameObserver for Watch<'_> {
    fn is_over(&self, _shown: u64) -> bool {
        self.stop.load(Relaxed)
    }

    fn wants_pictures(&mut self, _shown: u64, has_people: bool) -> bool {
        self.frames.count(has_people);
        false
    }

    fn captured(&mut self, _frame: FrameCapture<'_>) {}
}
