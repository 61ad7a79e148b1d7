//! `mon3tr serve`: signaling and avatar store for calls.

#[cfg(all(feature = "operator", unix))]
pub mod forwarder;
mod forwarding;
mod owners;

#[cfg(feature = "operator")]
mod operator;
#[cfg(all(feature = "operator", unix))]
pub mod relay;
#[cfg(all(feature = "operator", unix))]
mod watchdog;

use crate::device_options::make_folder;
use crate::network::{Network, asked_to_end};
use crate::owner_token::server_folder;
use anyhow::{Context, ensure};
use forwarding::Forwarder;
use link_protocol::ice::IceUrl;
use server::{Config, Secret, Server, StoreConfig, TurnConfig, own_address};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;

/// Options of `serve`.
#[derive(Debug, clap::Args)]
#[cfg_attr(
    not(feature = "operator"),
    command(
        after_help = "S3, NATS, TLS and counters at /metrics: `mon3tr-dev serve`, which is `./run serve`"
    )
)]
pub struct Options {
    /// Address and port to listen on; port 0 takes a free one. Without TLS others than this machine are served with --insecure only
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Serve others without TLS: whoever is on the way can read and use links and tokens, though neither see nor hear a call. For a network that you trust
    #[arg(long)]
    insecure: bool,
    /// Folder for the server's secret, the owner's token, and packages [default: `server` in the cache folder]
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// Relay calls whose two sides find no direct way, on this address and port, over UDP and TCP (and TLS, where there is a certificate):
    /// 0.0.0.0:3478 is usual
    #[arg(long, value_name = "ADDRESS:PORT")]
    turn: Option<SocketAddr>,
    /// The address by which the world reaches this machine, where a router stands between
    #[arg(long, value_name = "IP", requires = "turn")]
    turn_external: Option<IpAddr>,
    /// Relay into private networks too: for a server whose users are all in one
    #[arg(long, requires = "turn")]
    turn_private: bool,
    /// A STUN server of others, which tells senders and viewers their own addresses; may be given several times. `--turn` has one
    #[arg(long, value_name = "URL")]
    stun: Vec<IceUrl>,
    /// Forward to the viewers of a sender beyond the eighth, sealed, so that this server cannot read it; so many viewers at most, of all rooms together
    #[arg(long, value_name = "VIEWERS", num_args = 0..=1, default_missing_value = "500", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    forward: Option<usize>,
    #[cfg(feature = "operator")]
    #[command(flatten)]
    operator: operator::OperatorOptions,
    #[command(flatten)]
    tokens: owners::TokenOptions,
}

/// Everything that the server writes is for its own user alone: avatars are people's likenesses.
fn keep_to_oneself() {
    #[cfg(unix)]
    rustix::process::umask(rustix::fs::Mode::RWXG | rustix::fs::Mode::RWXO);
}

/// Lets this process have as many open files, and so connections, as the system allows it: many systems begin with 1,024, which three addresses fill.
fn raise_open_files() {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let limit = getrlimit(Resource::Nofile);
        let raised = Rlimit {
            current: limit.maximum,
            ..limit
        };
        if let Err(error) = setrlimit(Resource::Nofile, raised) {
            log::warn!(
                "no more than {:?} connections are possible: {error}",
                limit.current
            );
        }
    }
}

/// Runs `serve`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    keep_to_oneself();
    raise_open_files();
    let folder = server_folder(options.data.as_deref())?;
    let [secret, previous] = ["secret", "secret.previous"].map(|name| folder.join(name));
    if options.tokens.are_asked_for() {
        let exists = secret.try_exists();
        ensure!(
            exists.with_context(|| format!("cannot look for {}", secret.display()))?,
            "there is no {}: give the --data of the server, or start the server once",
            secret.display()
        );
    }
    make_folder(&folder)?;
    for file in [&secret, &previous] {
        if file.exists() {
            identity::open_private(file)
                .context("a user who reads the server's secret can make any token")?;
        }
    }
    let mut secret = Secret::load_or_create(&secret)?;
    if let Some(previous) = Secret::load(&previous)? {
        secret = secret.after(&previous);
    }
    let owners = owners::Owners::new(folder.clone(), secret.clone());
    if options.tokens.run(&owners)? {
        return Ok(());
    }
    options.check_protection()?;
    owners.renew()?;
    let mut config = Config::new(
        options.listen,
        StoreConfig::Local(folder.join("packages")),
        secret,
    );
    config.revoked = Some(owners.revoked_file());
    config.blocked = Some(folder.join("blocked"));
    config.stun.clone_from(&options.stun);
    config.turn = options.turn.map(|listen| TurnConfig {
        external: options.turn_external,
        private_peers: options.turn_private,
        ..TurnConfig::new(listen)
    });
    #[cfg(feature = "operator")]
    options.operator.set(&mut config)?;
    #[cfg(feature = "operator")]
    let scheme = options.operator.scheme();
    #[cfg(not(feature = "operator"))]
    let scheme = "http";
    if let Some(viewers) = options.forward {
        // By which this machine's own loopback is never meant, where a proxy stands before this server.
        let ip = reachable(Ipv4Addr::UNSPECIFIED.into());
        let address = format!("{scheme}://{ip}").parse()?;
        config.forwarding = Some(Arc::new(Forwarder::new(address, viewers)));
    }
    let network = Network::start()?;
    #[cfg(all(feature = "operator", unix))]
    network.spawn(async { match watchdog::report().await {} });
    network.block_on(async {
        let mut server = Server::start(config).await.context("cannot serve")?;
        let address = SocketAddr::new(reachable(options.listen.ip()), server.address().port());
        println!("serving on {scheme}://{address}");
        if let Some(relay) = server.turn_address() {
            println!(
                "relaying calls that find no direct way on port {}, UDP and TCP",
                relay.port()
            );
        }
        if let Some(viewers) = options.forward {
            println!("forwarding to at most {viewers} viewers whose senders have many");
        }
        println!(
            "the owner's token, which opens rooms and puts avatars, is in {}: keep it to yourself",
            owners.token_file().display()
        );
        println!(
            "now open a call:\n  mon3tr call --server {scheme}://{address} --avatar PACKAGE.m3a\nor a room, for a sender and its viewers:\n  mon3tr send --server {scheme}://{address} --avatar PACKAGE.m3a"
        );
        tokio::select! {
            asked = asked_to_end() => {
                asked.context("cannot wait for Ctrl-C")?;
            }
            // It does not end by itself unless something is wrong.
            ended = server.wait() => return ended.context("the server ended"),
            never = owners.keep_renewed() => match never {},
        }
        tokio::select! {
            () = server.stop() => {}
            _ = asked_to_end() => {}
        }
        Ok(())
    })
}

impl Options {
    /// That whoever is on the way cannot read what is said to the server, unless the operator wants it so.
    fn check_protection(&self) -> anyhow::Result<()> {
        #[cfg(feature = "operator")]
        let has_tls = self.operator.scheme() == "https";
        #[cfg(not(feature = "operator"))]
        let has_tls = false;
        if has_tls || self.listen.ip().is_loopback() {
            return Ok(());
        }
        anyhow::ensure!(
            self.insecure,
            "{} can be reached by others, and without TLS whoever is on the way can read and use their links and tokens: give --tls-cert and --tls-key (mon3tr-dev serve), listen on 127.0.0.1 behind a proxy that has TLS, or give --insecure in a network that you trust",
            self.listen
        );
        log::warn!(
            "serving without TLS (--insecure): whoever is on the way can read and use links and tokens; motion and voice stay encrypted"
        );
        Ok(())
    }
}

/// The address under which others find a server that listens on `ip`: where it listens on all, the one that packets to the world leave from.
fn reachable(ip: IpAddr) -> IpAddr {
    if !ip.is_unspecified() {
        return ip;
    }
    own_address(ip).unwrap_or(IpAddr::V4(Ipv4Addr::LOCALHOST))
}
