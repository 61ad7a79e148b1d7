//! `mon3tr-dev audience`: forwards one sender to many viewers.

use anyhow::Context;
use link_call::forward::Forwarder;
use link_http::Client;
use link_playout::Clock;
use link_protocol::RoomLink;
use mon3tr::keys;
use mon3tr::network::Network;
use mon3tr::owner_token::OwnerToken;
use mon3tr::report::{check_writable, write_json};
use mon3tr::secret_argument::SecretArgument;
use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

/// Between two looks whether it is to end.
const LOOK: Duration = Duration::from_millis(50);

/// Viewers that one process may have: each needs some hundred kilobytes.
const MOST: usize = 10_000;

/// Options of `audience`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The link by which viewers join the sender: @FILE reads it from a file, - from standard input
    #[arg(value_name = "LINK")]
    link: SecretArgument,
    /// An open room for the audience, by its sender's link [default: another one is opened on the same server, and the viewers' link printed]
    #[arg(long, value_name = "@FILE|-|LINK")]
    into: Option<SecretArgument>,
    #[command(flatten)]
    token: OwnerToken,
    /// Viewers at most
    #[arg(long, value_name = "NUMBER", default_value = "500", value_parser = parse_viewers)]
    viewers: usize,
    /// A certificate (PEM) to trust beside the system's
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn parse_viewers(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|viewers| (1..=MOST).contains(viewers))
        .ok_or_else(|| format!("{text} is not a number of viewers from 1 to {MOST}"))
}

/// Runs `audience`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let source: RoomLink = options.link.parse("sender's link")?;
    let network = Network::start()?;
    let client = Client::new(options.ca.as_deref())?;
    let keys = keys::open()?;
    let stop = network.stop_on_signal();
    let into = match &options.into {
        Some(link) => link.parse("audience's link")?,
        None => {
            let server = source.server();
            let token = (options.token.of(server)).context(
                "no room for the audience: give --into LINK, or what opens one on the sender's server",
            )?;
            let opened = client.open_room(server, &token, None);
            let room = network
                .block_on(opened)
                .context("cannot open a room for the audience")?;
            let secret = sender::new_secret()?;
            let key = keys.identity().public();
            let viewers = room.viewer.with_secret(secret.clone()).with_key(key.hash());
            println!("the audience joins with\n  mon3tr receive '{viewers}'");
            println!(
                "where the avatar is signed, its owner has to let this forwarder show it: `mon3tr keys allow {key}`, and here `mon3tr keys accept`"
            );
            room.sender.with_secret(secret)
        }
    };
    let figures = network.block_on(async {
        let forwarder = Forwarder::begin(
            client,
            source,
            into,
            options.viewers,
            Some(keys),
            Clock::start(),
        );
        let forwarder = forwarder.await.context("cannot forward")?;
        println!("forwarding until Ctrl-C");
        while !stop.load(Relaxed) {
            tokio::time::sleep(LOOK).await;
        }
        anyhow::Ok(forwarder.end().await)
    })?;
    println!(
        "forwarded {} messages and {} packets of voice to {} viewers: {} sent, {} left out because too much waited",
        figures.messages, figures.voice, figures.joined, figures.sent, figures.skipped
    );
    write_json(options.json.as_deref(), &figures)
}
