//! What an audience costs: one sender, one forwarder, more and more viewers, each in a process of its own but for the viewers, who share one. All on this machine.

use super::measure::print_table;
use crate::usage::Usage;
use anyhow::{Context, bail};
use link_call::viewer::ViewerStatistics;
use link_call::{Authentication, CallEvent, Viewer};
use link_http::Client;
use link_playout::Clock;
use link_protocol::RoomLink;
use link_voice::VoiceQueue;
use mon3tr::children::{LocalServer, Output, Process};
use mon3tr::network::Network;
use mon3tr::report::{check_writable, write_json};
use serde::Serialize;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Viewers who begin to join at once, and until the next ones do: a server bounds both.
const AT_ONCE: usize = 10;
const BETWEEN: Duration = Duration::from_millis(500);

/// How long all may take to be there.
const JOIN_WITHIN: Duration = Duration::from_secs(180);

/// Options of `bench audience`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The avatar's package
    #[arg(long, value_name = "PACKAGE")]
    avatar: PathBuf,
    /// What is said, again and again (WAV, 48 kHz)
    #[arg(long, value_name = "FILE.wav")]
    voice: PathBuf,
    /// Numbers of viewers
    #[arg(
        long,
        value_name = "N,..",
        value_delimiter = ',',
        default_value = "1,10,50,100,200,500"
    )]
    viewers: Vec<usize>,
    /// How long each number is measured
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = mon3tr::network::parse_seconds)]
    seconds: Duration,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Of one number of viewers.
#[derive(Debug, Serialize)]
struct Measured {
    viewers: usize,
    /// Until all of them had a frame, from the first one's joining, seconds.
    joined_s: f64,
    /// Of the forwarder, in cores.
    forwarder_cores: f64,
    /// Of this process with all viewers.
    viewers_cores: f64,
    /// The forwarder's resident memory, MB.
    forwarder_mb: f64,
    /// From capture to arrival, milliseconds, all viewers together.
    delay_p50_ms: f64,
    delay_p95_ms: f64,
    /// Frames and packets of voice that a viewer did not get and another one did, in a hundred.
    frames_lost_percent: f64,
    voice_lost_percent: f64,
    /// What each viewer got, kbit/s without headers.
    motion_kbit_s: f64,
    voice_kbit_s: f64,
}

/// Measures and prints.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let network = Network::start()?;
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let server = LocalServer::start(folder.path())?;
    let client = Client::new(None)?;
    let (sender, viewers) = network.block_on(server.open_room(&client))?;
    let (stage, audience) = network.block_on(server.open_room(&client))?;
    let argument = |value: &dyn std::fmt::Display| OsString::from(value.to_string());
    let arguments: Vec<OsString> = vec![
        "--room".into(),
        argument(&sender),
        "--avatar".into(),
        options.avatar.clone().into(),
        "--voice".into(),
        options.voice.clone().into(),
    ];
    let _sender = Process::start_sender(arguments, &server.owner_token)?;
    network.block_on(wait_for_sender(&client, &viewers))?;
    let most = options.viewers.iter().max().copied().unwrap_or(1);
    let arguments: Vec<OsString> = vec![
        argument(&viewers),
        "--into".into(),
        argument(&stage),
        "--viewers".into(),
        argument(&most),
    ];
    let forwarder = Process::start("audience", arguments, Output::Dropped)?;
    network.block_on(wait_for_sender(&client, &audience))?;
    let mut all = Audience {
        client,
        link: audience,
        clock: Clock::start(),
        there: Vec::new(),
    };
    let mut measured = Vec::new();
    for count in &options.viewers {
        let joined_s = all.grow(*count, &network)?;
        measured.push(all.measure(options.seconds, joined_s, forwarder.id())?);
        eprintln!("{count} viewers measured");
    }
    print(&measured);
    write_json(options.json.as_deref(), &measured)?;
    network.block_on(all.leave());
    forwarder.stop()?;
    server.stop()
}

async fn wait_for_sender(client: &Client, link: &RoomLink) -> anyhow::Result<()> {
    let until = Instant::now() + Duration::from_secs(60);
    while Instant::now() < until {
        if client.room_status(link).await?.is_some() {
            return Ok(());
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    bail!("the sender does not come")
}

/// The viewers who are there.
struct Audience {
    client: Client,
    link: RoomLink,
    clock: Clock,
    there: Vec<Viewer>,
}

impl Audience {
    /// Has viewers join until there are so many who have had a frame; how long that took, seconds.
    fn grow(&mut self, count: usize, network: &Network) -> anyhow::Result<f64> {
        let begun = Instant::now();
        while self.there.len() < count {
            network.block_on(async {
                for _ in 0..AT_ONCE.min(count - self.there.len()) {
                    let (client, link) = (self.client.clone(), self.link.clone());
                    let voice = VoiceQueue::default();
                    self.there.push(Viewer::join(
                        client,
                        link,
                        Authentication::default(),
                        self.clock,
                        voice,
                    ));
                }
            });
            self.drain(BETWEEN, &mut Vec::new());
        }
        loop {
            self.drain(Duration::from_millis(100), &mut Vec::new());
            let missing = self.there.iter().filter(|one| one.statistics().frames == 0);
            let missing = missing.count();
            if missing == 0 {
                return Ok(begun.elapsed().as_secs_f64());
            }
            if begun.elapsed() > JOIN_WITHIN {
                bail!("{missing} of {count} viewers have had nothing");
            }
        }
    }

    /// Takes what comes for so long; from capture to arrival of each frame, milliseconds.
    fn drain(&self, time: Duration, delays: &mut Vec<f64>) {
        let until = Instant::now() + time;
        loop {
            for viewer in &self.there {
                while let Ok(event) = viewer.next(Duration::ZERO) {
                    if let CallEvent::Frame {
                        captured: Some(captured),
                        arrived,
                        ..
                    } = event
                    {
                        let late = arrived.signed() - captured.signed();
                        delays.push(late as f64 / 1e3);
                    }
                }
            }
            if Instant::now() >= until {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn measure(&self, time: Duration, joined_s: f64, forwarder: u32) -> anyhow::Result<Measured> {
        let statistics =
            || -> Vec<ViewerStatistics> { self.there.iter().map(Viewer::statistics).collect() };
        let own = std::process::id();
        let (before, begun) = (statistics(), Instant::now());
        let busy = [busy_seconds(forwarder)?, busy_seconds(own)?];
        let mut delays = Vec::new();
        self.drain(time, &mut delays);
        let seconds = begun.elapsed().as_secs_f64();
        let busy_now = [busy_seconds(forwarder)?, busy_seconds(own)?];
        let after = statistics();
        delays.sort_by(f64::total_cmp);
        let percentile = |share: f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a place"
            )]
            let place = (share * delays.len().saturating_sub(1) as f64) as usize;
            delays.get(place).copied().unwrap_or(f64::NAN)
        };
        let of = |count: fn(&ViewerStatistics) -> u64| {
            let counts = before.iter().zip(&after);
            let counts: Vec<f64> = counts
                .map(|(before, after)| (count(after) - count(before)) as f64)
                .collect();
            let most = counts.iter().copied().fold(0.0, f64::max);
            let mean = counts.iter().sum::<f64>() / counts.len().max(1) as f64;
            (mean, 100.0 * (1.0 - mean / most.max(1.0)))
        };
        Ok(Measured {
            viewers: self.there.len(),
            joined_s,
            forwarder_cores: (busy_now[0] - busy[0]) / seconds,
            viewers_cores: (busy_now[1] - busy[1]) / seconds,
            forwarder_mb: Usage::of(forwarder)?.resident_bytes as f64 / 1e6,
            delay_p50_ms: percentile(0.5),
            delay_p95_ms: percentile(0.95),
            frames_lost_percent: of(|s| s.frames).1,
            voice_lost_percent: of(|s| s.voice).1,
            motion_kbit_s: of(|s| s.payload_bytes).0 * 8e-3 / seconds,
            voice_kbit_s: of(|s| s.voice_bytes).0 * 8e-3 / seconds,
        })
    }

    async fn leave(self) {
        let leaving = self
            .there
            .into_iter()
            .map(|viewer| tokio::spawn(viewer.hang_up()));
        for left in leaving.collect::<Vec<_>>() {
            // One that failed has said so.
            let _ = left.await;
        }
    }
}

/// The processors' time of a process and its threads, seconds (`proc_pid_stat(5)`: fields 14 and 15, in hundredths on Linux).
fn busy_seconds(process: u32) -> anyhow::Result<f64> {
    let path = format!("/proc/{process}/stat");
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {path}"))?;
    let after_name = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let times = after_name.split_whitespace().skip(11).take(2);
    let ticks: f64 = times.filter_map(|ticks| ticks.parse::<f64>().ok()).sum();
    Ok(ticks / 100.0)
}

fn print(measured: &[Measured]) {
    let first = measured.first().map_or(0.0, |one| one.forwarder_mb);
    let rows: Vec<Vec<String>> = (measured.iter())
        .map(|m| {
            vec![
                m.viewers.to_string(),
                format!("{:.1}", m.joined_s),
                format!("{:.3}", m.forwarder_cores),
                format!("{:.2}", 1e3 * m.forwarder_cores / m.viewers as f64),
                format!("{:.1}", m.forwarder_mb),
                format!(
                    "{:.0}",
                    1e3 * (m.forwarder_mb - first) / (m.viewers as f64 - 1.0).max(1.0)
                ),
                format!("{:.1}", m.delay_p50_ms),
                format!("{:.1}", m.delay_p95_ms),
                format!("{:.2}", m.frames_lost_percent),
                format!("{:.2}", m.voice_lost_percent),
                format!("{:.1}", m.motion_kbit_s),
                format!("{:.1}", m.voice_kbit_s),
                format!("{:.2}", m.viewers_cores),
            ]
        })
        .collect();
    print_table(
        &[
            "viewers",
            "joined s",
            "cores",
            "ms/s each",
            "MB",
            "kB each",
            "p50 ms",
            "p95 ms",
            "frames lost %",
            "voice lost %",
            "motion kbit/s",
            "voice kbit/s",
            "viewers' cores",
        ],
        &rows,
    );
}
