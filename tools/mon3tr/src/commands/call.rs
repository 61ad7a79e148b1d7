//! `mon3tr call`: both ways at once, `send` and `receive` as one.

use crate::commands::{receive, send};
use crate::device_options::DeviceOptions;
use crate::network::{self, Line};
use crate::report::{check_writable, write_json};
use crate::until::SetAtEnd;
use anyhow::{Context, anyhow};
use app_session::headset::WearerSlot;
use link_protocol::room_link::ServerUrl;
use link_protocol::{CallLink, RoomLink};
use motion_fit::wearer::Stance;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Duration;

/// Options of `call`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The link that the first one in was told; without one, this is the first one in, and the link is printed
    #[arg(value_name = "LINK", conflicts_with = "server")]
    link: Option<String>,
    #[command(flatten)]
    person: send::PersonOptions,
    #[command(flatten)]
    host: send::HostOptions,
    #[command(flatten)]
    show: receive::ShowOptions,
    /// Hang up so many seconds after the other one is there [default: when the other one does, or on Ctrl-C]
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
    /// Nothing where the other one did not come.
    received: Option<receive::Report>,
}

/// Runs `call`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    options.show.check()?;
    let line = Line::open(&options.trust)?;
    let mut host = options.host.clone();
    let (own, theirs) = match &options.link {
        Some(link) => {
            // Not by the command line's own parser, which repeats what it refuses: it has tokens.
            let link: CallLink = link.parse()?;
            (link.own().clone(), link.theirs().clone())
        }
        None => {
            // Also to put the avatar there.
            let token = host.owner_token()?;
            host.owner_token = Some(token.clone());
            open_rooms(host.server(), &token, &line)?
        }
    };
    let receiving = receive::Options {
        rooms: vec![theirs],
        frames: None,
        seconds: options.seconds,
        show: options.show.clone(),
        trust: options.trust.clone(),
        json: None,
    };
    let sending = send::Options {
        person: options.person.clone(),
        host,
        room: Some(own),
        preview: false,
        seconds: None,
        trust: options.trust.clone(),
        json: None,
    };
    // A window's events come to this thread only.
    let mut screen = receive::Screen::open(&receiving, device)?;
    let (performer, wearer) = performer(&sending.person, &receiving, &mut screen, device)?;
    let (sent, shown) = std::thread::scope(|scope| {
        let sent = scope.spawn(|| {
            let _over = SetAtEnd(&line.stop);
            send::perform(&sending, performer, None, &line)
        });
        let shown = {
            let _over = SetAtEnd(&line.stop);
            receive::show(&receiving, screen, &line)
        };
        if let Some(wearer) = wearer {
            wearer.close();
        }
        (sent.join(), shown)
    });
    let sent = sent.map_err(|_| anyhow!("the thread that sends has failed"))??;
    let (received, outcome) = shown?;
    sent.print();
    if let Some(received) = &received {
        received.print();
    }
    write_json(options.json.as_deref(), &Report { sent, received })?;
    outcome
}

/// Who is sent: what was asked for, else the headset's wearer where this is shown in one, whose places come by the slot.
fn performer(
    person: &send::PersonOptions,
    receiving: &receive::Options,
    screen: &mut receive::Screen,
    device: &DeviceOptions,
) -> anyhow::Result<(send::Performer, Option<WearerSlot>)> {
    let free = person.leaves_motion_open();
    let Some(slot) = free.then(|| screen.watch_wearer()).flatten() else {
        return Ok((send::Performer::open(person, None, device)?, None));
    };
    let stance = if receiving.show.seat {
        Stance::Seated
    } else {
        Stance::Standing
    };
    let performer = send::Performer::wearer(person, slot.clone(), stance)?;
    Ok((performer, Some(slot)))
}

/// Opens both rooms and prints the link for the other one. Returns the room to be present in, by its sender's link, and the other one's, by its
/// viewers'.
fn open_rooms(
    server: &ServerUrl,
    token: &str,
    line: &Line,
) -> anyhow::Result<(RoomLink, RoomLink)> {
    let open = || {
        let opened = line.client.open_room(server, token, None);
        let opened = line.network.block_on(opened);
        opened.context("cannot open a room")
    };
    let (own, theirs) = (open()?, open()?);
    let link = CallLink::of(own.viewer, theirs.sender)?;
    println!("the other one joins with\n  mon3tr call '{link}'");
    if server.is_loopback() {
        println!(
            "(on this machine only: give call the server's own address with --server for a link that works elsewhere)"
        );
    }
    Ok((own.sender, theirs.viewer))
}
