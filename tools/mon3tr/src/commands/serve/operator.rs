//! What an operator may want of a server besides a folder of packages and plain HTTP.

#[cfg(unix)]
use super::forwarder::Apart;
use anyhow::Context;
use server::{Config, Limits, StoreConfig, TurnAt};
use std::path::PathBuf;
#[cfg(unix)]
use std::sync::Arc;

/// Options of `serve` that only `mon3tr-dev` has.
#[derive(Debug, clap::Args)]
pub(super) struct OperatorOptions {
    /// Keep packages in this bucket of an S3-compatible store; credentials come from AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY
    /// [default: below the --data folder]
    #[arg(long, value_name = "BUCKET")]
    s3: Option<String>,
    /// The S3-compatible store's address, if it is not Amazon's
    #[arg(long, value_name = "URL", requires = "s3")]
    s3_endpoint: Option<String>,
    /// The store's region
    #[arg(long, value_name = "REGION", requires = "s3")]
    s3_region: Option<String>,
    /// Share rooms with other instances through this NATS server; all need the same secret, so copy FOLDER/secret
    #[arg(long, value_name = "URL")]
    nats: Option<String>,
    /// Certificate chain (PEM): serve over TLS
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The certificate's private key (PEM). Both files are read again when they change
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Bounds other than the usual ones, as a TOML file (docs/operating.md)
    #[arg(long, value_name = "FILE.toml")]
    limits: Option<PathBuf>,
    /// All requests come through a proxy, which adds clients' addresses to X-Forwarded-For; nobody else may reach this server
    #[arg(long)]
    behind_proxy: bool,
    /// Name the relay of another process, `mon3tr-dev relay`, to callers: at this port of this server's own name, or of
    /// another host
    #[arg(long, value_name = "[HOST:]PORT", conflicts_with = "turn")]
    turn_at: Option<TurnAt>,
    /// Have another process on this machine, `mon3tr-dev forwarder`, forward to viewers: the Unix socket on which it
    /// waits
    #[cfg(unix)]
    #[arg(long, value_name = "SOCKET", conflicts_with = "forward")]
    forward_at: Option<PathBuf>,
}

impl OperatorOptions {
    /// Sets a server up for them.
    pub(super) fn set(&self, config: &mut Config) -> anyhow::Result<()> {
        if let Some(path) = &self.limits {
            let text = std::fs::read_to_string(path);
            let text = text.with_context(|| format!("cannot read {}", path.display()))?;
            let limits: Result<Limits, _> = toml::from_str(&text);
            config.limits = limits.with_context(|| format!("cannot use {}", path.display()))?;
        }
        config.limits.behind_proxy |= self.behind_proxy;
        if let Some(bucket) = &self.s3 {
            config.store = StoreConfig::S3 {
                bucket: bucket.clone(),
                endpoint: self.s3_endpoint.clone(),
                region: self.s3_region.clone(),
            };
        }
        config.nats.clone_from(&self.nats);
        config.turn_at.clone_from(&self.turn_at);
        #[cfg(unix)]
        if let Some(socket) = &self.forward_at {
            config.forwarding = Some(Arc::new(Apart::new(socket.clone())));
        }
        config.tls = self.tls_cert.clone().zip(self.tls_key.clone());
        Ok(())
    }

    /// What its addresses begin with.
    pub(super) fn scheme(&self) -> &'static str {
        if self.tls_cert.is_some() {
            "https"
        } else {
            "http"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_limits_in_the_documentation_has_all_of_them_as_they_are() {
        let page = include_str!("../../../../../docs/operating.md");
        let file = page.split("```toml\n").nth(1).expect("a file of limits");
        let file = file.split("```").next().expect("its end");
        let limits: Limits = toml::from_str(file).expect("limits");
        assert_eq!(limits, Limits::default());
        // All: one that is left out would have its default, too.
        let debugged = format!("{limits:?}");
        let fields = debugged.matches(": ").count();
        let written = file.lines().filter(|line| line.contains(" = ")).count();
        assert_eq!(written, fields, "{debugged}");
    }

    #[test]
    fn a_limit_that_would_serve_nobody_or_is_none_is_refused_in_words() {
        let whole = |from: u64, to: u64| format!("expected a whole number from {from} to {to}");
        let time = |from: f64, to: u64| format!("expected a number of seconds from {from} to {to}");
        let most = link_protocol::limits::MAX_PACKAGE_BYTES;
        for (line, value, expected) in [
            ("package_bytes = 0", "`0`", whole(1, most)),
            ("uploads_at_once = 0", "`0`", whole(1, 1024)),
            ("checks_at_once = 0", "`0`", whole(1, 64)),
            ("packages_per_owner = 0", "`0`", whole(1, 10_000)),
            ("bytes_per_owner = 0", "`0`", whole(1, 1 << 50)),
            ("store_bytes = 0", "`0`", whole(1, 1 << 50)),
            ("disk_reserve = -1", "`-1`", whole(0, 1 << 50)),
            ("requests_per_second = -1", "`-1`", whole(0, 1_000_000)),
            ("request_burst = 0", "`0`", whole(1, 1_000_000)),
            ("connections = 0", "`0`", whole(1, 1_000_000)),
            ("connections_per_address = 0", "`0`", whole(1, 1_000_000)),
            ("rooms = 0", "`0`", whole(1, 1_000_000)),
            ("rooms = 1000001", "`1000001`", whole(1, 1_000_000)),
            ("rooms = \"5\"", "\"5\"", whole(1, 1_000_000)),
            ("rooms = 1.5", "`1.5`", whole(1, 1_000_000)),
            ("rooms_per_owner = 0", "`0`", whole(1, 1_000_000)),
            ("waiting_per_room = 0", "`0`", whole(1, 1024)),
            ("sdp_bytes = 0", "`0`", whole(1024, 1 << 20)),
            ("room_lifetime = 0.5", "`0.5`", time(60.0, 315_360_000)),
            ("answer_within = 0", "`0`", time(0.1, 60)),
            ("head_within = 0.0", "`0.0`", time(0.1, 600)),
            ("request_within = 0", "`0`", time(0.1, 600)),
            ("pause = -1", "`-1`", time(0.1, 600)),
            ("pause = nan", "`NaN`", time(0.1, 600)),
            ("pause = \"a while\"", "\"a while\"", time(0.1, 600)),
            ("upload_within = 0", "`0`", time(1.0, 86_400)),
            ("behind_proxy = 1", "`1`", "expected a boolean".to_owned()),
            ("spool = 1", "`1`", "expected path string".to_owned()),
            (
                "room = 6",
                "`room`",
                "expected one of `package_bytes`".to_owned(),
            ),
        ] {
            let text = format!("# mine\n{line}\n");
            let wrong = toml::from_str::<Limits>(&text).expect_err(line).to_string();
            for part in ["line 2", line, value, &expected] {
                assert!(wrong.contains(part), "{line}: no {part} in: {wrong}");
            }
            for rust in ["usize", "u32", "u64", "f64"] {
                assert!(!wrong.contains(rust), "{line}: {rust} in: {wrong}");
            }
        }
    }

    #[test]
    fn limits_at_the_ends_of_their_ranges_are_taken() {
        let text = "requests_per_second = 0\nrooms = 1\npause = 0.1\nupload_within = 86400\n";
        let limits: Limits = toml::from_str(text).expect("limits");
        assert_eq!((limits.requests_per_second, limits.rooms), (0, 1));
        assert_eq!(limits.pause.as_millis(), 100);
        assert_eq!(limits.upload_within.as_secs(), 86_400);
    }
}
