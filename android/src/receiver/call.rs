//! A loop of calls: waits for every sender with a notice in the headset, shows the people, and waits again when the senders have
//! hung up, until the viewer leaves.

use super::TaskContext;
use super::network::Network;
use crate::first_run;
use crate::settings::Settings;
use anyhow::Context;
use app_pipeline::placement::InferenceBackends;
use app_pipeline::pool::in_own_pool;
use app_pipeline::quality::QualityMode;
use app_session::call::CallEnd;
use app_session::headset::{FrameObserver, NoticeBoard, Seen, Wishes, show_notice};
use app_session::overlay::Notice;
use app_session::visit::{
    Ended, Guest, NetworkContext, Visited, Waiting, unless_over, visit, wait_for_sender,
};
use link_http::cache::PackageInUse;
use link_http::{Client, PackageCache};
use link_playout::Clock;
use link_protocol::RoomLink;
use spmm3::Avatar;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::available_parallelism;
use tokio::runtime::Handle;

/// Shows the people of `rooms`.
pub(super) fn run(
    task: &TaskContext<'_>,
    settings: &Settings,
    rooms: &[RoomLink],
) -> anyhow::Result<()> {
    let runtime = task.onnx_runtime()?;
    let threads = Network::start()?;
    let network = NetworkContext {
        network: threads.handle().clone(),
        client: Client::new(None)?,
        clock: Clock::start(),
    };
    let folders = &task.launch.folders;
    let compiled = folders.compiled();
    let backends = InferenceBackends {
        runtime: &runtime,
        threads: available_parallelism().map_or(1, usize::from),
        cache: Some(&compiled),
    };
    let wishes = wishes(settings);
    let packages = folders.packages(settings.cache_bytes.value)?;
    let board = NoticeBoard::default();
    loop {
        let Some(people) = wait_for_all(task, settings, rooms, &network, &packages, &board)? else {
            return Ok(());
        };
        let Some(found) = task.find()? else {
            return Ok(());
        };
        let guests: Vec<_> = (people.iter()).map(|person| person.guest.clone()).collect();
        let visited = visit(
            found,
            &backends,
            &wishes,
            &guests,
            &network,
            task.control,
            &mut Counter(task.frames),
        )?;
        if !log_calls(visited)? {
            return Ok(());
        }
    }
}

/// The session's settings, from the app's.
pub(super) fn wishes(settings: &Settings) -> Wishes {
    Wishes {
        placement: settings.placement.value,
        latency: settings.latency.value,
        hold: QualityMode::Adapt,
        scene: None,
        read_back: false,
        display_hz: settings.rate.value.map(|rate| f32::from(rate.hz())),
    }
}

/// Counts the frames that show a person, for [`TaskContext::frames`].
struct Counter<'a>(&'a AtomicU64);

impl FrameObserver for Counter<'_> {
    fn is_over(&self, _shown: u64) -> bool {
        false
    }

    fn wants(&mut self, _shown: u64, person_is_shown: bool) -> bool {
        self.0.fetch_add(u64::from(person_is_shown), Relaxed);
        false
    }

    fn seen(&mut self, _seen: Seen<'_>) {}
}

/// A person whose sender is in the room, and the guard that keeps their package in the cache.
struct FetchedPerson {
    guest: Guest,
    _package: Option<PackageInUse>,
}

/// Waits, with a notice in the headset, until every sender is there and every package is fetched; nothing if the viewer leaves before.
fn wait_for_all(
    task: &TaskContext<'_>,
    settings: &Settings,
    rooms: &[RoomLink],
    network: &NetworkContext,
    packages: &PackageCache,
    board: &NoticeBoard,
) -> anyhow::Result<Option<Vec<FetchedPerson>>> {
    let Some(found) = task.find()? else {
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
        let shown = show_notice(found, board, task.control, || done.load(Relaxed));
        // Also where showing failed: the other thread must stop waiting.
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
    let threads: &Handle = &network.network;
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
    let avatar = in_own_pool("package", || Avatar::load(&path))?
        .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
    Ok(Some(FetchedPerson {
        guest: Guest {
            room: room.clone(),
            announced,
            avatar: Arc::new(avatar),
            sits,
        },
        _package: package,
    }))
}

fn notice(board: &NoticeBoard, title: &str, lines: impl Into<Vec<String>>) {
    board.write(Notice {
        title: title.to_owned(),
        lines: lines.into(),
    });
}

/// Logs how the calls ended. Returns whether to wait for the next ones, because the senders ended these.
fn log_calls(visited: Visited) -> anyhow::Result<bool> {
    let frames = &visited.party.headset.frames;
    log::info!(
        "{} frames shown, {} refreshes late",
        frames.shown,
        frames.late
    );
    let (mut ended, mut failed) = (false, Vec::new());
    for call in visited.calls {
        let Ended { figures, end } = match call {
            Ok(call) => call,
            Err(error) => {
                failed.push(anyhow::Error::from(error));
                continue;
            }
        };
        log::info!(
            "a call of {:.0} s: {} frames taken, {} lost, {:.1} kbit/s of payload",
            figures.live_seconds,
            figures.released,
            figures.lost,
            figures.payload_kbit_s
        );
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
