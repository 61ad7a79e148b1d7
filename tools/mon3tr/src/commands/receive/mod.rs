//! `mon3tr receive`: joins a room, fetches the avatar once, and shows who is there.

mod album;
mod headset;
mod offscreen;
mod report;
mod undrawn;

use crate::device_options::{DeviceOptions, cache, make_folder};
use crate::gaze::{GazeChoice, Sight};
use crate::lanes::LaneChoices;
use crate::live::PreparedView;
use crate::network::{self, Network};
use crate::progress;
use crate::report::{check_writable, write_json};
use crate::scenery::SceneryOptions;
use crate::screen::Screen;
use crate::size::{DEFAULT_SIZE, Size, Views};
use crate::stills::{RenderSettings, load_avatar};
use crate::until::Until;
use crate::viewpoint::Viewpoint;
use crate::window;
use anyhow::{Context, bail};
use app_pipeline::quality::QualityMode;
use app_session::call::{Call, CallEnd};
use app_session::visit::Waiting;
use clap::ValueEnum;
use link_call::Viewer;
use link_http::{Client, PackageCache};
use link_playout::Clock;
use link_protocol::{Announcement, RoomLink};
use npu_runtime::Runtime;
use renderer_splat::options::Filter;
use renderer_vulkan::gpu::Gpu;
use report::Report;
use spmm3::Avatar;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Pictures a second of a display, as most are.
const HERTZ: f64 = 60.0;

/// Options of `receive`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The viewers' link, as `send` prints it; of several rooms with `--display xr`, whose people then stand in one
    #[arg(value_name = "LINK", required = true)]
    rooms: Vec<RoomLink>,
    /// Where the person is shown: in a headset (xr), in a window, offscreen as pictures on disk, in the first of these that there
    /// is (auto), or not at all (none), to measure the network alone
    #[arg(long, value_name = "WHERE", default_value = "window")]
    display: Display,
    /// Folder for the pictures of `--display offscreen`, made if missing; with `--display xr` pictures of both eyes are kept if
    /// it is given [default: out/call]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Leave after so many frames with `--display xr`
    #[arg(long, value_name = "N")]
    frames: Option<u64>,
    /// Have people sit, on a chair of 0.45 m, with `--display xr`
    #[arg(long)]
    seat: bool,
    /// Leave so many seconds after joining [default: when the sender hangs up, or on Ctrl-C]
    #[arg(long, value_name = "SECONDS", value_parser = network::parse_seconds)]
    seconds: Option<Duration>,
    /// Size of one picture in pixels, or of the window at first [default: 1024x1024, or what the headset recommends]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Both eyes' views
    #[arg(long)]
    stereo: bool,
    /// Where the person is seen from: front, three-quarter, side, back, waist-up, face, hands, or EYE:TARGET:FOV in metres and
    /// degrees relative to the person, e.g. 0,1.6,2:0,1.4,0:30
    #[arg(
        long,
        value_name = "VIEW",
        default_value = "three-quarter",
        allow_hyphen_values = true
    )]
    camera: Viewpoint,
    /// Let the camera follow a gaze, within 25 degrees around the person: `mouse` for the mouse in the window, or a file of an eye
    /// tracker's samples, lines of `seconds,x,y` or {"seconds":S,"x":X,"y":Y}, seconds from the first picture, x (to the right) and y (down) from 0 to 1
    #[arg(long, value_name = "mouse|FILE")]
    gaze: Option<GazeChoice>,
    #[command(flatten)]
    lanes: LaneChoices,
    #[command(flatten)]
    scenery: SceneryOptions,
    #[command(flatten)]
    trust: network::Trust,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Where the person is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Display {
    Auto,
    Xr,
    Window,
    Offscreen,
    None,
}

impl Display {
    /// What a gaze finds there.
    fn sight(self) -> Sight {
        match self {
            Self::Window => Sight::Window,
            Self::Offscreen => Sight::Offscreen,
            Self::Auto | Self::Xr | Self::None => Sight::Nothing,
        }
    }
}

/// Runs `receive`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.scenery.check()?;
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let shown = match options.display {
        Display::Xr => {
            return headset::run(options, device, headset::find(options)?);
        }
        Display::Auto => match headset::find(options) {
            Ok(found) => return headset::run(options, device, found),
            Err(why) => {
                log::warn!("no headset: {why:#}");
                Display::Window
            }
        },
        flat => flat,
    };
    options.check_flat()?;
    // What may be missing on this machine comes before anybody is kept waiting.
    let screen = match shown {
        Display::None => None,
        _ => Some((device.gpu()?, device.runtime()?)),
    };
    let window = match shown {
        Display::Window => Some(window::events(
            "give --display offscreen for pictures on disk",
        )),
        _ => None,
    };
    let (shown, mut events) = match window {
        Some(Ok(events)) => (Display::Window, Some(events)),
        Some(Err(why)) if options.display == Display::Auto => {
            log::warn!("no window: {why:#}");
            (Display::Offscreen, None)
        }
        Some(Err(why)) => return Err(why),
        None => (shown, None),
    };
    if shown == Display::Offscreen {
        make_folder(&options.folder())?;
    }
    let gaze = (options.gaze.as_ref())
        .map(|gaze| gaze.open(shown.sight()))
        .transpose()?;
    let room = options.rooms.first().context("there is no link")?;
    let network = Network::start()?;
    let client = options.trust.client()?;
    let clock = Clock::start();
    let stop = network.stop_on_signal();
    let Some(mut announced) = network.block_on(wait_for_sender(&client, room, &stop))? else {
        return Ok(());
    };
    loop {
        let package = fetch(&network, &client, room, &announced)?;
        let (avatar, figures) = load_avatar(&package.path)?;
        let prepared = match &screen {
            Some((gpu, runtime)) => Some(options.prepare(gpu, runtime, &avatar)?),
            None => None,
        };
        let viewer = network.block_on(async { Viewer::join(client.clone(), room.clone(), clock) });
        let until = Until {
            stop: Arc::clone(&stop),
            deadline: options.seconds.map(|seconds| Instant::now() + seconds),
        };
        let mut call = Call::new(viewer, announced, &avatar.skeleton, clock);
        let (mut call, watched) = match (prepared, events.take()) {
            (None, _) => {
                undrawn::run(&mut call, &until);
                (call, None)
            }
            (Some(prepared), events) => {
                // Pictures on disk are as good as they can be; a window's are to come in time.
                let hold = match events {
                    Some(_) => QualityMode::Adapt,
                    None => QualityMode::Fixed(0),
                };
                let mut screen = Screen::new(
                    &options.scenery,
                    prepared.show(call, HERTZ, hold)?,
                    gaze.clone(),
                );
                match events {
                    Some(events) => window::show(events, &mut screen, options.camera, &until)?,
                    None => offscreen::run(&mut screen, options, &until)?,
                }
                screen.finish()?
            }
        };
        let end = call.end();
        let report = Report::new(figures, &package, call.figures(), watched);
        network.block_on(call.hang_up());
        match end {
            Some(CallEnd::AnotherAvatar(another)) if shown != Display::Window => {
                println!("the sender has come back as somebody else");
                announced = another;
            }
            Some(CallEnd::Failed(error)) => return Err(error).context("the call ended"),
            Some(CallEnd::AnotherAvatar(_)) => {
                bail!("the sender has come back as somebody else: join again to see them")
            }
            Some(CallEnd::HungUp) | None => {
                report.print();
                return write_json(options.json.as_deref(), &report);
            }
        }
    }
}

impl Options {
    /// The folder for pictures.
    fn folder(&self) -> PathBuf {
        let asked = self.out.clone();
        asked.unwrap_or_else(|| "out/call".into())
    }

    /// Refuses what only a headset shows.
    fn check_flat(&self) -> anyhow::Result<()> {
        let mut several = self.rooms.iter().skip(1);
        let what = match (several.next(), self.frames, self.seat) {
            (Some(_), ..) => "several people in one room",
            (_, Some(_), _) => "--frames",
            (.., true) => "--seat",
            _ => return Ok(()),
        };
        bail!("{what} needs a headset: give --display xr");
    }

    fn prepare(
        &self,
        gpu: &Arc<Gpu>,
        runtime: &Runtime,
        avatar: &Arc<Avatar>,
    ) -> anyhow::Result<PreparedView> {
        let setting = RenderSettings {
            size: self.size.unwrap_or(DEFAULT_SIZE),
            views: if self.stereo {
                Views::Stereo
            } else {
                Views::Mono
            },
            background: None,
            filter: Filter::Dilation,
        };
        PreparedView::new(gpu, runtime, avatar, setting, &self.camera, self.lanes)
    }
}

/// Asks until the sender is in the room, and says what it waits for; nothing if it is time to leave before.
pub(crate) async fn wait_for_sender(
    client: &Client,
    room: &RoomLink,
    stop: &AtomicBool,
) -> anyhow::Result<Option<Announcement>> {
    let told = |waiting: &Waiting| match waiting {
        Waiting::ForSender => println!("waiting for the sender"),
        Waiting::Trouble(why) => log::warn!("{why}; trying again until Ctrl-C"),
    };
    app_session::visit::wait_for_sender(client, room, || stop.load(Relaxed), told)
        .await
        .context("cannot join the room")
}

/// The avatar's package on this machine.
#[derive(Debug)]
pub(crate) struct Fetched {
    pub(crate) path: PathBuf,
    pub(crate) seconds: f64,
    pub(crate) downloaded: u64,
}

fn fetch(
    network: &Network,
    client: &Client,
    room: &RoomLink,
    announced: &Announcement,
) -> anyhow::Result<Fetched> {
    let begun = Instant::now();
    let packages = PackageCache::new(cache()?.join("packages"))?;
    let bar = progress::bytes("fetching the avatar");
    let mut downloaded = 0;
    let path = network.block_on(
        client.fetch_package(room, &announced.avatar, &packages, |step| {
            downloaded = step.downloaded;
            bar.show(step.done, step.total);
        }),
    );
    bar.finish();
    Ok(Fetched {
        path: path.context("cannot fetch the avatar")?,
        seconds: begun.elapsed().as_secs_f64(),
        downloaded,
    })
}
