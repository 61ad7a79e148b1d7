//! The server's relay: in its own process or in another one, which has the same secret.

#[cfg(feature = "tls")]
use crate::admission::Admission;
#[cfg(feature = "tls")]
use crate::blocked::Blocked;
#[cfg(feature = "tls")]
use crate::revoked::Revoked;
use crate::{ServerError, TurnConfig};
#[cfg(feature = "tls")]
use std::net::SocketAddr;
#[cfg(feature = "tls")]
use std::path::Path;
use std::sync::Arc;
use turn_server::{Key, TurnServer};

/// A relay without a server.
#[cfg(feature = "tls")]
#[derive(Debug)]
pub struct Relay {
    turn: Arc<TurnServer>,
    /// Ends the watching of the certificate and of the lists.
    _watching: tokio_util::sync::DropGuard,
}

#[cfg(feature = "tls")]
impl Relay {
    /// Relays for the holders of credentials of a server with this secret, over TLS, too, where there is a certificate
    /// (and its key, PEM files). In `folder` the files `revoked` and `blocked` list tokens and addresses that are not
    /// served. Ends when it is dropped. To be called in a Tokio runtime.
    ///
    /// # Errors
    /// If the address, the certificate or a list cannot be used.
    pub fn start(
        secret: &crate::Secret,
        turn: &TurnConfig,
        folder: &Path,
        tls: Option<(&Path, &Path)>,
    ) -> Result<Self, ServerError> {
        let stopping = tokio_util::sync::CancellationToken::new();
        let admission = Arc::new(Admission {
            revoked: Arc::new(Revoked::open(Some(folder.join("revoked")))?),
            blocked: Arc::new(Blocked::open(Some(folder.join("blocked")))?),
            rooms: None,
        });
        let tls = tls
            .map(|(certificate, key)| crate::tls::load(certificate, key, &stopping))
            .transpose()?;
        let key = crate::token::turn_key(secret);
        let turn = Arc::new(start(key, turn, Arc::clone(&admission) as _, tls)?);
        let of_lists = Arc::downgrade(&turn);
        tokio::spawn(admission.watch(stopping.clone(), move |_, _| {
            if let Some(turn) = of_lists.upgrade() {
                turn.end_refused();
            }
        }));
        Ok(Self {
            turn,
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
    admission: Arc<dyn turn_server::Admission>,
    #[cfg(feature = "tls")] tls: Option<Arc<rustls::ServerConfig>>,
) -> Result<TurnServer, ServerError> {
    let mut settings = turn_server::Config::new(turn.listen, key);
    settings.external = turn.external;
    settings.private_peers = turn.private_peers;
    settings.limits = turn.limits.clone();
    settings.admission = admission;
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
