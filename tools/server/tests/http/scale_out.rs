//! Several instances on one NATS server and one S3-compatible store, both real, all processes of their own.

use crate::child::{Orders, Process, ServerProcess};
use crate::support::{Caller, Outcome, TestServer, package};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpStream;

/// The programs that `./run test` provides: where `nats-server` is, and a Python that has moto's server.
fn programs() -> Option<(PathBuf, PathBuf)> {
    let found = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let both = found("MON3TR_NATS_SERVER").zip(found("MON3TR_PYTHON"));
    if both.is_none() {
        println!(
            "skipped: MON3TR_NATS_SERVER and MON3TR_PYTHON do not say where nats-server and moto are"
        );
        assert_ne!(
            std::env::var("CI").as_deref(),
            Ok("true"),
            "CI must have both"
        );
    }
    both
}

fn free_port() -> Outcome<u16> {
    Ok(TcpListener::bind("127.0.0.1:0")?.local_addr()?.port())
}

/// A program of somebody else's that listens on a port; killed when dropped.
async fn listener(program: &Path, arguments: &[&str], port: u16) -> Outcome<Process> {
    let child = Command::new(program)
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    let mut process = Process(child);
    for _ in 0..600 {
        if TcpStream::connect(("127.0.0.1", port)).await.is_ok() {
            return Ok(process);
        }
        if let Some(status) = process.0.try_wait()? {
            return Err(format!("{} ended with {status}", program.display()).into());
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    Err(format!("{} does not listen", program.display()).into())
}

async fn nats(program: &Path, port: u16) -> Outcome<Process> {
    listener(program, &["-a", "127.0.0.1", "-p", &port.to_string()], port).await
}

/// What the instances share.
struct Cluster {
    orders: Orders,
    nats: Process,
    nats_program: PathBuf,
    nats_port: u16,
    moto: Process,
    _folder: TempDir,
}

impl Cluster {
    async fn start(nats_program: PathBuf, python: &Path) -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let (nats_port, moto_port) = (free_port()?, free_port()?);
        let nats = nats(&nats_program, nats_port).await?;
        let port = moto_port.to_string();
        let arguments = ["-m", "moto.server", "-H", "127.0.0.1", "-p", &port];
        let moto = listener(python, &arguments, moto_port).await?;
        let endpoint = format!("http://127.0.0.1:{moto_port}");
        let caller = Caller::new(
            SocketAddr::from(([127, 0, 0, 1], 0)),
            server::Secret::random()?,
        )?;
        let made = caller
            .client
            .put(format!("{endpoint}/avatars"))
            .send()
            .await?;
        assert!(made.status().is_success(), "the bucket: {}", made.status());
        let orders = Orders {
            secret: folder.path().join("secret"),
            spool: Some(folder.path().to_path_buf()),
            s3: Some(("avatars".to_owned(), endpoint)),
            nats: Some(format!("nats://127.0.0.1:{nats_port}")),
            ..Orders::default()
        };
        Ok(Self {
            orders,
            nats,
            nats_program,
            nats_port,
            moto,
            _folder: folder,
        })
    }

    async fn instance(&self) -> Outcome<ServerProcess> {
        let instance = ServerProcess::start(&self.orders).await?;
        healthy(&instance.caller).await?;
        Ok(instance)
    }
}

async fn healthy(caller: &Caller) -> Outcome {
    for _ in 0..300 {
        if caller.get("/healthz", "").await?.status() == StatusCode::OK {
            return Ok(());
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    Err("an instance does not become healthy".into())
}

async fn unwell(caller: &Caller) -> Outcome<String> {
    for _ in 0..300 {
        let answer = caller.get("/healthz", "").await?;
        if answer.status() == StatusCode::SERVICE_UNAVAILABLE {
            return Ok(answer.text().await?);
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    Err("an instance does not notice that something is gone".into())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sender_on_one_instance_meets_viewers_on_others_and_outlives_an_instance_nats_and_the_store()
-> Outcome {
    let Some((nats_program, python)) = programs() else {
        return Ok(());
    };
    let mut cluster = Cluster::start(nats_program, &python).await?;
    let (one, mut two) = (cluster.instance().await?, cluster.instance().await?);
    let (first, second) = (&one.caller, two.caller.clone());

    // What one stores the other serves.
    let room = first.room("ada").await?;
    let read = second.get(&package().path(), &room.viewer).await?;
    assert!(
        read.bytes().await? == package().bytes,
        "through the other instance"
    );
    let eve = second.empty_room("eve").await?;
    let foreign = second.get(&package().path(), &eve.viewer).await?;
    assert_eq!(
        foreign.status(),
        StatusCode::NOT_FOUND,
        "owners are apart there, too"
    );
    let part = second.request(Method::GET, &package().path(), &room.viewer);
    let part = part.header("range", "bytes=10-19").send().await?;
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT, "in parts");
    assert_eq!(
        part.bytes().await?,
        package().bytes[10..20],
        "the right part"
    );

    let absent = second.join(&room).await?;
    assert_eq!(
        absent.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "nobody is there yet"
    );
    let mut sender = first.enter(&room).await?;
    let told: Value = second.get(&room.path(), &room.viewer).await?.json().await?;
    assert_eq!(
        told["avatar"]["sha256"],
        package().hash,
        "announced everywhere"
    );

    // A viewer on the other instance; the sender's answer goes there, as a balancer may send it.
    let session = second.meet(&room, &mut sender).await?;
    second.part(&room, &session, &mut sender).await?;
    let never = "0".repeat(32);
    assert_eq!(
        second.answer(&room, &never).await?,
        StatusCode::NOT_FOUND,
        "nobody waits"
    );
    first.meet(&room, &mut sender).await?;

    // The sender comes to the other instance: it is there now, and nowhere else.
    let mut moved = second.enter(&room).await?;
    assert_eq!(
        sender.next().await?,
        Some(("replaced".into(), json!({}))),
        "across instances"
    );
    assert_eq!(sender.next().await?, None, "ended");
    first.meet(&room, &mut moved).await?;

    // That instance dies. The sender comes back by the one that is left, and newcomers get in by it and by a new one.
    two.process.kill_9();
    assert!(
        moved.next().await.map_or(true, |event| event.is_none()),
        "the stream broke"
    );
    let mut sender = first.enter(&room).await?;
    first.meet(&room, &mut sender).await?;
    let three = cluster.instance().await?;
    three.caller.meet(&room, &mut sender).await?;
    let read = three.caller.get(&package().path(), &room.viewer).await?;
    assert!(
        read.bytes().await? == package().bytes,
        "a newcomer has the avatar"
    );

    // NATS dies: every instance says so and serves the rooms it has.
    cluster.nats.kill_9();
    assert!(unwell(first).await?.contains("NATS"), "says what is wrong");
    assert!(
        unwell(&three.caller).await?.contains("NATS"),
        "says what is wrong"
    );
    first.meet(&room, &mut sender).await?;
    let elsewhere = three.caller.join(&room).await?;
    assert_eq!(
        elsewhere.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "it cannot know"
    );
    assert!(
        elsewhere.text().await?.contains("other servers"),
        "and says so"
    );

    // A sender that comes just now is served here, and shared later.
    let mut sender = first.enter(&room).await?;
    first.meet(&room, &mut sender).await?;

    // NATS comes back, and with it the others' rooms, without the sender doing anything.
    cluster.nats = nats(&cluster.nats_program, cluster.nats_port).await?;
    healthy(first).await?;
    healthy(&three.caller).await?;
    three.caller.meet(&room, &mut sender).await?;

    // The store dies: calls go on without it.
    cluster.moto.kill_9();
    let why = unwell(first).await?;
    assert!(why.contains("package store"), "says what is wrong: {why}");
    let read = first.get(&package().path(), &room.viewer).await?;
    assert_eq!(
        read.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "no packages"
    );
    three.caller.meet(&room, &mut sender).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_whose_nats_is_down_from_the_start_says_so_and_serves_its_own_rooms() -> Outcome {
    let nowhere = format!("nats://127.0.0.1:{}", free_port()?);
    let server = TestServer::start_with(|c| c.nats = Some(nowhere)).await?;
    let caller = &server.caller;
    let answer = caller.get("/healthz", "").await?;
    assert_eq!(answer.status(), StatusCode::SERVICE_UNAVAILABLE, "not well");
    assert!(answer.text().await?.contains("NATS"), "and why");
    let room = caller.room("ada").await?;
    let mut sender = caller.enter(&room).await?;
    caller.meet(&room, &mut sender).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_nats_address_that_is_none_is_an_error_that_keeps_its_password() -> Outcome {
    let started =
        TestServer::start_with(|c| c.nats = Some("nats://me:hunter2@:no port".into())).await;
    let error = started.err().ok_or("it started")?.to_string();
    assert!(
        error.contains("NATS") && !error.contains("hunter2"),
        "{error}"
    );
    Ok(())
}
