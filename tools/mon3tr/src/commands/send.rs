//! `mon3tr send`: the motion that a camera captures, or one from a file as if it were captured now, to everyone who joins the room.

use crate::camera::{CameraCapture, CameraFigures, CameraOptions, OpenCamera};
use crate::commands::send_memory::{SenderMemory, Watched};
use crate::device_options::DeviceOptions;
use crate::doorkeeper::{DoorOptions, Doorkeeper};
use crate::ending;
use crate::keys;
use crate::network::{self, Line};
use crate::owner_token::OwnerToken;
use crate::performance::MotionOptions;
use crate::preview::Preview;
use crate::progress;
use crate::report::{check_writable, write_json};
use crate::secret_argument::SecretArgument;
use crate::stills::load_avatar;
use crate::voice_options::VoiceOptions;
use anyhow::{Context, bail};
use app_session::SetAtEnd;
use app_session::headset::WearerSlot;
use app_session::own_motion::OwnMotion;
use call_member::{Performance, WEARER_RATE, WearerCapture};
use link_call::sender::SenderStatistics;
use link_call::{Credentials, Door, Sender};
use link_codec::Codec;
use link_protocol::RoomLink;
use link_protocol::announcement::ChannelMode;
use link_protocol::room_link::ServerUrl;
use motion_fit::wearer::Stance;
use sender::{Capture, ClipCapture, Desk, Entered, Place, VoiceSource};
use serde::Serialize;
use spmm3::Avatar;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Motion rates a sender may have.
const RATES: std::ops::RangeInclusive<f64> = 1.0..=120.0;

/// Motions a second of a camera that does not say its rate.
const CAMERA_RATE: f64 = 30.0;

/// Between two lines about how many viewers there are, at least.
const TOLD_APART: Duration = Duration::from_secs(2);

/// Between two looks whether the first viewer has come.
const LOOK: Duration = Duration::from_millis(5);

/// Options of `send`.
#[derive(Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    pub(crate) person: PersonOptions,
    #[command(flatten)]
    pub(crate) host: HostOptions,
    /// The sender's link of a room that is open already, as `send` prints it: @FILE reads it from a file, - from
    /// standard input
    #[arg(long, value_name = "@FILE|-|LINK", conflicts_with = "server")]
    pub(crate) room: Option<SecretArgument>,
    /// Show, in a window, the camera's picture with what is seen in it, and the avatar that follows: mirrored, as one expects of a picture
    /// of oneself. It is there before the first viewer comes; Escape closes it, and the call goes on
    #[arg(long, requires = "camera")]
    pub(crate) preview: bool,
    /// Leave so many seconds after the first viewer has come [default: on Ctrl-C]
    #[arg(long, value_name = "SECONDS", value_parser = network::parse_seconds)]
    pub(crate) seconds: Option<Duration>,
    #[command(flatten)]
    pub(crate) door: DoorOptions,
    /// How long the links of a room that is opened now are good [default: a day; at most as the server allows]
    #[arg(long, value_name = "HOURS", conflicts_with = "room", value_parser = clap::value_parser!(u64).range(1..=720))]
    pub(crate) link_hours: Option<u64>,
    #[command(flatten)]
    pub(crate) trust: network::Trust,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// Who is sent, and how.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct PersonOptions {
    /// The avatar's package; put into the server's store if it is not there
    #[arg(long, value_name = "PACKAGE")]
    pub(crate) avatar: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionOptions,
    #[command(flatten)]
    camera: CameraOptions,
    #[command(flatten)]
    pub(super) voice: VoiceOptions,
    /// Motions a second; a camera has its own rate
    #[arg(long, value_name = "HZ", default_value = "30", conflicts_with = "camera", value_parser = parse_rate)]
    rate: f64,
    /// How frames are written: compact (quantised, predicted, entropy coded) or paper (FP16 and LZ4)
    #[arg(long, value_name = "CODEC", default_value = "compact")]
    codec: Codec,
    /// What becomes of lost frames: unreliable (they stay lost) or reliable (as in the paper: everything waits for them)
    #[arg(long, value_name = "MODE", default_value = "unreliable")]
    channel: ChannelMode,
}

/// The server, and the right to open rooms there.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct HostOptions {
    /// The server on which to open a room
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:8080")]
    server: ServerUrl,
    #[command(flatten)]
    token: OwnerToken,
}

/// What the command measured.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    motion: String,
    codec: Codec,
    channel: ChannelMode,
    rate_hz: f64,
    seconds: f64,
    /// What the stages of capturing took, where a camera does.
    camera: Option<CameraFigures>,
    memory: SenderMemory,
    #[serde(flatten)]
    sent: SenderStatistics,
}

/// Runs `send`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let preview = (options.preview.then(|| Preview::open(device))).transpose()?;
    let avatar = options.person.avatar()?;
    let performer = Performer::open(&options.person, avatar, options.seconds, device)?;
    let credentials = keys::of_sender(&performer.avatar)?;
    let line = Line::open(&options.trust)?;
    let room = options.room()?;
    let desk = Desk {
        door: options.door.door(room.as_ref())?,
        ..(options.person).desk(
            options.place(room)?,
            avatar,
            performer.rate_hz,
            credentials.clone(),
        )
    };
    let entered = enter(&desk, &line)?;
    let venue = entered.host.venue();
    let keeper = Arc::new(Doorkeeper::new(
        desk.door.clone(),
        venue,
        None,
        credentials,
        &line,
    ));
    if let Some(viewers) = &entered.viewers {
        if desk.door.rules().guests_only {
            println!("in the room.");
        } else {
            println!("in the room. Others join with\n  mon3tr receive '{viewers}'");
        }
        if viewers.server().is_loopback() {
            println!(
                "(on this machine only: give send the server's own address with --server for a link that works elsewhere)"
            );
        }
        println!(
            "and this sender comes back with --room '{}'",
            entered.host.venue().room()
        );
    }
    options.door.print_guests(&keeper)?;
    keeper.listen_to_terminal()?;
    let report = perform(&desk, entered.host, performer, preview, &line, &keeper)?;
    report.print();
    write_json(options.json.as_deref(), &report)
}

/// Uploads the avatar if need be, and enters.
///
/// # Errors
/// If there is no way in.
pub(crate) fn enter(desk: &Desk, line: &Line) -> anyhow::Result<Entered> {
    line.check_protection(desk.place.server())?;
    let bar = progress::bytes("uploading the avatar");
    let entered = line
        .network
        .block_on(sender::enter(&line.client, desk, line.clock, {
            let bar = bar.clone();
            move |done, total| bar.show(done, total)
        }));
    bar.finish();
    entered.context(match desk.place {
        Place::Call { .. } => "cannot enter the call",
        Place::Room { .. } | Place::Server { .. } => "cannot enter the room",
    })
}

/// Sends what `performer` does to whoever joins, until it is over.
///
/// # Errors
/// If motion or voice fail.
pub(crate) fn perform(
    desk: &Desk,
    host: Sender,
    performer: Performer,
    preview: Option<Preview>,
    line: &Line,
    keeper: &Doorkeeper,
) -> anyhow::Result<Report> {
    let Performer {
        avatar,
        mut motion,
        name,
        rate_hz,
        mut voice,
        own,
    } = performer;
    let Line {
        network,
        clock,
        stop,
        ..
    } = line;
    let clock = *clock;
    let shown = match (&preview, &mut motion) {
        (Some(preview), Motion::Camera(capture)) => {
            capture.show_in(preview.shots());
            Some(capture.camera())
        }
        _ => None,
    };
    let mut perform = || -> anyhow::Result<(Instant, Option<u64>)> {
        // A performance begins when a viewer is there, or one wants to see oneself.
        let is_seen =
            || host.statistics().viewers > 0 || own.as_ref().is_some_and(OwnMotion::is_seen);
        while !is_seen() && !stop.load(Relaxed) {
            match &mut motion {
                // Before that, people who see themselves move already, and those who are to calibrate do it.
                Motion::Camera(capture) if shown.is_some() || capture.is_calibrating() => {
                    if capture.track()?.is_none() {
                        bail!("{name} has ended before a viewer came");
                    }
                }
                _ => std::thread::sleep(LOOK),
            }
        }
        let begun = Instant::now();
        let mut watched = Watched::over(motion.capture());
        let performance = Performance {
            capture: &mut watched,
            expressions: &avatar.expressions,
            voice: match &mut voice {
                Some(voice) => Some(&mut **voice),
                None => None,
            },
            own: own.as_ref(),
        };
        performance.send(&host, clock, stop)?;
        ending::noticed();
        Ok((begun, watched.settled_bytes))
    };
    let over = AtomicBool::new(false);
    let performed = std::thread::scope(|scope| {
        let _over = SetAtEnd(&over);
        scope.spawn(|| keeper.watch(&over));
        // In a call of several the roster tells who comes and goes.
        if !keeper.is_of_call() {
            scope.spawn(|| tell_of_viewers(&host, &over));
        }
        match (preview, shown) {
            (Some(preview), Some(camera)) => preview.beside(&avatar, &camera, perform),
            _ => Ok(perform()),
        }
    })?;
    let settled = performed.as_ref().ok().and_then(|(_, settled)| *settled);
    let report = Report {
        motion: name,
        codec: desk.codec,
        channel: desk.channel,
        rate_hz,
        seconds: (performed.as_ref()).map_or(0.0, |(begun, _)| begun.elapsed().as_secs_f64()),
        camera: motion.figures(),
        memory: SenderMemory::at_the_end(settled),
        sent: network.block_on(host.hang_up()),
    };
    performed?;
    Ok(report)
}

/// Tells the performer by how many they are seen, as it changes, until it is over.
fn tell_of_viewers(host: &Sender, over: &AtomicBool) {
    let (mut told, mut next) = (0, Instant::now());
    let (mut told_watching, mut next_watching) = (0, Instant::now());
    while !over.load(Relaxed) {
        let SenderStatistics {
            viewers, watching, ..
        } = host.statistics();
        if watching != told_watching && Instant::now() >= next_watching {
            match watching {
                0 => println!("nobody watches through the server any longer"),
                1 => println!("one watches through the server"),
                _ => println!("{watching} watch through the server"),
            }
            (told_watching, next_watching) = (watching, Instant::now() + TOLD_APART);
        }
        if viewers != told && Instant::now() >= next {
            match viewers {
                0 => println!("nobody sees you any longer"),
                1 => println!("one viewer sees you"),
                _ => println!("{viewers} viewers see you"),
            }
            (told, next) = (viewers, Instant::now() + TOLD_APART);
        }
        std::thread::sleep(LOOK);
    }
}

/// Where the motion comes from.
enum Motion {
    Clip(ClipCapture),
    Camera(Box<CameraCapture>),
    Wearer(Box<WearerCapture>),
}

impl Motion {
    fn capture(&mut self) -> &mut dyn Capture {
        match self {
            Self::Clip(capture) => capture,
            Self::Camera(capture) => &mut **capture,
            Self::Wearer(capture) => &mut **capture,
        }
    }

    /// What the camera's stages took.
    fn figures(&self) -> Option<CameraFigures> {
        match self {
            Self::Clip(_) | Self::Wearer(_) => None,
            Self::Camera(capture) => Some(capture.figures()),
        }
    }
}

/// What is sent: a motion, and maybe a voice.
pub(crate) struct Performer {
    pub(crate) avatar: Arc<Avatar>,
    motion: Motion,
    /// What the motion is called.
    name: String,
    pub(crate) rate_hz: f64,
    voice: Option<Box<dyn VoiceSource>>,
    /// Where the motion is shown to oneself.
    own: Option<OwnMotion>,
}

impl Performer {
    /// What was asked for, for `length` or without end.
    ///
    /// # Errors
    /// If something of it is not there.
    pub(crate) fn open(
        options: &PersonOptions,
        avatar: &Path,
        length: Option<Duration>,
        device: &DeviceOptions,
    ) -> anyhow::Result<Self> {
        options.motion.check()?;
        let voice = options.voice.open()?;
        let (avatar, _) = load_avatar(avatar)?;
        let (motion, name, rate_hz) = options.motion(&avatar, length, device)?;
        Ok(Self {
            avatar,
            motion,
            name,
            rate_hz,
            voice,
            own: None,
        })
    }

    /// The wearer of the headset whose loop fills `slot`.
    ///
    /// # Errors
    /// If the avatar or the voice is not there.
    pub(crate) fn wearer(
        options: &PersonOptions,
        avatar: &Path,
        slot: WearerSlot,
        stance: Stance,
    ) -> anyhow::Result<Self> {
        let voice = options.voice.open()?;
        let (avatar, _) = load_avatar(avatar)?;
        let face = (&avatar.expression_basis, &avatar.expressions);
        let capture = WearerCapture::new(slot, &avatar.skeleton, face, stance);
        Ok(Self {
            motion: Motion::Wearer(Box::new(capture)),
            name: "the headset's wearer".to_owned(),
            rate_hz: WEARER_RATE,
            avatar,
            voice,
            own: None,
        })
    }

    /// Shows the motion to `own`, too.
    pub(crate) fn mirror(&mut self, own: &OwnMotion) {
        self.own = Some(own.clone());
    }
}

impl PersonOptions {
    /// The avatar's package.
    ///
    /// # Errors
    /// If none was given.
    pub(crate) fn avatar(&self) -> anyhow::Result<&Path> {
        let avatar = self.avatar.as_deref();
        avatar.context("no avatar: give --avatar PACKAGE; `mon3tr bake` makes one to begin with")
    }

    /// What is needed to enter a place as this person.
    pub(crate) fn desk(
        &self,
        place: Place,
        avatar: &Path,
        rate_hz: f64,
        credentials: Credentials,
    ) -> Desk {
        Desk {
            place,
            avatar: avatar.to_owned(),
            codec: self.codec,
            channel: self.channel,
            rate_hz,
            credentials: Some(credentials),
            door: Door::default(),
        }
    }

    /// Whether no motion was asked for, so that a headset's wearer may be sent.
    pub(crate) fn leaves_motion_open(&self) -> bool {
        self.camera.camera.is_none() && !self.motion.is_given()
    }

    /// The motion, what it is called, and its rate in Hz.
    fn motion(
        &self,
        avatar: &Arc<Avatar>,
        length: Option<Duration>,
        device: &DeviceOptions,
    ) -> anyhow::Result<(Motion, String, f64)> {
        let Some(choice) = &self.camera.camera else {
            let clip = self.motion.clip(avatar, self.rate)?;
            let name = clip.name.clone();
            let capture = ClipCapture::new(clip, self.rate, length);
            return Ok((Motion::Clip(capture), name, self.rate));
        };
        let open = OpenCamera::live(choice, &self.camera.capture, device)?;
        let capture = CameraCapture::new(open, avatar, length);
        let info = capture.source().info();
        let rate = info.rate_hz.unwrap_or(CAMERA_RATE);
        let (name, rate) = (info.name.clone(), rate.clamp(*RATES.start(), *RATES.end()));
        Ok((Motion::Camera(Box::new(capture)), name, rate))
    }
}

impl HostOptions {
    /// The server.
    pub(crate) fn server(&self) -> &ServerUrl {
        &self.server
    }

    /// The right to open rooms.
    ///
    /// # Errors
    /// As [`OwnerToken::of`].
    pub(crate) fn owner_token(&self) -> anyhow::Result<String> {
        self.token.of(&self.server)
    }
}

impl Options {
    /// The room that is open already, if one was given.
    fn room(&self) -> anyhow::Result<Option<RoomLink>> {
        let room = self.room.as_ref();
        room.map(|link| link.parse("room's link")).transpose()
    }

    fn place(&self, room: Option<RoomLink>) -> anyhow::Result<Place> {
        if let Some(link) = room {
            return Ok(Place::Room {
                link,
                owner_token: self.host.token.given()?,
            });
        }
        Ok(Place::Server {
            server: self.host.server.clone(),
            owner_token: self.host.owner_token()?,
            lifetime: (self.link_hours).map(|hours| Duration::from_secs(hours * 3600)),
        })
    }
}

impl Report {
    pub(crate) fn print(&self) {
        let sent = &self.sent;
        // Without a viewer, pictures are not looked at as a rule.
        let camera = self.camera.as_ref().filter(|camera| camera.pictures > 0);
        if let Some(camera) = camera {
            camera.print();
        }
        if sent.joined == 0 {
            println!("no viewer came: nothing was sent");
            return;
        }
        if let Some(latency_ms) = camera.and_then(|camera| camera.latency_ms) {
            let encode_ms = sent.encode_ns as f64 / 1e6 / sent.encoded.max(1) as f64;
            println!(
                "{:.1} motions a second; from the light to the packet {:.1} ms, the median with the mean of encoding",
                f64::from(sent.captured) / self.seconds.max(1e-3),
                latency_ms + encode_ms
            );
        }
        if let Some(line) = self.memory.line() {
            println!("{line}");
        }
        if sent.voice_sent > 0 {
            println!(
                "said {} packets of voice, {:.1} bytes each",
                sent.voice_sent,
                sent.voice_bytes as f64 / sent.voice_sent as f64
            );
        }
        println!(
            "captured {} frames in {:.1} s; to {} viewers {} were sent in all, and {} left out; {} on the {} channel: {:.1} bytes a frame",
            sent.captured,
            self.seconds,
            sent.joined,
            sent.sent,
            sent.skipped,
            self.codec,
            self.channel,
            sent.payload_bytes as f64 / (sent.sent.max(1)) as f64
        );
    }
}

/// A rate in Hz.
///
/// # Errors
/// If it is none that motion may be sent at.
pub fn parse_rate(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|rate| RATES.contains(rate))
        .ok_or_else(|| {
            format!(
                "{text} is not a rate of {}..{} motions a second",
                RATES.start(),
                RATES.end()
            )
        })
}
