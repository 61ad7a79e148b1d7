//! The server's relay: in its own process or in another one, which has the same secret.

use crate::{ServerError, TurnConfig};
#[cfg(feature = "tls")]
use std::net::SocketAddr;
#[cfg(feature = "tls")]
use std::path::Path;
#[cfg(feature = "tls")]
use std::sync::Arc;
use turn_server::{Key, TurnServer};

/// A relay without a server.
#[cfg(feature = "tls")]
#[derive(Debug)]
pub struct Relay {
    turn: TurnServer,
    /// Ends the watching of the certificate.
    _watching: tokio_util::sync::DropGuard,
}

#[cfg(feature = "tls")]
impl Relay {
    /// Relays for whoever has credentials of a server with this secret, over TLS, too, where there is a certificate (and its key, PEM files). Ends when it is dropped.
    /// To be called in a Tokio runtime.
    ///
    /// # Errors
    /// If the address or the certificate cannot be used.
    pub fn start(
        secret: &crate::Secret,
        turn: &TurnConfig,
        tls: Option<(&Path, &Path)>,
    ) -> Result<Self, ServerError> {
        let stopping = tokio_util::sync::CancellationToken::new();
        let tls = tls
            .map(|(certificate, key)| crate::tls::load(certificate, key, &stopping))
            .transpose()?;
        Ok(Self {
            turn: start(crate::token::turn_key(secret), turn, tls)?,
            _watching: stopping.drop_guard(),
        })
    }

    /// Where it listens, with the port it was given.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.turn.address()
    }
}

/// Starts the TURN server.
pub(crate) fn start(
    key: Key,
    turn: &TurnConfig,
    #[cfg(feature = "tls")] tls: Option<Arc<rustls::ServerConfig>>,
) -> Result<TurnServer, ServerError> {
    let mut settings = turn_server::Config::new(turn.listen, key);
    settings.external = turn.external;
    settings.private_peers = turn.private_peers;
    settings.limits = turn.limits.clone();
    #[cfg(feature = "tls")]
    {
        settings.tls = tls.map(for_turn);
    }
    Ok(TurnServer::start(settings)?)
}

/// The certificate without HTTP's protocols, which a TURN client does not offer.
#[cfg(feature = "tls")]
fn for_turn(tls: Arc<rustls::ServerConfig>) -> Arc<rustls::ServerConfig> {
    let mut tls = Arc::unwrap_or_clone(tls);
    tls.alpn_protocols = vec![b"stun.turn".to_vec()];
    Arc::new(tls)
}
