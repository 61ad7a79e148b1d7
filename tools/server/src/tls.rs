//! TLS by rustls, from PEM files.

use crate::ServerError;
use rustls::ServerConfig;
use rustls::crypto::ring;
use rustls::pki_types::pem::{self, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use std::path::Path;
use std::sync::Arc;

/// Reads a certificate chain and its key.
pub(crate) fn load(certificate: &Path, key: &Path) -> Result<Arc<ServerConfig>, ServerError> {
    let unusable = |path: &Path, reason: String| ServerError::Certificate {
        path: path.to_path_buf(),
        reason,
    };
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
    let mut config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(|e| unusable(certificate, e.to_string()))?
        .with_no_client_auth()
        .with_single_cert(chain, private)
        .map_err(|e| match e {
            rustls::Error::InconsistentKeys(_) => unusable(
                key,
                format!("it is not the key of {}", certificate.display()),
            ),
            other => unusable(certificate, other.to_string()),
        })?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(Arc::new(config))
}
