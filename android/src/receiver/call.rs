//! Sessions, one after the other: a notice while the senders are waited for, then the session, then waiting again when they have hung up,
//! until the viewer leaves.

use super::TaskContext;
use super::network::Network;
use super::shown::ShownFrames;
use crate::first_run;
use crate::settings::Settings;
use anyhow::Context;
use app_pipeline::placement::InferenceBackends;
use app_pipeline::pool::in_own_pool;
use app_pipeline::quality::QualityMode;
use app_session::arrival::{Waiting, unless_over, wait_for_sender};
use app_session::call::{CallEnd, CallFigures, CallWatch};
use app_session::headset::{
    FrameCapture, FrameObserver, GazeListener, HeadsetDisplay, HeadsetFigures, NoticeBoard,
    PresentOptions, show_notice,
};
use app_session::overlay::Notice;
use app_session::participant::{CallReport, NetworkContext, Origin, Participant};
use app_session::session::{Session, SessionConfig, SessionReport};
use call_member::GazeFeed;
use link_call::Credentials;
use link_http::PackageCache;
use link_http::cache::PackageInUse;
use link_playout::Clock;
use link_protocol::RoomLink;
use link_voice::VoiceQueue;
use profile_report::{Measured, SessionTerms};
use spmm3::Avatar;
use spmm3::package::PackageLimits;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::available_parallelism;
use std::time::Duration;

/// What a call's pictures are measured over, at most: its end.
const MEASURED: Duration = Duration::from_secs(30);

/// Shows the people in `rooms`.
pub(super) fn run(
    task: &TaskContext<'_>,
    settings: &Settings,
    rooms: &[RoomLink],
) -> anyhow::Result<()> {
    let runtime = task.onnx_runtime()?;
    let threads = Network::start()?;
    let network = NetworkContext {
        network: threads.handle().clone(),
        client: task.client(settings)?,
        own: Some(Credentials::new(
            task.launch.folders.keys()?.identity().clone(),
        )),
        clock: Clock::start(),
    };
    let folders = &task.launch.folders;
    let compiled = folders.compiled();
    let backends = InferenceBackends {
        runtime: &runtime,
        threads: available_parallelism().map_or(1, usize::from),
        compiled: &compiled,
    };
    let packages = folders.packages(settings.cache_bytes.value)?;
    let board = NoticeBoard::default();
    loop {
        let Some(people) = wait_for_all(task, settings, rooms, &network, &packages, &board)? else {
            return Ok(());
        };
        let Some(headset) = task.find()? else {
            return Ok(());
        };
        let participants = (people.iter())
            .map(|person| person.participant.clone())
            .collect();
        let config = config(settings, backends);
        let options = PresentOptions {
            gaze: settings.gaze_to.value.and_then(gaze_feed),
            ..present(settings)
        };
        let mut counter = Counter(task.frames);
        let mut display = HeadsetDisplay::new(headset, options, &mut counter);
        let session = Session::new(config, participants, task.control.clone());
        let report = session.run(&mut display)?;
        if !log_calls(report, &display.into_figures())? {
            return Ok(());
        }
    }
}

/// Sessions as the settings want them.
pub(super) fn config<'a>(
    settings: &Settings,
    backends: InferenceBackends<'a>,
) -> SessionConfig<'a> {
    SessionConfig {
        backends,
        placement: settings.placement.value,
        latency: settings.latency.value,
        quality: QualityMode::Adapt,
    }
}

/// The headset's frames as the settings want them.
pub(super) fn present(settings: &Settings) -> PresentOptions {
    PresentOptions {
        display_hz: settings.rate.value.map(|rate| f32::from(rate.hz())),
        ..PresentOptions::default()
    }
}

/// Sends where the wearer looks to a second screen; without a way there it is told, and the call goes on.
fn gaze_feed(to: SocketAddr) -> Option<Arc<dyn GazeListener>> {
    match GazeFeed::new(to) {
        Ok(feed) => Some(Arc::new(feed)),
        Err(error) => {
            log::warn!("{:#}", anyhow::Error::from(error));
            None
        }
    }
}

/// Counts the frames with people in them, for other threads.
struct Counter<'a>(&'a ShownFrames);

impl FrameObserver for Counter<'_> {
    fn is_over(&self, _shown: u64) -> bool {
        false
    }

    fn wants_pictures(&mut self, _shown: u64, has_people: bool) -> bool {
        self.0.count(has_people);
        false
    }

    fn captured(&mut self, _frame: FrameCapture<'_>) {}
}

/// A person who is in the room, and the hold on their package in the cache.
struct FetchedPerson {
    participant: Participant,
    _package: Option<PackageInUse>,
}

/// Waits in the headset until all people are there and their packages are here; nothing if the viewer leaves before.
fn wait_for_all(
    task: &TaskContext<'_>,
    settings: &Settings,
    rooms: &[RoomLink],
    network: &NetworkContext,
    packages: &PackageCache,
    board: &NoticeBoard,
) -> anyhow::Result<Option<Vec<FetchedPerson>>> {
    let Some(headset) = task.find()? else {
        return Ok(None);
    };
    let (done, closed) = (AtomicBool::new(false), AtomicBool::new(false));
    let is_over = || closed.load(Relaxed) || task.control.is_leaving();
    std::thread::scope(|scope| {
        let waiting = scope.spawn(|| {
            let arriving = (rooms.iter()).map(|room| {
                wait_and_fetch(
                    room,
                    settings.seat.value,
                    network,
                    packages,
                    board,
                    &is_over,
                )
            });
            let outcome: anyhow::Result<Option<Vec<_>>> = arriving.collect();
            done.store(true, Relaxed);
            outcome
        });
        let shown = show_notice(headset, board, task.control, || done.load(Relaxed));
        // Also where it failed: the other thread is not to wait on.
        closed.store(!done.load(Relaxed), Relaxed);
        let outcome = waiting
            .join()
            .map_err(|_| anyhow::anyhow!("the thread that waits for the call failed"))?;
        shown?;
        outcome
    })
}

/// Waits for one sender, and fetches its avatar's package.
fn wait_and_fetch(
    room: &RoomLink,
    sits: bool,
    network: &NetworkContext,
    packages: &PackageCache,
    board: &NoticeBoard,
    is_over: &dyn Fn() -> bool,
) -> anyhow::Result<Option<FetchedPerson>> {
    let threads = &network.network;
    let server = room.server();
    let asking = [format!("Asking {server} ...")];
    notice(board, "One moment", asking);
    let show_waiting = |waiting: &Waiting| match waiting {
        Waiting::ForSender => {
            log::info!("waiting for the sender");
            let text = "They are not in the room yet. You will see them as soon as they are.";
            notice(
                board,
                "Waiting for the other person",
                first_run::wrapped(text),
            );
        }
        Waiting::Trouble(why) => {
            log::warn!("{why}; trying again");
            let mut lines = first_run::wrapped(why);
            lines.push("Trying again.".to_owned());
            notice(board, "Waiting for the server", lines);
        }
    };
    let waited = wait_for_sender(&network.client, room, is_over, show_waiting);
    let Some(announced) = threads.block_on(waited).context("cannot join the room")? else {
        return Ok(None);
    };
    let fetching = (network.client).fetch_package(room, &announced.avatar, packages, |step| {
        let share = step.done as f64 * 100.0 / step.total.max(1) as f64;
        let megabytes = step.total as f64 / 1e6;
        let line = format!("{share:.0} % of {megabytes:.0} MB. It is kept for the next call.");
        notice(board, "Fetching the other person's avatar", [line]);
    });
    let Some(path) = threads.block_on(unless_over(is_over, fetching)) else {
        return Ok(None);
    };
    let path = path.context("cannot fetch the avatar")?;
    let package = packages.in_use(&announced.avatar.sha256)?;
    notice(board, "One moment", ["Getting ready ...".to_owned()]);
    let avatar = in_own_pool("package", || {
        Avatar::load_within(&path, &PackageLimits::OTHERS)
    })?
    .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
    Ok(Some(FetchedPerson {
        participant: Participant {
            avatar: Arc::new(avatar),
            sits,
            origin: Origin::Room {
                link: room.clone(),
                announced,
                network: network.clone(),
                voice: VoiceQueue::default(),
                watch: CallWatch::default(),
            },
        },
        _package: package,
    }))
}

/// Writes a notice.
pub(super) fn notice(board: &NoticeBoard, title: &str, lines: impl Into<Vec<String>>) {
    board.write(Notice {
        title: title.to_owned(),
        lines: lines.into(),
    });
}

/// Logs what was measured of a call with one person.
pub(super) fn log_figures(figures: &CallFigures) {
    log::info!(
        "a call of {:.0} s: {} frames taken, {} lost, {:.1} kbit/s of payload",
        figures.live_seconds,
        figures.released,
        figures.lost,
        figures.payload_kbit_s
    );
}

/// Logs how the people's pictures came, a line each.
pub(super) fn log_pictures(session: &SessionReport, headset: &HeadsetFigures) {
    let begin = session.ended.checked_sub(MEASURED);
    for person in &session.people {
        let Some(call) = &person.call else {
            continue;
        };
        let terms = SessionTerms {
            time: [
                begin.map_or(session.began, |begin| begin.max(session.began)),
                session.ended,
            ],
            display_period: headset.display_period(),
            motion_hz: call.figures.announced.rate_hz,
            encode: None,
        };
        let of = Measured::of(session, person, &terms).measured;
        let latency = of.latency.map_or_else(String::new, |latency| {
            let whole = latency.whole;
            format!(
                "; to the display {:.1} ms, 99 % within {:.1} ms",
                whole.p50_ms, whole.p99_ms
            )
        });
        log::info!(
            "pictures of a person: {} in {:.1} s, {:.1} of {:.0} a second, {} late{latency}; at the end {}",
            of.pictures.shown,
            of.seconds,
            of.pictures.per_second,
            of.display_hz,
            of.pictures.late,
            session.quality.quality
        );
    }
}

/// Logs how the calls ended. Returns whether to wait for the next ones, because the senders ended these.
fn log_calls(session: SessionReport, headset: &HeadsetFigures) -> anyhow::Result<bool> {
    let frames = &headset.frames;
    log::info!(
        "{} frames shown, {} refreshes late",
        frames.shown,
        frames.late
    );
    log_pictures(&session, headset);
    let (mut ended, mut failed) = (false, Vec::new());
    for person in session.people {
        failed.extend(person.error.map(anyhow::Error::from));
        let Some(CallReport { figures, end, .. }) = person.call else {
            continue;
        };
        log_figures(&figures);
        match end {
            Some(CallEnd::Failed(error)) => {
                failed.push(anyhow::Error::from(error).context("the call ended"));
            }
            Some(CallEnd::HungUp | CallEnd::AnotherAvatar(_)) => ended = true,
            None => {}
        }
    }
    if !ended && let Some(error) = failed.pop() {
        return Err(error);
    }
    for error in failed {
        log::warn!("{error:#}");
    }
    Ok(ended)
}
