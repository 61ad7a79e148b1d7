//! `netlab --download`: how long the avatar's package takes over a path of 50 ms and 100 Mbit/s, in turns with curl over the same path.

use super::Options;
use crate::bench::median;
use anyhow::{Context, ensure};
use link_http::{Client, PackageCache};
use link_protocol::RoomLink;
use link_protocol::announcement::AvatarRef;
use mon3tr::children::LocalServer;
use mon3tr::network::Network;
use mon3tr::report::write_json;
use netlab::{BitRate, TcpImpairment, TcpRelay};
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The path: round trip and rate.
const ROUND_TRIP: Duration = Duration::from_millis(50);
const KBIT_S: f64 = 100_000.0;

/// Downloads of each.
const TURNS: usize = 5;

/// What was measured.
#[derive(Debug, Serialize)]
struct Report {
    bytes: u64,
    round_trip_ms: f64,
    mbit_s: f64,
    /// What the path's rate alone takes.
    least_s: f64,
    ours_s: Vec<f64>,
    curl_s: Vec<f64>,
    median_ours_s: f64,
    median_curl_s: f64,
    ratio: f64,
}

/// Measures, prints and writes.
pub(super) fn run(
    options: &Options,
    network: &Network,
    client: &Client,
    server: &LocalServer,
    folder: &Path,
) -> anyhow::Result<()> {
    let avatar = AvatarRef::of_file(options.avatar()?)?;
    network.block_on(client.put_package(
        &server.url,
        &server.owner_token,
        options.avatar()?,
        |_, _| {},
    ))?;
    let (_, viewer) = network.block_on(server.open_room(client))?;
    let path = TcpImpairment::symmetric(ROUND_TRIP, Some(BitRate::from_kbit_s(KBIT_S)?));
    let relay = network.block_on(TcpRelay::start(
        ([127, 0, 0, 1], 0).into(),
        server.address()?,
        path,
    ))?;
    let viewer = viewer.at(format!("http://{}", relay.address()).parse()?);
    let (mut ours_s, mut curl_s) = (Vec::new(), Vec::new());
    for turn in 0..TURNS {
        ours_s.push(ours(
            network,
            &viewer,
            &avatar,
            &folder.join(format!("cache{turn}")),
        )?);
        curl_s.push(curl(&viewer, &avatar, &folder.join("by-curl"))?);
    }
    let (median_ours_s, median_curl_s) = (median(&ours_s), median(&curl_s));
    let report = Report {
        bytes: avatar.bytes,
        round_trip_ms: ROUND_TRIP.as_secs_f64() * 1e3,
        mbit_s: KBIT_S / 1e3,
        least_s: avatar.bytes as f64 * 8e-3 / KBIT_S,
        ratio: median_ours_s / median_curl_s,
        ours_s,
        curl_s,
        median_ours_s,
        median_curl_s,
    };
    println!(
        "{:.1} MB over {} ms and {} Mbit/s, medians of {TURNS} in turns (the rate alone takes {:.2} s)",
        report.bytes as f64 / 1e6,
        report.round_trip_ms,
        report.mbit_s,
        report.least_s
    );
    println!("  fetched and checked  {median_ours_s:>6.2} s");
    println!("  curl                 {median_curl_s:>6.2} s");
    println!("  ratio                {:>6.2}", report.ratio);
    write_json(options.json.as_deref(), &report)
}

/// With a client and a cache that know nothing, as a receiver that was just started.
fn ours(
    network: &Network,
    viewer: &RoomLink,
    avatar: &AvatarRef,
    cache: &Path,
) -> anyhow::Result<f64> {
    let begun = Instant::now();
    let client = Client::new(None)?;
    let cache = PackageCache::new(cache)?;
    network.block_on(client.fetch_package(viewer, avatar, &cache, |_| {}))?;
    Ok(begun.elapsed().as_secs_f64())
}

fn curl(viewer: &RoomLink, avatar: &AvatarRef, file: &Path) -> anyhow::Result<f64> {
    let token = viewer.token().secret();
    let begun = Instant::now();
    let status = Command::new("curl")
        .args(["--silent", "--fail", "--output"])
        .arg(file)
        // Not among its arguments, which every user of this machine can see.
        .args(["--header", "@-"])
        .arg(format!("{}/v1/packages/{}", viewer.server(), avatar.sha256))
        .stdin(Stdio::piped())
        .spawn()
        .and_then(|mut curl| {
            if let Some(mut stdin) = curl.stdin.take() {
                stdin.write_all(format!("Authorization: Bearer {token}\n").as_bytes())?;
            }
            curl.wait()
        })
        .context("cannot run curl, which this is compared with")?;
    ensure!(status.success(), "curl failed ({status})");
    let seconds = begun.elapsed().as_secs_f64();
    let bytes = std::fs::metadata(file).context("curl left no file")?.len();
    ensure!(
        bytes == avatar.bytes,
        "curl fetched {bytes} of {} bytes",
        avatar.bytes
    );
    Ok(seconds)
}
