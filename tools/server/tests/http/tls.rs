//! TLS with a certificate made for the test.

use crate::support::{Outcome, PATIENCE, TestServer, config};
use rcgen::{CertifiedKey, generate_simple_self_signed};
use reqwest::StatusCode;
use rustls::{ClientConfig, RootCertStore};
use server::{Server, StoreConfig, TurnConfig};
use std::sync::Arc;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;

#[tokio::test(flavor = "multi_thread")]
async fn with_a_certificate_the_server_speaks_tls_and_nothing_else() -> Outcome {
    let files = tempfile::tempdir()?;
    let (certificate, key) = (files.path().join("cert.pem"), files.path().join("key.pem"));
    let CertifiedKey { cert, signing_key } = generate_simple_self_signed(["localhost".to_owned()])?;
    std::fs::write(&certificate, cert.pem())?;
    std::fs::write(&key, signing_key.serialize_pem())?;
    let server = TestServer::start_with(|c| {
        c.tls = Some((certificate, key));
        c.limits.head_within = std::time::Duration::from_secs(1);
        c.turn = Some(TurnConfig::new(([127, 0, 0, 1], 0).into()));
    })
    .await?;
    let port = server.server.address().port();
    let trusting = reqwest::Client::builder()
        .tls_certs_only([reqwest::Certificate::from_pem(cert.pem().as_bytes())?])
        .resolve("localhost", server.server.address())
        .build()?;
    let url = format!("https://localhost:{port}/healthz");
    let answer = trusting.get(&url).send().await?;
    assert_eq!(answer.status(), StatusCode::OK, "over TLS");
    assert_eq!(answer.text().await?, "ok", "over TLS");
    let stranger = reqwest::Client::builder()
        .resolve("localhost", server.server.address())
        .build()?;
    assert!(
        stranger.get(&url).send().await.is_err(),
        "a stranger does not trust it"
    );
    let plain = server.caller.get("/healthz", "").await;
    assert!(plain.is_err(), "no plain HTTP on the same port");
    // So does the relay, beside plain TCP on the same port: both tell a client its own address.
    let relay = server.server.turn_address().ok_or("no relay")?;
    let mut roots = RootCertStore::empty();
    roots.add(cert.der().clone())?;
    let client = ClientConfig::builder()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let connector = TlsConnector::from(Arc::new(client));
    let secure = connector
        .connect("localhost".try_into()?, TcpStream::connect(relay).await?)
        .await?;
    asks_stun(secure).await?;
    asks_stun(TcpStream::connect(relay).await?).await?;
    // A connection that never shakes hands is closed.
    let mut silent = TcpStream::connect(server.server.address()).await?;
    let mut nothing = Vec::new();
    let read = tokio::time::timeout(PATIENCE, silent.read_to_end(&mut nothing)).await?;
    assert!(read.is_err() || nothing.is_empty(), "closed");
    server.server.stop().await;
    Ok(())
}

/// Asks for this side's address as STUN does.
async fn asks_stun(mut stream: impl AsyncRead + AsyncWrite + Unpin) -> Outcome {
    let transaction = *b"one of twelve".first_chunk::<12>().ok_or("twelve bytes")?;
    let mut request = vec![0, 1, 0, 0, 0x21, 0x12, 0xA4, 0x42];
    request.extend(transaction);
    stream.write_all(&request).await?;
    stream.flush().await?;
    let mut answer = [0; 20];
    tokio::time::timeout(PATIENCE, stream.read_exact(&mut answer)).await??;
    assert_eq!(answer[..2], [1, 1], "a success");
    assert_eq!(answer[8..], transaction, "of this request");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_certificate_that_cannot_be_used_is_named() -> Outcome {
    let files = tempfile::tempdir()?;
    let at = |name: &str| files.path().join(name);
    let first = generate_simple_self_signed(["localhost".to_owned()])?;
    let second = generate_simple_self_signed(["localhost".to_owned()])?;
    std::fs::write(at("cert.pem"), first.cert.pem())?;
    std::fs::write(at("other-key.pem"), second.signing_key.serialize_pem())?;
    std::fs::write(at("empty.pem"), "")?;
    for (certificate, key, named, why) in [
        (
            "missing.pem",
            "other-key.pem",
            "missing.pem",
            "No such file",
        ),
        ("cert.pem", "missing.pem", "missing.pem", "No such file"),
        (
            "empty.pem",
            "other-key.pem",
            "empty.pem",
            "no PEM certificate",
        ),
        ("cert.pem", "empty.pem", "empty.pem", "no PEM private key"),
        (
            "cert.pem",
            "other-key.pem",
            "other-key.pem",
            "not the key of",
        ),
    ] {
        let mut config = config(StoreConfig::Local(at("store")))?;
        config.tls = Some((at(certificate), at(key)));
        let error = Server::start(config)
            .await
            .err()
            .ok_or("it started")?
            .to_string();
        assert!(
            error.contains(named) && error.contains(why),
            "{certificate} {key}: {error}"
        );
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_address_in_use_is_named() -> Outcome {
    let first = TestServer::start().await?;
    let folder = tempfile::tempdir()?;
    let mut config = config(StoreConfig::Local(folder.path().to_path_buf()))?;
    config.listen = first.server.address();
    let error = Server::start(config)
        .await
        .err()
        .ok_or("it started")?
        .to_string();
    assert!(
        error.contains(&first.server.address().to_string()),
        "{error}"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_renewed_certificate_is_shown_and_one_that_does_not_fit_is_not() -> Outcome {
    let files = tempfile::tempdir()?;
    let (certificate, key) = (files.path().join("cert.pem"), files.path().join("key.pem"));
    let made = || generate_simple_self_signed(["localhost".to_owned()]);
    let (first, second) = (made()?, made()?);
    std::fs::write(&certificate, first.cert.pem())?;
    std::fs::write(&key, first.signing_key.serialize_pem())?;
    let server =
        TestServer::start_with(|c| c.tls = Some((certificate.clone(), key.clone()))).await?;
    let address = server.server.address();
    let url = format!("https://localhost:{}/healthz", address.port());
    let is_shown = async |pem: String| -> Outcome<bool> {
        // A connection of its own: those that are open keep what they were shown.
        let client = reqwest::Client::builder()
            .tls_certs_only([reqwest::Certificate::from_pem(pem.as_bytes())?])
            .resolve("localhost", address)
            .build()?;
        Ok(client.get(&url).send().await.is_ok())
    };
    assert!(is_shown(first.cert.pem()).await?, "the first");
    // Half of a renewal, for longer than the files are left alone.
    std::fs::write(&certificate, second.cert.pem())?;
    tokio::time::sleep(std::time::Duration::from_secs(5)).await;
    assert!(is_shown(first.cert.pem()).await?, "they do not fit");
    std::fs::write(&key, second.signing_key.serialize_pem())?;
    let begun = std::time::Instant::now();
    while !is_shown(second.cert.pem()).await? {
        assert!(begun.elapsed() < PATIENCE, "it is never shown");
        tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    }
    assert!(!is_shown(first.cert.pem()).await?, "the first is gone");
    Ok(())
}
