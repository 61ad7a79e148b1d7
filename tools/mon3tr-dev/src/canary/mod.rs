//! `mon3tr-dev canary`: a call through a running server, by the name under which its users reach it, once or again and
//! again.

mod avatar;
mod call;
mod failure;
mod metrics;

use anyhow::{Context, bail, ensure};
use call::{Arrived, Canary, Measured};
use failure::Failure;
use link_http::Client;
use link_playout::Clock;
use link_protocol::room_link::ServerUrl;
use mon3tr::network::{Network, parse_seconds};
use mon3tr::owner_token::OwnerToken;
use mon3tr::report::{check_writable, write_json};
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Between two looks whether it is to end.
const LOOK: Duration = Duration::from_millis(50);

/// Options of `canary`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The servers, each by the address that its users have
    #[arg(value_name = "URL", required = true)]
    servers: Vec<ServerUrl>,
    #[command(flatten)]
    token: OwnerToken,
    /// A certificate (PEM) to trust beside the system's
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
    /// Hold a call every so many seconds until Ctrl-C, instead of one
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    every: Option<Duration>,
    /// Write the last calls' results as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the last calls' results as Prometheus' text, for node_exporter's textfile collector
    #[arg(long, value_name = "FILE.prom")]
    metrics: Option<PathBuf>,
}

/// The last call through one server.
#[derive(Debug, Serialize)]
struct Call {
    server: String,
    /// When it ended, Unix seconds.
    finished: u64,
    #[serde(flatten)]
    outcome: Outcome,
}

/// How it ended.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
enum Outcome {
    Succeeded(Measured),
    Failed(Failure),
}

/// Runs `canary`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let tokens = options.tokens()?;
    let network = Network::start()?;
    let stop = network.stop_on_signal();
    let client = Client::new(options.ca.as_deref())?;
    let package = tempfile::NamedTempFile::new().context("cannot make a temporary file")?;
    avatar::avatar()?.save(package.path())?;
    let own = call::own()?;
    loop {
        let begun = Instant::now();
        let mut calls = Vec::new();
        for (server, token) in options.servers.iter().zip(&tokens) {
            let canary = Canary {
                network: &network,
                // An idle connection would hide that no new one can be made.
                client: &client.with_new_connections()?,
                own: own.clone(),
                avatar: package.path(),
                clock: Clock::start(),
            };
            let outcome = match canary.call(server, token) {
                Ok(measured) => Outcome::Succeeded(measured),
                Err(failure) => Outcome::Failed(failure),
            };
            calls.push(Call {
                server: server.to_string(),
                finished: now(),
                outcome,
            });
        }
        write_json(options.json.as_deref(), &calls)?;
        if let Some(file) = &options.metrics {
            metrics::write(file, &calls)?;
        }
        let Some(every) = options.every else {
            return conclude(&calls);
        };
        for call in &calls {
            println!("{} {}", call.finished, call.line());
        }
        // Lines are read as they come; without a reader the files are enough.
        let _ = std::io::stdout().flush();
        while begun.elapsed() < every && !stop.load(Relaxed) {
            std::thread::sleep(LOOK);
        }
        if stop.load(Relaxed) {
            return Ok(());
        }
    }
}

/// Prints how each call went; an error if one failed.
fn conclude(calls: &[Call]) -> anyhow::Result<()> {
    if let [
        Call {
            outcome: Outcome::Failed(_),
            ..
        },
    ] = calls
    {
        bail!("{}", calls.iter().map(Call::line).collect::<String>());
    }
    for call in calls {
        println!("{}", call.line());
    }
    let failed = calls
        .iter()
        .filter(|call| matches!(call.outcome, Outcome::Failed(_)));
    match failed.count() {
        0 => Ok(()),
        failed => bail!("{failed} of {} servers fail", calls.len()),
    }
}

impl Options {
    /// A token for each server.
    fn tokens(&self) -> anyhow::Result<Vec<String>> {
        let token = |server: &ServerUrl| {
            ensure!(
                !server.is_unprotected(),
                "{server} is reached over the internet without TLS: the owner's token is not sent there; give its https address"
            );
            self.token.of(server)
        };
        self.servers.iter().map(token).collect()
    }
}

impl Call {
    fn line(&self) -> String {
        let server = &self.server;
        let measured = match &self.outcome {
            Outcome::Failed(failure) => return format!("{server} fails: {failure}"),
            Outcome::Succeeded(measured) => measured,
        };
        let mut line = format!("{server} works: direct {}", arrived(&measured.direct));
        match &measured.relay {
            Some(relay) => line += &format!("; relay {relay}"),
            None => line += "; no relay",
        }
        match &measured.forwarded {
            Some(forwarded) => line += &format!("; forwarded {}", arrived(forwarded)),
            None => line += "; no forwarder",
        }
        line
    }
}

fn arrived(arrived: &Arrived) -> String {
    let Arrived {
        join_s,
        frames,
        lost,
    } = arrived;
    format!("after {join_s:.2} s, {lost} of {frames} frames lost")
}

fn now() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| now.as_secs())
}
