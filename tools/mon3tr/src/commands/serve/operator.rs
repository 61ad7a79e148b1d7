//! What an operator may want of a server besides a folder of packages and plain HTTP.

use server::{Config, StoreConfig};
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
    /// The certificate's private key (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
}

impl OperatorOptions {
    /// Sets a server up for them.
    pub(super) fn set(&self, config: &mut Config) {
        if let Some(bucket) = &self.s3 {
            config.store = StoreConfig::S3 {
                bucket: bucket.clone(),
                endpoint: self.s3_endpoint.clone(),
                region: self.s3_region.clone(),
            };
        }
        config.nats.clone_from(&self.nats);
        config.tls = self.tls_cert.clone().zip(self.tls_key.clone());
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
