//! `mon3tr-dev relay`: the server's relay as a process of its own, on any machine that has the server's secret.
//! Strangers send packets to it, and its end leaves signaling as it is.

use super::{keep_to_oneself, raise_open_files, watchdog};
use crate::network::{Network, asked_to_end};
use crate::owner_token::server_folder;
use anyhow::Context;
use server::{Secret, TurnConfig};
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};

/// Options of `relay`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Address and port to listen on, over UDP and TCP (and TLS, where there is a certificate)
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "0.0.0.0:3478")]
    listen: SocketAddr,
    /// The server's secret; the lists `revoked` and `blocked` are in its folder [default: `secret` in the folder of a
    /// server on this machine]
    #[arg(long, value_name = "FILE")]
    secret: Option<PathBuf>,
    /// The address by which the world reaches this machine, where a router stands between
    #[arg(long, value_name = "IP")]
    external: Option<IpAddr>,
    /// Relay into private networks too: for a server whose users are all in one
    #[arg(long)]
    private: bool,
    /// Certificate chain (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The certificate's private key (PEM). Both files are read again when they change
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
}

/// Runs `relay`.
///
/// # Errors
/// If secret, certificate or address cannot be used.
pub fn run(options: &Options) -> anyhow::Result<()> {
    keep_to_oneself();
    raise_open_files();
    let file = match &options.secret {
        Some(file) => file.clone(),
        None => server_folder(None)?.join("secret"),
    };
    // One that this process made would fit no server's.
    anyhow::ensure!(
        file.exists(),
        "there is no secret {}: start `serve` first, and give --secret where its folder is another one",
        file.display()
    );
    identity::open_private(&file)
        .context("a user who reads the server's secret can make any token")?;
    let secret = Secret::load_or_create(&file)?;
    // The server's lists of revoked tokens and blocked addresses are beside its secret.
    let folder = file.parent().unwrap_or(Path::new("."));
    let turn = TurnConfig {
        external: options.external,
        private_peers: options.private,
        ..TurnConfig::new(options.listen)
    };
    let tls = options.tls_cert.as_deref().zip(options.tls_key.as_deref());
    let network = Network::start()?;
    network.spawn(async { match watchdog::report().await {} });
    network.block_on(async {
        let relay = server::Relay::start(&secret, &turn, folder, tls).context("cannot relay")?;
        println!(
            "relaying calls that find no direct way on {}, UDP and TCP: `serve --turn-at {}` names it to callers",
            relay.address(),
            relay.address().port()
        );
        asked_to_end().await.context("cannot wait for Ctrl-C")?;
        Ok(())
    })
}
