//! `--display xr`: the call in a headset, everybody in one room.

use super::album::Album;
use super::report::{Other, Report};
use super::screen::{Watched, measured};
use super::{Fetched, Options, Until, fetch, wait_for_sender};
use crate::network::Network;
use crate::report::{Splatting, write_json};
use crate::scenery::Scenery;
use crate::stage::load_avatar;
use crate::surroundings::{Surroundings, compiled, make_folder, offer};
use anyhow::{anyhow, bail};
use app::headset::{Found, Wishes};
use app::hold::HoldMode;
use app::visit::{Ended, Guest, Visited, Ways, visit};
use app::{CallEnd, CallFigures, Control};
use glam::{Quat, Vec3};
use link::Clock;
use profile_report::AvatarFigures;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use xr_renderer::xr::{HeadsetOptions, Runtime};

/// Where the first person will stand, and a scene is put around: before the viewer.
const BEFORE: Vec3 = Vec3::new(0.0, 0.0, -1.6);

/// Opens the headset, before anybody is kept waiting.
pub(super) fn find(options: &Options) -> anyhow::Result<Found> {
    if options.gaze.is_some() {
        bail!("--gaze moves a camera, and in a headset the head does: leave it out");
    }
    let headset = HeadsetOptions {
        eye_size: options.size.map(|size| [size.width, size.height]),
        validation: false,
    };
    Ok(Found::open(Runtime::load()?, headset)?)
}

/// What is told of somebody beside what is seen.
struct Known {
    figures: AvatarFigures,
    package: Fetched,
}

/// Runs `receive --display xr`.
pub(super) fn run(
    options: &Options,
    surroundings: &Surroundings,
    found: Found,
) -> anyhow::Result<()> {
    let runtime = surroundings.runtime()?;
    if let Some(folder) = &options.out {
        make_folder(folder)?;
    }
    let network = Network::start()?;
    let ways = Ways {
        network: network.handle(),
        client: options.trust.client()?,
        clock: Clock::start(),
    };
    let stop = network.stop_on_signal();
    let (mut guests, mut known) = (Vec::new(), Vec::new());
    for room in &options.rooms {
        let asked = network.block_on(wait_for_sender(&ways.client, room, &stop))?;
        let Some(announced) = asked else {
            return Ok(());
        };
        let package = fetch(&network, &ways.client, room, &announced)?;
        let (avatar, figures) = load_avatar(&package.path)?;
        guests.push(Guest {
            room: room.clone(),
            announced,
            avatar,
            sits: options.seat,
        });
        known.push(Known { figures, package });
    }
    let until = Until {
        stop: Arc::clone(&stop),
        deadline: options.seconds.map(|seconds| Instant::now() + seconds),
    };
    let mut album = Album::new(&until, options.frames, options.out.is_some());
    let scenery = options.scenery.around(None, BEFORE, Quat::IDENTITY)?;
    let wishes = Wishes {
        placement: options.lanes.placement,
        latency: options.lanes.latency.into(),
        // Pictures on disk are as good as they can be; the eyes' are to come in time.
        hold: if options.out.is_some() {
            HoldMode::Fixed(0)
        } else {
            HoldMode::Adapt
        },
        scene: (scenery.as_ref())
            .map(|scenery| (Arc::clone(&scenery.background), Scenery::filter(scenery))),
        read_back: options.out.is_some(),
        display_hz: None,
    };
    let compiled = compiled()?;
    let visited = visit(
        found,
        &offer(&runtime, &compiled),
        &wishes,
        &guests,
        &ways,
        &Control::default(),
        &mut album,
    )?;
    let pictures = match &options.out {
        Some(folder) => album.write(folder)?,
        None => Vec::new(),
    };
    report(options, visited, known, pictures)
}

/// Prints and writes what there is to tell. Only if nobody's call came to a good end, the last one's trouble is an error.
fn report(
    options: &Options,
    visited: Visited,
    known: Vec<Known>,
    pictures: Vec<PathBuf>,
) -> anyhow::Result<()> {
    let Visited { calls, party } = visited;
    let (mut told, mut failed) = (Vec::new(), Vec::new());
    for (person, (known, call)) in known.into_iter().zip(calls).enumerate() {
        let Ended { figures, end } = match call {
            Ok(ended) => ended,
            Err(error) => {
                failed.push((person, anyhow::Error::from(error)));
                continue;
            }
        };
        match end {
            Some(CallEnd::Failed(error)) => failed.push((person, error.into())),
            Some(CallEnd::AnotherAvatar(_)) => {
                log::warn!("a sender has come back as somebody else: join again to see them");
            }
            Some(CallEnd::HungUp) | None => {}
        }
        told.push((known, figures));
    }
    let nobody_stayed = failed.len() == options.rooms.len();
    let last = failed.pop_if(|_| nobody_stayed);
    let last = last.map(|(_, error)| error.context("the call ended"));
    for (person, error) in failed {
        log::warn!("person {person}'s call ended: {error:#}");
    }
    let mut told = told.into_iter();
    let Some((first, call)) = told.next() else {
        return Err(last.unwrap_or_else(|| anyhow!("there was nobody to show")));
    };
    let [width, height] = party.headset.eye_size;
    let period = party.display_period();
    let watched = Watched {
        pictures,
        views: 2,
        width,
        height,
        splatting: Splatting::new(party.back_end, party.back_end_trial),
        gaze: None,
        shown: measured(
            &party.collector,
            party.placement,
            (party.skipped, party.hold),
            party.began,
            period,
            call.announced.rate_hz,
        ),
    };
    let mut report = Report::new(first.figures, &first.package, call, Some(watched));
    report.headset = Some(party.headset);
    report.others = told
        .map(|(known, call): (Known, CallFigures)| Other {
            avatar: known.figures,
            call,
        })
        .collect();
    report.print();
    write_json(options.json.as_deref(), &report)?;
    last.map_or(Ok(()), Err)
}
