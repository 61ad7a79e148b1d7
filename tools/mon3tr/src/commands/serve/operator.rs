//! What an operator may want of a server besides a folder of packages and plain HTTP.

use anyhow::Context;
use server::{Config, Limits, StoreConfig};
use std::path::PathBuf;

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
    fn a_limit_that_is_none_is_named() {
        let wrong = toml::from_str::<Limits>("rooms = 5\nroom = 6\n").expect_err("unknown");
        assert!(wrong.to_string().contains("`room`"), "{wrong}");
        let wrong = toml::from_str::<Limits>("pause = -1\n").expect_err("no time");
        assert!(wrong.to_string().contains("-1"), "{wrong}");
    }
}
