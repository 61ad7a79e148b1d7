//! `--display xr`: the call in a headset, everybody in one room.

use super::album::Album;
use super::report::{Other, Report};
use super::screen::{Watched, measured};
use super::{Fetched, Options, Until, fetch, wait_for_sender};
use crate::live::{place_on, placed};
use crate::network::Network;
use crate::report::{Splatting, write_json};
use crate::scenery::Scenery;
use crate::stage::load_avatar;
use crate::surroundings::{Surroundings, make_folder};
use anyhow::{Context, bail};
use app::headset::{HeadsetFigures, Showing, show};
use app::hold::HoldMode;
use app::presence::Seated;
use app::{
    Call, CallEnd, Collector, LaneOptions, Lanes, OverlayWatch, Placed, PlacementReport,
    PlacementRequest, Plan, Skipped,
};
use glam::{Quat, Vec3};
use link::{Announcement, Client, Clock, Viewer};
use npu_runtime::Runtime;
use profile_report::AvatarFigures;
use spmm3::Avatar;
use std::sync::Arc;
use std::time::{Duration, Instant};
use xr_renderer::xr::{self, Headset, HeadsetOptions, SessionOptions};
use xr_renderer::{Camera, Filter, RendererOptions};

/// Gaussians beside the people's: their shadows.
const BESIDE: u32 = 256;
/// Where the first person will stand, and a scene is put around: before the viewer.
const BEFORE: Vec3 = Vec3::new(0.0, 0.0, -1.6);
/// Until a headset says its rate.
const HERTZ: f32 = 72.0;

/// A headset that is there.
pub(super) struct HeadsetFound {
    runtime: xr::Runtime,
    headset: Headset,
    options: HeadsetOptions,
}

impl HeadsetFound {
    /// Opens it, before anybody is kept waiting.
    pub(super) fn open(options: &Options) -> anyhow::Result<Self> {
        if options.gaze.is_some() {
            bail!("--gaze moves a camera, and in a headset the head does: leave it out");
        }
        let runtime = xr::Runtime::load()?;
        let headset_options = HeadsetOptions {
            eye_size: options.size.map(|size| [size.width, size.height]),
            validation: false,
        };
        let headset = Headset::open(&runtime, headset_options)?;
        Ok(Self {
            runtime,
            headset,
            options: headset_options,
        })
    }
}

/// Somebody to be shown.
struct Guest {
    avatar: Arc<Avatar>,
    figures: AvatarFigures,
    package: Fetched,
    announced: Announcement,
}

/// What is left of everybody's calls.
struct Party {
    calls: Vec<Call>,
    collector: Collector,
    headset: HeadsetFigures,
    placement: PlacementReport,
    skipped: Skipped,
    hold: app::hold::HoldFigures,
    splatting: Splatting,
    began: Instant,
}

/// What the network's side of everybody needs.
struct Ways<'a> {
    network: &'a Network,
    client: &'a Client,
    clock: Clock,
}

/// Runs `receive --display xr`.
pub(super) fn run(
    options: &Options,
    surroundings: &Surroundings,
    found: HeadsetFound,
) -> anyhow::Result<()> {
    let runtime = surroundings.runtime()?;
    if let Some(folder) = &options.out {
        make_folder(folder)?;
    }
    let network = Network::start()?;
    let client = options.trust.client()?;
    let stop = network.stop_on_signal();
    let ways = Ways {
        network: &network,
        client: &client,
        clock: Clock::start(),
    };
    let mut guests = Vec::new();
    for room in &options.rooms {
        let asked = network.block_on(wait_for_sender(&client, room, &stop))?;
        let Some(announced) = asked else {
            return Ok(());
        };
        let package = fetch(&network, &client, room, &announced)?;
        let (avatar, figures) = load_avatar(&package.path)?;
        guests.push(Guest {
            avatar,
            figures,
            package,
            announced,
        });
    }
    let until = Until {
        stop: Arc::clone(&stop),
        deadline: options.seconds.map(|seconds| Instant::now() + seconds),
    };
    let mut album = Album::new(&until, options.frames, options.out.is_some());
    let party = receive(options, &runtime, found, &guests, &ways, &mut album)?;
    let pictures = match &options.out {
        Some(folder) => album.write(folder)?,
        None => Vec::new(),
    };
    party.report(options, guests, pictures, &network)
}

/// Receives everybody until it is over.
fn receive(
    options: &Options,
    runtime: &Runtime,
    found: HeadsetFound,
    guests: &[Guest],
    ways: &Ways<'_>,
    album: &mut Album<'_>,
) -> anyhow::Result<Party> {
    let HeadsetFound {
        runtime: xr_runtime,
        headset,
        options: headset_options,
    } = found;
    let scenery = options.scenery.around(BEFORE, Quat::IDENTITY)?;
    let Some(first) = guests.first() else {
        bail!("there is nobody to show");
    };
    let cameras = eyes_before(headset.info().eye_size);
    let (placed, mut renderer) = placed(
        headset.gpu(),
        runtime,
        &first.avatar,
        renderer_options(&headset, guests, scenery.as_ref())?,
        &cameras,
        options.lanes.placement,
    )?;
    let Placed {
        plan,
        inference,
        report: placement,
    } = placed;
    // Only one person's Gaussians can stay on the device.
    let for_others = PlacementRequest {
        plan: Some(if plan == Plan::Pc { Plan::Cpu } else { plan }),
        ..options.lanes.placement
    };
    let mut others = Vec::new();
    for guest in guests.iter().skip(1) {
        let placed = place_on(runtime, &guest.avatar, &mut renderer, &cameras, for_others)?;
        others.push(placed);
    }
    let lane_options = LaneOptions {
        plan,
        latency: options.lanes.latency.into(),
        // Pictures on disk are as good as they can be; the eyes' are to come in time.
        hold: if options.out.is_some() {
            HoldMode::Fixed(0)
        } else {
            HoldMode::Adapt
        },
        display_period: Duration::from_secs_f32(1.0 / HERTZ),
    };
    let mut sources = options.sources(guests, ways).into_iter();
    let source = sources.next().context("there is nobody to show")?;
    let watch = source.source().watch();
    let mut lanes = Lanes::start(&first.avatar, inference, renderer, source, &lane_options)?;
    for ((guest, placed), source) in guests.iter().skip(1).zip(others).zip(sources) {
        lanes.join(&guest.avatar, placed.inference, source, placed.plan)?;
    }
    let showing = Showing {
        runtime: xr_runtime,
        options: headset_options,
        session: SessionOptions {
            // Who gives a scene wants to see it.
            room: scenery.is_none(),
            read_back: album.keeps,
        },
        skeletons: (guests.iter())
            .map(|guest| guest.avatar.skeleton.clone())
            .collect(),
        overlay: OverlayWatch::new(placement.clone(), Some(watch)),
    };
    let began = Instant::now();
    let headset = show(&mut lanes, headset, showing, album)?;
    Party::new(lanes, headset, placement, began)
}

impl Options {
    /// Everybody's call, each from its room.
    fn sources(&self, guests: &[Guest], ways: &Ways<'_>) -> Vec<Seated<Call>> {
        let joined = guests.iter().zip(&self.rooms).map(|(guest, room)| {
            let skeleton = &guest.avatar.skeleton;
            let viewer = (ways.network)
                .block_on(async { Viewer::join(ways.client.clone(), room.clone(), ways.clock) });
            let call = Call::new(viewer, guest.announced, skeleton, ways.clock);
            if self.seat {
                Seated::new(call, skeleton)
            } else {
                Seated::as_sent(call)
            }
        });
        joined.collect()
    }
}

impl Party {
    fn new(
        mut lanes: Lanes<Seated<Call>>,
        headset: HeadsetFigures,
        mut placement: PlacementReport,
        began: Instant,
    ) -> anyhow::Result<Self> {
        placement.follow(lanes.provider_changes());
        let renderer = lanes.renderer();
        let splatting = Splatting::new(renderer.back_end(), renderer.back_end_trial());
        let (skipped, hold) = (lanes.skipped(), lanes.hold());
        let (sources, collector) = lanes.finish_all();
        let mut calls = Vec::new();
        for source in sources {
            calls.push(source?.into_source());
        }
        Ok(Self {
            calls,
            collector,
            headset,
            placement,
            skipped,
            hold,
            splatting,
            began,
        })
    }

    /// Says goodbye to everybody, prints and writes what there is to tell.
    fn report(
        self,
        options: &Options,
        guests: Vec<Guest>,
        pictures: Vec<std::path::PathBuf>,
        network: &Network,
    ) -> anyhow::Result<()> {
        let mut told = Vec::new();
        let mut failed = None;
        for mut call in self.calls {
            match call.end() {
                Some(CallEnd::Failed(error)) => failed = Some(error),
                Some(CallEnd::AnotherAvatar(_)) => {
                    log::warn!("a sender has come back as somebody else: join again to see them");
                }
                Some(CallEnd::HungUp) | None => {}
            }
            told.push(call.figures());
            network.block_on(call.hang_up());
        }
        let mut everybody = guests.into_iter().zip(told);
        let Some((guest, call)) = everybody.next() else {
            bail!("there was nobody to show");
        };
        let [width, height] = self.headset.eye_size;
        let hertz = self.headset.display_hz.unwrap_or(HERTZ);
        let period = Duration::from_secs_f32(1.0 / hertz.max(1.0));
        let watched = Watched {
            pictures,
            views: 2,
            width,
            height,
            splatting: self.splatting,
            gaze: None,
            shown: measured(
                &self.collector,
                self.placement,
                (self.skipped, self.hold),
                self.began,
                period,
                call.announced.rate_hz,
            ),
        };
        let mut report = Report::new(guest.figures, &guest.package, call, Some(watched));
        report.headset = Some(self.headset);
        report.others = everybody
            .map(|(guest, call)| Other {
                avatar: guest.figures,
                call,
            })
            .collect();
        report.print();
        write_json(options.json.as_deref(), &report)?;
        failed.map_or(Ok(()), |error| Err(error).context("the call ended"))
    }
}

/// A renderer for everybody, in pictures of the headset's size.
fn renderer_options(
    headset: &Headset,
    guests: &[Guest],
    scenery: Option<&Scenery>,
) -> anyhow::Result<RendererOptions> {
    let [width, height] = headset.info().eye_size;
    let people = guests
        .iter()
        .map(|guest| guest.avatar.gaussians.len())
        .sum::<usize>();
    let people = u32::try_from(people).context("too many Gaussians")?;
    Ok(RendererOptions {
        background: scenery.map(|scenery| Arc::clone(&scenery.background)),
        filter: scenery.map_or(Filter::Dilation, Scenery::filter),
        depth: (headset.extensions()).has("XR_KHR_composition_layer_depth"),
        ..RendererOptions::new(people.saturating_add(BESIDE), width, height, 2)
    })
}

/// Eyes as they will see the first person, to find out what is fastest.
fn eyes_before([width, height]: [u32; 2]) -> [Camera; 2] {
    [-0.0315, 0.0315].map(|x| {
        let eye = Vec3::new(x, 1.6, 1.6);
        Camera::look_at(eye, eye - Vec3::Z, Vec3::Y, 1.6, width, height)
    })
}
