//! `mon3tr-dev netlab`: real calls between real processes, over networks of any quality, all on this machine.

mod call;
mod condition;
mod download;
mod front;

use anyhow::{Context, ensure};
use call::{Bench, Variant};
use condition::Shape;
use link_codec::Codec;
use link_http::Client;
use link_protocol::announcement::ChannelMode;
use mon3tr::children::LocalServer;
use mon3tr::commands::send;
use mon3tr::device_options::make_folder;
use mon3tr::network::{self, Network};
use mon3tr::performance::MotionOptions;
use mon3tr::progress;
use mon3tr::report::check_writable;
use netlab::report::{Report, bitrate_chart, call_chart};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Options of `netlab`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The avatar's package: what the calls are about
    #[arg(long, value_name = "PACKAGE", required_unless_present = "before")]
    avatar: Option<PathBuf>,
    /// Hold the network in front of a server that runs, on its machine, until Ctrl-C, and hold no calls: viewers that take the address that is
    /// printed for the server's get the network
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with_all = ["avatar", "download"])]
    before: Option<SocketAddr>,
    #[command(flatten)]
    motion: MotionOptions,
    /// Motions a second
    #[arg(long, value_name = "HZ", default_value = "30", value_parser = send::parse_rate)]
    rate: f64,
    /// Say what is in this WAV file (48 kHz) in each call, and tell how it was heard
    #[arg(long, value_name = "FILE.wav", conflicts_with = "download")]
    voice: Option<PathBuf>,
    /// How long each call takes
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = network::parse_seconds)]
    seconds: Duration,
    /// Only this codec [default: both]
    #[arg(long, value_name = "CODEC")]
    codec: Option<Codec>,
    /// Only this channel [default: both]
    #[arg(long, value_name = "MODE")]
    channel: Option<ChannelMode>,
    #[command(flatten)]
    shape: Shape,
    /// Every chance is drawn from this number: the same one, the same losses for the same packets
    #[arg(long, value_name = "NUMBER", default_value = "1")]
    seed: u64,
    /// Fetch the avatar over a path of 50 ms and 100 Mbit/s instead, in turns with curl
    #[arg(long, conflicts_with_all = ["codec", "channel"])]
    download: bool,
    /// Folder for the charts (SVG); made if missing
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Options {
    fn avatar(&self) -> anyhow::Result<&Path> {
        self.avatar.as_deref().context("no avatar was named")
    }
}

/// Runs `netlab`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    if let Some(server) = options.before {
        return front::hold(options, server);
    }
    options.motion.check()?;
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    options.out.as_deref().map_or(Ok(()), make_folder)?;
    let avatar = options.avatar()?;
    ensure!(
        avatar.is_file(),
        "there is no avatar package {}: `./run demo` leaves one in its cache, `mon3tr bake` makes others",
        avatar.display()
    );
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let server = LocalServer::start(folder.path())?;
    let network = Network::start()?;
    let client = Client::new(None)?;
    if options.download {
        return download::run(options, &network, &client, &server, folder.path());
    }
    let conditions = options.shape.conditions()?;
    let variants = variants(options);
    // Only one that was asked for has an outage, and then there is no other.
    let seconds = conditions
        .iter()
        .map(|one| one.seconds(options.seconds))
        .max();
    let seconds = seconds.unwrap_or(options.seconds);
    let bar = progress::bar("calling", conditions.len() * variants.len());
    let mut report = Report {
        title: format!(
            "Calls of {:.0} s at {} Hz, {}",
            seconds.as_secs_f64(),
            options.rate,
            options.motion.name()
        ),
        ..Report::default()
    };
    for condition in &conditions {
        for variant in &variants {
            let bench = Bench {
                options,
                network: &network,
                client: &client,
                server: &server,
                folder: folder.path(),
            };
            let (row, series) = bench
                .call(condition, *variant)
                .with_context(|| format!("{variant}, {}", condition.name))?;
            report.calls.push(row);
            report.bitrates.push(series);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    report.notes = vec![
        "down and up: what the sender and the viewer put on the wire, IPv4, UDP, DTLS and SCTP headers and all that holds the connection included.".into(),
        "ms: from capture to when the deform stage may have the frame, the jitter buffer's part left out; nothing is drawn. lost: frames \
         captured that never came, or too late.".into(),
    ];
    print!("{report}");
    if let Some(file) = &options.json {
        std::fs::write(file, report.to_json() + "\n")
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    if let Some(folder) = &options.out {
        write_charts(&report, folder)?;
    }
    Ok(())
}

fn variants(options: &Options) -> Vec<Variant> {
    let codecs = options
        .codec
        .map_or(vec![Codec::Paper, Codec::Compact], |one| vec![one]);
    let channels = options.channel.map_or(
        vec![ChannelMode::Reliable, ChannelMode::Unreliable],
        |one| vec![one],
    );
    let all = codecs.iter().flat_map(|codec| {
        channels.iter().map(|channel| Variant {
            codec: *codec,
            channel: *channel,
        })
    });
    all.collect()
}

fn write_charts(report: &Report, folder: &Path) -> anyhow::Result<()> {
    println!("\npictures");
    let write = |name: &str, chart: String| {
        let file = folder.join(name);
        std::fs::write(&file, chart).with_context(|| format!("cannot write {}", file.display()))?;
        println!("  {}", file.display());
        anyhow::Ok(())
    };
    write("calls.svg", call_chart(report)?)?;
    // One for each condition: all curves in one would hide each other.
    let calls = report.calls.iter().zip(&report.bitrates);
    let mut conditions: Vec<&str> = report.calls.iter().map(|c| c.condition.as_str()).collect();
    conditions.dedup();
    for (k, condition) in (1..).zip(conditions) {
        let of_condition = calls
            .clone()
            .filter(|(call, _)| call.condition == condition);
        let part = Report {
            title: format!("{}: {condition}", report.title),
            bitrates: of_condition.map(|(_, series)| series.clone()).collect(),
            ..Report::default()
        };
        write(&format!("bitrates-{k}.svg"), bitrate_chart(&part)?)?;
    }
    Ok(())
}
