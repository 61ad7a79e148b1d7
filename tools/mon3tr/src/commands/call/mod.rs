//! `mon3tr call`: up to eight people see and hear one another, by one link.

use crate::commands::receive::people::{Arrival, Person, fetch};
use crate::commands::{receive, send};
use crate::controls::{Controls, KEYS, LONGEST_WORD, Others};
use crate::device_options::DeviceOptions;
use crate::doorkeeper::{Doorkeeper, door_of_call};
use crate::keys;
use crate::network::{self, Line};
use crate::remembered::Remembered;
use crate::report::{check_writable, write_json};
use crate::secret_argument::SecretArgument;
use crate::stills::load_others_avatar;
use crate::typed::take_lines;
use crate::viewpoint::Viewpoint;
use anyhow::{Context, anyhow};
use app_session::SetAtEnd;
use app_session::call::CallWatch;
use app_session::own_motion::OwnMotion;
use app_session::participant::{NetworkContext, Origin, Participant};
use call_member::{Acquaintances, Members, Roster, RosterFigures};
use link_protocol::limits::MAX_PEOPLE;
use link_protocol::{Announcement, CallLink, PersonName, RoomLink};
use link_voice::VoiceQueue;
use motion_fit::wearer::Stance;
use sender::{Desk, Place, new_secret};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Options of `call`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The link that the first one in was told, the same for everyone: @FILE reads it from a file, - from standard
    /// input. Without one, this is the first one in, and the link is printed
    #[arg(value_name = "LINK", conflicts_with = "server")]
    link: Option<SecretArgument>,
    /// What the others read that you are called [default: as in the last call, or your seat's number]
    #[arg(long, value_name = "NAME")]
    name: Option<PersonName>,
    #[command(flatten)]
    person: send::PersonOptions,
    #[command(flatten)]
    host: send::HostOptions,
    #[command(flatten)]
    show: receive::ShowOptions,
    /// Be heard only while the space bar is held in the window (`m` on the terminal does it too)
    #[arg(long)]
    push_to_talk: bool,
    /// Ask about each other member, who waits until you let them in
    #[arg(long)]
    ask: bool,
    /// How many people may join a call that is opened now from one network address, which all behind one router share
    /// [default: 3]
    #[arg(long, value_name = "N", conflicts_with = "link", value_parser = clap::value_parser!(u8).range(1..=MAX_PEOPLE as i64))]
    seats_per_address: Option<u8>,
    /// Hang up so many seconds after the first other one is there [default: on q, on Ctrl-C, or when the window is closed]
    #[arg(long, value_name = "SECONDS", value_parser = network::parse_seconds)]
    seconds: Option<Duration>,
    #[command(flatten)]
    trust: network::Trust,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What was measured both ways.
#[derive(Serialize)]
struct Report {
    sent: send::Report,
    /// Nothing where no other one came.
    received: Option<receive::Report>,
    joining: Joining,
}

/// How long it took from the command's start until the others were there.
#[derive(Debug, Clone, Copy, Serialize)]
struct Joining {
    /// Until this side sat in the call, seconds: the avatar loaded, and put into the store if it was not there.
    seated_s: f64,
    /// From then until the first of the others had their avatar here.
    first_member_s: Option<f64>,
    /// From when the first of the others had their avatar here until the first picture of them.
    first_picture_s: Option<f64>,
    /// The same until the first sound of them.
    first_sound_s: Option<f64>,
}

/// People who are reported on at the end, the newest: they may come and go without end.
const MOST_ARRIVALS: usize = 64;

/// Runs `call`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    let begun = Instant::now();
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let mut show = options.show.clone();
    // People who talk face one another.
    show.view.get_or_insert(Viewpoint::FRONT);
    let mut person = options.person.clone();
    show.sound.tell(person.voice.cancel_echo());
    show.check_in_call()?;
    let (me, avatar) = options.me()?;
    let line = Line::open(&options.trust)?;
    let given = options.link.as_ref();
    let given: Option<CallLink> = given.map(|link| link.parse("call's link")).transpose()?;
    if let Some(link) = &given {
        network::warn_if_unproved(link.has_secret(), link.key().is_some());
    }
    // A window's events come to this thread only.
    let mut screen = receive::Screen::open(&show, device)?;
    let own = OwnMotion::default();
    // Where nothing else was asked for, a headset's wearer is sent.
    let wearer = person.leaves_motion_open().then(|| screen.watch_wearer());
    let wearer = wearer.flatten();
    let mut performer = match &wearer {
        Some(slot) => {
            let stance = if show.seat {
                Stance::Seated
            } else {
                Stance::Standing
            };
            send::Performer::wearer(&person, &avatar, slot.clone(), stance)?
        }
        None => send::Performer::open(&person, &avatar, None, device)?,
    };
    performer.mirror(&own);
    let credentials = keys::of_sender(&performer.avatar)?;
    let link = match &given {
        Some(link) => link.clone(),
        None => options
            .open_call(&line)?
            .with_key(credentials.key().hash())
            .with_secret(new_secret()?),
    };
    let place = Place::Call {
        link: link.clone(),
        name: me.name.clone(),
    };
    let desk = Desk {
        door: door_of_call(link.call(), options.ask)?,
        ..person.desk(place, &avatar, performer.rate_hz, credentials.clone())
    };
    let entered = send::enter(&desk, &line)?;
    let keeper = Doorkeeper::new(
        desk.door.clone(),
        entered.host.venue(),
        Some(link.call()),
        credentials.clone(),
        &line,
    );
    let keeper = Arc::new(keeper);
    me.keep();
    let seated = Instant::now();
    if given.is_none() {
        print_link(&link);
    }
    println!("you are in the call; {KEYS}");
    if me.name.is_none() {
        println!(
            "you have no name: others read the number of your place; --name NAME gives you one"
        );
    }
    if options.push_to_talk {
        println!("you are muted: hold the space bar in the window to talk, or type m here");
    }

    let voices: Vec<_> = (0..MAX_PEOPLE).map(|_| VoiceQueue::default()).collect();
    let members = Members::default();
    let controls = Controls {
        privacy: entered.host.privacy(),
        members: members.clone(),
        door: desk.door.clone(),
        clock: line.clock,
        own: own.clone(),
        stop: Arc::clone(&line.stop),
        push_to_talk: options.push_to_talk,
    };
    controls.hold_to_talk(false);
    let context = NetworkContext {
        network: line.network.handle(),
        client: line.client.clone(),
        own: Some(credentials),
        clock: line.clock,
    };
    let roster = Roster {
        link,
        own: entered.host.venue(),
        voices: voices.clone(),
        members: members.clone(),
        acquaintances: Acquaintances::open(keys::people_met()?),
        offers: entered.host.offers(),
        door: desk.door.clone(),
        longest: options.seconds,
        network: &context,
        stop: &line.stop,
        tell: &|line| println!("{line}"),
    };
    let (steered, kept) = (controls.clone(), Arc::clone(&keeper));
    std::thread::Builder::new()
        .name("keys".to_owned())
        // It ends with the process: nothing ends a read of the terminal.
        .spawn(move || {
            take_lines(std::io::stdin().lock(), LONGEST_WORD, |line| {
                if !kept.obey_in_call(line, &steered.keys()) {
                    steered.obey(line);
                }
            });
        })
        .context("cannot start a thread for the keys")?;
    let sound = show.sound.begin(&voices, line.clock)?;
    let came = Mutex::new(Vec::new());
    let name_of = |watch: &CallWatch| {
        let all = members.all().into_iter();
        let theirs = all.filter(|member| member.watch.is_same(watch));
        theirs.map(|member| member.name).next()
    };
    let (admit, newcomers) = channel();
    let others = Others {
        newcomers,
        controls,
    };
    let sits = show.seat;
    let own = Participant {
        avatar: Arc::clone(&performer.avatar),
        sits,
        origin: Origin::Own(own),
    };
    let (sent, shown, figures) = std::thread::scope(|scope| {
        let sent = scope.spawn(|| {
            let _over = SetAtEnd(&line.stop);
            send::perform(&desk, entered.host, performer, None, &line, &keeper)
        });
        let figures = scope.spawn(|| {
            let _over = SetAtEnd(&line.stop);
            let fetched = |room: &RoomLink, announced: &Announcement, watch: &CallWatch| {
                let is_over = || line.stop.load(Relaxed) || watch.is_over();
                let fetched = fetch(&line.network, &line.client, room, announced, &is_over)?;
                fetched
                    .map(|(path, download)| Ok((load_others_avatar(&path)?, download)))
                    .transpose()
            };
            roster.follow(fetched, |newcomer| {
                let ((avatar, figures), download) = newcomer.avatar;
                let person = Person {
                    room: newcomer.room,
                    announced: newcomer.announced,
                    avatar,
                    arrival: Arrival {
                        name: name_of(&newcomer.watch),
                        figures,
                        download,
                        watch: newcomer.watch,
                    },
                    voice: newcomer.voice,
                };
                let mut came = came.lock().unwrap_or_else(PoisonError::into_inner);
                if came.len() == MOST_ARRIVALS {
                    // The first of those who have left.
                    let left = came.iter().position(|it: &Arrival| it.watch.is_over());
                    came.remove(left.unwrap_or(0));
                }
                let participant = person.participant(sits, &context);
                came.push(person.arrival);
                admit.send(participant).is_ok()
            })
        });
        let shown = {
            let _over = SetAtEnd(&line.stop);
            let _unworn = wearer.as_ref().map(|slot| slot.close_at_end());
            screen.show_call(&show, own, others, &line.stop)
        };
        (sent.join(), shown, figures.join())
    });
    let figures = figures.map_err(|_| anyhow!("the thread of the roster has failed"))?;
    let sent = sent.map_err(|_| anyhow!("the thread that sends has failed"))??;
    let shown = shown?;
    sound.end()?;
    sent.print();
    let joining = Joining::new(begun, seated, &figures, shown.first_picture());
    let came = came.into_inner().unwrap_or_else(PoisonError::into_inner);
    let (received, outcome) = receive::Report::new(&came, shown);
    match &received {
        // Every table of every person is more than is read: `--json` has them.
        Some(received) if log::log_enabled!(log::Level::Info) => received.print(),
        Some(received) => received.print_people(),
        None => println!("no one else came"),
    }
    joining.print();
    let report = Report {
        sent,
        received,
        joining,
    };
    write_json(options.json.as_deref(), &report)?;
    outcome
}

impl Options {
    /// Who this is, by options or as in the last call, and the avatar's package.
    fn me(&self) -> anyhow::Result<(Remembered, PathBuf)> {
        let last = Remembered::load();
        let avatar = match &self.person.avatar {
            // By itself, for the next call may begin in another folder.
            Some(avatar) => std::path::absolute(avatar)
                .with_context(|| format!("cannot find {}", avatar.display()))?,
            None => last.avatar.context(
                "no avatar: give --avatar PACKAGE, which is remembered; `mon3tr bake` makes one to begin with",
            )?,
        };
        let me = Remembered {
            avatar: Some(avatar.clone()),
            name: self.name.clone().or(last.name),
        };
        Ok((me, avatar))
    }

    fn open_call(&self, line: &Line) -> anyhow::Result<CallLink> {
        let token = self.host.owner_token()?;
        let (server, seats) = (self.host.server(), self.seats_per_address);
        let opened = line.client.open_call(server, &token, None, seats);
        line.network.block_on(opened).context("cannot open a call")
    }
}

fn print_link(link: &CallLink) {
    println!("others join with\n  mon3tr call '{link}'");
    if link.server().is_loopback() {
        println!(
            "(on this machine only: give call the server's own address with --server for a link that works elsewhere)"
        );
    }
}

impl Joining {
    fn new(
        begun: Instant,
        seated: Instant,
        figures: &RosterFigures,
        first_picture: Option<Instant>,
    ) -> Self {
        let since =
            |from: Instant| move |to: Instant| to.saturating_duration_since(from).as_secs_f64();
        let from_member = |to: Option<Instant>| {
            let from = figures.first_member?;
            to.map(since(from))
        };
        Self {
            seated_s: since(begun)(seated),
            first_member_s: figures.first_member.map(since(seated)),
            first_picture_s: from_member(first_picture),
            first_sound_s: from_member(figures.first_sound),
        }
    }

    fn print(&self) {
        let told = |what: &str, seconds: Option<f64>| {
            seconds.map(|seconds| format!("{what} {seconds:.2} s later"))
        };
        let parts: Vec<String> = [
            Some(format!("in the call after {:.2} s", self.seated_s)),
            told("the first of the others was there", self.first_member_s),
            told("their first picture", self.first_picture_s),
            told("their first sound", self.first_sound_s),
        ]
        .into_iter()
        .flatten()
        .collect();
        println!("{}", parts.join("; "));
    }
}
