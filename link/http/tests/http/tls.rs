use std::{fs, net::TcpListener, path::Path};

use axum::Router;
use axum_server::tls_rustls::RustlsConfig;
use link_http::{Client, HttpError};
use link_protocol::RoomLink;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};

use crate::server::{TOKEN, status};

/// A server whose certificate an authority of its own has signed; that authority's certificate as PEM.
async fn start() -> (RoomLink, String) {
    let mut authority = CertificateParams::new([]).expect("parameters");
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let authority = CertifiedIssuer::self_signed(authority, KeyPair::generate().expect("a key"))
        .expect("an authority");
    let key = KeyPair::generate().expect("a key");
    let own = CertificateParams::new(["localhost".to_owned()]).expect("parameters");
    let own = own.signed_by(&key, &authority).expect("a certificate");
    let _ = rustls::crypto::ring::default_provider().install_default();
    let config = RustlsConfig::from_pem(own.pem().into(), key.serialize_pem().into())
        .await
        .expect("TLS");
    let socket = TcpListener::bind("127.0.0.1:0").expect("a port");
    socket.set_nonblocking(true).expect("for tokio");
    let port = socket.local_addr().expect("bound").port();
    let router = Router::new().fallback(async || status(503, "no sender there"));
    let server = axum_server::from_tcp_rustls(socket, config).expect("a server");
    tokio::spawn(server.serve(router.into_make_service()));
    (
        format!("https://localhost:{port}/rooms/R#{TOKEN}")
            .parse()
            .expect("a link"),
        authority.pem(),
    )
}

#[tokio::test]
async fn a_server_is_trusted_with_its_authoritys_certificate_and_not_without() {
    let (link, authority) = start().await;
    let error = Client::new(None)
        .expect("a client")
        .announcement(&link)
        .await
        .expect_err("a stranger");
    assert!(matches!(error, HttpError::Untrusted { .. }), "{error:?}");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("authority.pem");
    fs::write(&file, authority).expect("written");
    let client = Client::new(Some(&file)).expect("a client");
    assert_eq!(
        client.announcement(&link).await.expect("trusted"),
        None,
        "an answer"
    );
}

#[tokio::test]
async fn a_server_without_tls_is_told_from_one_with_a_wrong_certificate() {
    let socket = tokio::net::TcpListener::bind("127.0.0.1:0");
    let socket = socket.await.expect("a port");
    let port = socket.local_addr().expect("bound").port();
    let router = Router::new().fallback(async || status(503, "no sender there"));
    tokio::spawn(async move { axum::serve(socket, router).await });
    let link: RoomLink = format!("https://localhost:{port}/rooms/R#{TOKEN}")
        .parse()
        .expect("a link");
    let client = Client::new(None).expect("a client");
    let error = client.announcement(&link).await.expect_err("no TLS");
    assert!(matches!(error, HttpError::NoTls { .. }), "{error:?}");
}

#[test]
fn a_file_that_holds_no_certificate_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("none.pem");
    let refused = |path: &Path| {
        let error = Client::new(Some(path)).expect_err("no certificate");
        assert!(
            matches!(&error, HttpError::RootCertificate { path: named, .. } if named == path),
            "{error:?}"
        );
    };
    refused(&path);
    for text in [
        "",
        "no PEM",
        "-----BEGIN CERTIFICATE-----\n####\n-----END CERTIFICATE-----\n",
    ] {
        fs::write(&path, text).expect("written");
        refused(&path);
    }
}
