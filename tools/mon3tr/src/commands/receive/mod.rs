//! `mon3tr receive`: joins rooms, fetches each avatar once, and shows the people who are there.

mod album;
mod offscreen;
pub(crate) mod people;
mod report;
mod samples;
mod screen;
mod undrawn;

pub(crate) use people::wait_for_sender;

use crate::device_options::DeviceOptions;
use crate::gaze::GazeChoice;
use crate::keys;
use crate::lanes::LaneChoices;
use crate::network::{self, Line};
use crate::report::{check_writable, write_json};
use crate::scenery::SceneryOptions;
use crate::secret_argument::SecretArgument;
use crate::size::{Size, Views};
use crate::sound::{Sound, SoundOptions};
use crate::until::Until;
use crate::viewpoint::Viewpoint;
use anyhow::bail;
use app_session::participant::NetworkContext;
use call_member::GazeFeed;
use clap::ValueEnum;
use link_protocol::RoomLink;
use link_voice::VoiceQueue;
pub(crate) use report::Report;
use samples::Samples;
use screen::NO_PICTURES;
pub(crate) use screen::Screen;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// Options of `receive`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The viewers' link, as `send` prints it: @FILE reads it from a file, - from standard input. Of several rooms, 7
    /// at most, the people are shown together
    #[arg(value_name = "LINK", required = true)]
    rooms: Vec<SecretArgument>,
    /// Leave after so many pictures
    #[arg(long, value_name = "N")]
    pub(crate) frames: Option<u64>,
    /// Leave so many seconds after joining [default: when the sender hangs up, or on Ctrl-C]
    #[arg(long, value_name = "SECONDS", value_parser = network::parse_seconds)]
    pub(crate) seconds: Option<Duration>,
    #[command(flatten)]
    pub(crate) show: ShowOptions,
    #[command(flatten)]
    pub(crate) trust: network::Trust,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write how it goes meanwhile: every 2 s a line of JSON, of the first person's pictures and their latency, what came and what did not,
    /// and the device's memory
    #[arg(long, value_name = "FILE")]
    samples: Option<PathBuf>,
}

/// How people are shown and heard.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct ShowOptions {
    /// Where people are shown: in a headset (xr), in a window, offscreen as pictures on disk, in the first of these that there
    /// is (auto), or not at all (none), to measure the network alone
    #[arg(long, value_name = "WHERE", default_value = "window")]
    display: Display,
    /// Folder for the pictures of `--display offscreen`, made if missing; with `--display xr` pictures of both eyes are kept if
    /// it is given [default: out/call]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Have people sit, on a chair of 0.45 m
    #[arg(long)]
    pub(crate) seat: bool,
    /// Size of one picture in pixels, or of the window at first [default: 1024x1024, or what the headset recommends]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Both eyes' views
    #[arg(long)]
    stereo: bool,
    /// Where people are seen from: front, three-quarter, side, back, waist-up, face, hands, or EYE:TARGET:FOV in metres and
    /// degrees relative to the person, e.g. 0,1.6,2:0,1.4,0:30 [default: three-quarter, and front in a call both ways]
    #[arg(long, value_name = "VIEW", allow_hyphen_values = true)]
    pub(crate) view: Option<Viewpoint>,
    /// Let the camera follow a gaze, within 25 degrees around the person: `mouse` for the mouse in the window, a file of an eye
    /// tracker's samples, lines of `seconds,x,y` or {"seconds":S,"x":X,"y":Y}, seconds from the first picture, x (to the right) and y (down) from 0 to 1;
    /// or such lines as they come, from standard input (`-`, not in `call`) or by UDP (`udp:PORT`, or `udp:0.0.0.0:PORT` from other machines). A headset's
    /// --gaze-to sends lines {"seconds":S,"eye":[X,Y,Z],"towards":[X,Y,Z]}: with them the camera is where its wearer is, and looks where they look
    #[arg(long, value_name = "mouse|FILE|-|udp:PORT")]
    gaze: Option<GazeChoice>,
    /// With a headset, and not in `call`: send where its wearer is and looks to the --gaze of a second screen, as JSON lines by UDP, unencrypted
    #[arg(long, value_name = "HOST:PORT", value_parser = GazeFeed::resolve)]
    gaze_to: Option<SocketAddr>,
    #[command(flatten)]
    pub(crate) sound: SoundOptions,
    #[command(flatten)]
    lanes: LaneChoices,
    #[command(flatten)]
    scenery: SceneryOptions,
}

impl Options {
    /// That nothing is asked for which only pictures have, where there are none.
    fn check(&self) -> anyhow::Result<()> {
        let what = match (self.show.display, self.rooms.len(), self.frames) {
            (Display::None, 2.., _) => "several links",
            (Display::None, _, Some(_)) => "--frames",
            (Display::None, _, _) if self.samples.is_some() => "--samples",
            _ => return Ok(()),
        };
        bail!("--display none {NO_PICTURES}, and {what} is for pictures: leave one of them out")
    }
}

impl ShowOptions {
    /// What can be said without a call.
    ///
    /// # Errors
    /// If options contradict one another, or a file cannot be written.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        self.scenery.check()?;
        if self.gaze_to.is_some() && !matches!(self.display, Display::Auto | Display::Xr) {
            bail!(
                "--gaze-to sends where a headset's wearer looks: give --display xr, or leave it out"
            );
        }
        self.sound.file().map_or(Ok(()), check_writable)
    }

    /// [`Self::check`] in a call both ways.
    ///
    /// # Errors
    /// As there, and if a gaze cannot come or go in such a call.
    pub(crate) fn check_in_call(&self) -> anyhow::Result<()> {
        self.check()?;
        if self.gaze_to.is_some() {
            bail!(
                "--gaze-to is for `receive`: in a call everyone has other people before them, and a second screen would stand elsewhere"
            );
        }
        let typed =
            |gaze: &GazeChoice| gaze.check_no_stdin("that is where a call's keys are typed");
        self.gaze.as_ref().map_or(Ok(()), typed)
    }
}

/// Where people are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Display {
    Auto,
    Xr,
    Window,
    Offscreen,
    None,
}

/// Runs `receive`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    for file in [&options.json, &options.samples].into_iter().flatten() {
        check_writable(file)?;
    }
    options.show.check()?;
    // What may be missing on this machine comes before any wait.
    options.check()?;
    let rooms = options.rooms.iter().map(|link| link.parse("room's link"));
    let rooms: Vec<RoomLink> = rooms.collect::<anyhow::Result<_>>()?;
    let screen = Screen::open(&options.show, device)?;
    let line = Line::open(&options.trust)?;
    let (report, outcome) = show(options, &rooms, screen, &line)?;
    if let Some(report) = report {
        report.print();
        write_json(options.json.as_deref(), &report)?;
    }
    outcome
}

/// Shows the people of the rooms until it is over. Returns what was measured, where anyone came, and whether it came to a good end.
///
/// # Errors
/// If they cannot be shown.
fn show(
    options: &Options,
    rooms: &[RoomLink],
    mut screen: Screen,
    line: &Line,
) -> anyhow::Result<(Option<Report>, anyhow::Result<()>)> {
    for room in rooms {
        line.check_protection(room.server())?;
        network::warn_if_unproved(room.secret().is_some(), room.key().is_some());
    }
    let context = NetworkContext {
        network: line.network.handle(),
        client: line.client.clone(),
        own: keys::of_viewer(),
        clock: line.clock,
    };
    // Of the people, in the order of their rooms; they stay the same where one comes back.
    let voices: Vec<VoiceQueue> = rooms.iter().map(|_| VoiceQueue::default()).collect();
    let samples = options.samples.as_deref();
    let mut samples = samples.map(Samples::create).transpose()?;
    let mut sound = None;
    let mut again = None;
    loop {
        let gathered = people::gather(rooms, line, again, &voices)?;
        let Some(people) = gathered else {
            return Ok((None, Ok(())));
        };
        let until = Until::new(&line.stop, options.seconds, options.frames);
        if sound.is_none() {
            sound = Some(options.show.sound.begin(&voices, line.clock)?);
        }
        let shown = screen.show(&options.show, &people, &context, samples.as_mut(), &until)?;
        if let (true, Some(announced)) = (screen.can_go_on(), shown.came_back()) {
            println!("the sender has come back with another avatar");
            again = Some(announced);
            continue;
        }
        let arrivals: Vec<_> = people.into_iter().map(|person| person.arrival).collect();
        sound.map_or(Ok(()), Sound::end)?;
        return Ok(Report::new(&arrivals, shown));
    }
}

impl ShowOptions {
    /// The folder for pictures.
    fn folder(&self) -> PathBuf {
        let asked = self.out.clone();
        asked.unwrap_or_else(|| "out/call".into())
    }

    fn viewpoint(&self) -> Viewpoint {
        self.view.unwrap_or(Viewpoint::THREE_QUARTER)
    }

    fn views(&self) -> Views {
        if self.stereo {
            Views::Stereo
        } else {
            Views::Mono
        }
    }
}
