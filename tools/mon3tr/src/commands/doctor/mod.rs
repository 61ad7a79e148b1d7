//! `mon3tr doctor`: what this machine has for calls, and whether they will find their way to it, before there is one.

mod machine;

use crate::device_options::DeviceOptions;
use crate::network::{Line, Trust, warn_if_unproved};
use crate::owner_token::OwnerToken;
use crate::report::{check_writable, write_json};
use crate::secret_argument::SecretArgument;
use anyhow::Context;
use link_call::reach::{Between, Reach};
use link_protocol::CallLink;
use link_protocol::ice::IceUrl;
use link_protocol::room_link::ServerUrl;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Options of `doctor`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The call's link that is to be joined, by which way others will reach this machine: @FILE reads it from a file, -
    /// from standard input
    #[arg(value_name = "LINK", conflicts_with = "server")]
    link: Option<SecretArgument>,
    /// The same of a server, on which a call is opened to ask
    #[arg(long, value_name = "URL")]
    server: Option<ServerUrl>,
    #[command(flatten)]
    token: OwnerToken,
    /// Ask this STUN server, too: two of them tell what kind of NAT is in between
    #[arg(long, value_name = "HOST[:PORT]", value_parser = parse_stun)]
    stun: Vec<IceUrl>,
    #[command(flatten)]
    trust: Trust,
    /// Write what was found as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    machine: Vec<machine::Part>,
    #[serde(flatten)]
    network: Option<NetworkReport>,
}

#[derive(Serialize)]
struct NetworkReport {
    server: String,
    /// The link leads to this machine's loopback: nobody else can use it.
    is_here_only: bool,
    /// From the question to the answer, milliseconds.
    answered_ms: f64,
    between: Between,
    #[serde(flatten)]
    reach: Reach,
}

fn parse_stun(text: &str) -> Result<IceUrl, String> {
    let url = format!("stun:{}", text.strip_prefix("stun:").unwrap_or(text));
    url.parse().map_err(|error| format!("{error}"))
}

/// Runs `doctor`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let machine = machine::parts(device);
    machine::print(&machine);
    println!();
    let network = options.network()?;
    match &network {
        Some(network) => network.print(),
        None => println!(
            "LINK or --server URL says besides by which way others will reach this machine"
        ),
    }
    write_json(options.json.as_deref(), &Report { machine, network })
}

impl Options {
    fn network(&self) -> anyhow::Result<Option<NetworkReport>> {
        if self.link.is_none() && self.server.is_none() {
            return Ok(None);
        }
        let line = Line::open(&self.trust)?;
        let link = self.link(&line)?;
        ask(&line, &link, &self.stun).map(Some)
    }

    fn link(&self, line: &Line) -> anyhow::Result<CallLink> {
        if let Some(link) = &self.link {
            let link: CallLink = link.parse("call's link")?;
            warn_if_unproved(link.has_secret(), link.key().is_some());
            return Ok(link);
        }
        let server = self.server.as_ref().context("no server")?;
        let token = self.token.of(server)?;
        let opened = line.client.open_call(server, &token, None, None);
        line.network
            .block_on(opened)
            .context("the server cannot be asked")
    }
}

/// Asks the call's server, and the STUN and TURN servers that it names.
fn ask(line: &Line, link: &CallLink, stun: &[IceUrl]) -> anyhow::Result<NetworkReport> {
    let begun = Instant::now();
    let status = line.network.block_on(line.client.call_status(link));
    let status = status.context("the server cannot be asked")?;
    let answered_ms = begun.elapsed().as_secs_f64() * 1e3;
    let finding = Reach::find(link.server(), &status.ice_servers, stun);
    let reach = line.network.block_on(finding)?;
    Ok(NetworkReport {
        server: link.server().to_string(),
        is_here_only: link.server().is_loopback(),
        answered_ms,
        between: reach.between(),
        reach,
    })
}

impl NetworkReport {
    fn print(&self) {
        let Reach {
            own,
            seen,
            silent,
            relay,
            is_lent,
        } = &self.reach;
        println!(
            "server    {} answers in {:.0} ms",
            self.server, self.answered_ms
        );
        let own: Vec<String> = own.iter().map(ToString::to_string).collect();
        println!("here      {}", own.join(", "));
        for one in seen {
            println!("seen      as {} by {}", one.seen, one.url);
        }
        for url in silent {
            println!("silent    {url} does not answer over UDP");
        }
        match (relay, is_lent) {
            (Some(relay), true) => println!("relay     {relay} lends an address"),
            (Some(relay), false) => println!("relay     {relay} lends no address"),
            (None, _) => println!("relay     none: the server's operator can start it with --turn"),
        }
        if self.is_here_only {
            println!("\nThe link works on this machine only: ask with the server's own address.");
            return;
        }
        println!("between   {}", told(self.between));
        println!("\n{}", verdict(self.between, *is_lent));
    }
}

/// What is between this machine and others, in words.
fn told(between: Between) -> &'static str {
    match between {
        Between::Nothing => "no NAT: this machine's own address is seen",
        Between::Cone => "a NAT that gives one address for all destinations",
        Between::Symmetric => "a NAT that gives another address for each destination",
        Between::SomeNat => {
            "a NAT; a STUN server at another address (--stun) would tell of which kind"
        }
        Between::NoUdp => "something that lets no UDP through, or no STUN server answers",
    }
}

/// What that means for calls.
fn verdict(between: Between, is_lent: bool) -> &'static str {
    match (between, is_lent) {
        (Between::Nothing, _) => "Others reach you directly.",
        (Between::Cone, true) => {
            "Others reach you directly where their own NAT allows it, else by the relay."
        }
        (Between::SomeNat | Between::Symmetric, true) => {
            "Others without a NAT reach you directly, all others by the relay at worst."
        }
        (Between::NoUdp, true) => "Others reach you by the relay only, which costs some delay.",
        (Between::Cone, false) => {
            "Others reach you directly where their own NAT allows it; those behind a strict one do not: a relay is missing."
        }
        (Between::SomeNat | Between::Symmetric, false) => {
            "Only others without a NAT are sure to reach you: a relay is missing."
        }
        (Between::NoUdp, false) => "Others cannot reach you: a relay is missing.",
    }
}
