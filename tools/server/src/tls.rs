//! TLS by rustls, from PEM files, which are read again when they change: certificates are renewed every few weeks.

use crate::ServerError;
use rustls::ServerConfig;
use rustls::crypto::ring;
use rustls::pki_types::pem::{self, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, SystemTime};
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;

/// Between two looks whether the files have changed.
const LOOK: Duration = Duration::from_secs(2);

/// Reads a certificate chain and its key, and watches both files until the server stops. To be called in a Tokio runtime.
pub(crate) fn load(
    certificate: &Path,
    key: &Path,
    stopping: &CancellationToken,
) -> Result<Arc<ServerConfig>, ServerError> {
    let files = Files {
        certificate: certificate.to_path_buf(),
        key: key.to_path_buf(),
    };
    // Before they are read: what is written meanwhile is read again.
    let written = files.written();
    let current = Arc::new(Current(RwLock::new(files.read()?)));
    let mut config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(|e| unusable(certificate, e.to_string()))?
        .with_no_client_auth()
        .with_cert_resolver(Arc::clone(&current) as Arc<dyn ResolvesServerCert>);
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    let watching = files.watch(written, current);
    tokio::spawn(stopping.clone().run_until_cancelled_owned(watching));
    Ok(Arc::new(config))
}

/// The certificate that new connections are shown.
#[derive(Debug)]
struct Current(RwLock<Arc<CertifiedKey>>);

impl ResolvesServerCert for Current {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        let current = self.0.read().unwrap_or_else(PoisonError::into_inner);
        Some(Arc::clone(&current))
    }
}

struct Files {
    certificate: PathBuf,
    key: PathBuf,
}

impl Files {
    fn read(&self) -> Result<Arc<CertifiedKey>, ServerError> {
        let Self { certificate, key } = self;
        let unread = |path: &Path, wanted: &str, e: pem::Error| match e {
            pem::Error::Io(e) => unusable(path, e.to_string()),
            pem::Error::NoItemsFound => unusable(path, format!("there is no {wanted} in it")),
            other => unusable(path, other.to_string()),
        };
        let chain: Vec<CertificateDer<'static>> = CertificateDer::pem_file_iter(certificate)
            .and_then(Iterator::collect)
            .map_err(|e| unread(certificate, "PEM certificate", e))?;
        if chain.is_empty() {
            let e = pem::Error::NoItemsFound;
            return Err(unread(certificate, "PEM certificate", e));
        }
        let private =
            PrivateKeyDer::from_pem_file(key).map_err(|e| unread(key, "PEM private key", e))?;
        let provider = ring::default_provider();
        let pair = CertifiedKey::from_der(chain, private, &provider).map_err(|e| match e {
            rustls::Error::InconsistentKeys(_) => unusable(
                key,
                format!("it is not the key of {}", certificate.display()),
            ),
            other => unusable(certificate, other.to_string()),
        })?;
        Ok(Arc::new(pair))
    }

    /// When each was written last.
    fn written(&self) -> [Option<SystemTime>; 2] {
        [&self.certificate, &self.key].map(|path| fs::metadata(path).ok()?.modified().ok())
    }

    /// Reads them again when they have changed. While they do not fit together, as between two writes, the present ones stay.
    async fn watch(self, mut known: [Option<SystemTime>; 2], current: Arc<Current>) {
        let mut is_told = false;
        loop {
            sleep(LOOK).await;
            let written = self.written();
            if written == known {
                continue;
            }
            match self.read() {
                Ok(pair) => {
                    *current.0.write().unwrap_or_else(PoisonError::into_inner) = pair;
                    known = written;
                    is_told = false;
                    log::info!("the certificate was renewed: new connections are shown it");
                }
                Err(error) if !std::mem::replace(&mut is_told, true) => {
                    log::error!(
                        "the certificate has changed and cannot be used, the one before stays: {error}"
                    );
                }
                Err(_) => {}
            }
        }
    }
}

fn unusable(path: &Path, reason: String) -> ServerError {
    ServerError::Certificate {
        path: path.to_path_buf(),
        reason,
    }
}
