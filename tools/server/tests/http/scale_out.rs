//! Several instances on one NATS server and one S3-compatible store, both real, all processes of their own.

use crate::child::{Orders, ServerProcess};
use crate::support::{Caller, Outcome, PATIENCE, TestServer, package};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use test_support::service::{Service, assert_all_live, attended, listener};

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

fn nats(program: &Path, port: u16, log: &Path) -> Service {
    let mut command = Command::new(program);
    command.args(["-a", "127.0.0.1", "-p", &port.to_string()]);
    listener("nats-server", &mut command, port, log)
}

/// What the instances share.
struct Cluster {
    orders: Orders,
    nats: Service,
    nats_program: PathBuf,
    nats_port: u16,
    moto: Service,
    folder: TempDir,
}

impl Cluster {
    async fn start(nats_program: &Path, python: &Path) -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let (nats_port, moto_port) = (free_port()?, free_port()?);
        let nats = nats(nats_program, nats_port, &folder.path().join("nats.log"));
        let mut command = Command::new(python);
        command.args(["-m", "moto.server", "-H", "127.0.0.1", "-p"]);
        command.arg(moto_port.to_string());
        let log = folder.path().join("moto.log");
        let moto = listener("moto", &mut command, moto_port, &log);
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
            nats_program: nats_program.to_owned(),
            nats_port,
            moto,
            folder,
        })
    }

    async fn instance(&self) -> Outcome<ServerProcess> {
        let instance = ServerProcess::start(&self.orders).await?;
        healthy(&instance.caller).await?;
        Ok(instance)
    }
}

/// Polls `/readyz` until it answers as expected.
async fn told(caller: &Caller, wished: StatusCode) -> Outcome<String> {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE {
        let answer = caller.get("/readyz", "").await?;
        if answer.status() == wished {
            return Ok(answer.text().await?);
        }
        assert_all_live();
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    Err(format!("an instance never answers {wished}").into())
}

async fn healthy(caller: &Caller) -> Outcome {
    told(caller, StatusCode::OK).await.map(drop)
}

async fn unwell(caller: &Caller) -> Outcome<String> {
    told(caller, StatusCode::SERVICE_UNAVAILABLE).await
}

#[test]
fn a_sender_on_one_instance_meets_viewers_on_others_and_outlives_an_instance_nats_and_the_store() {
    let Some((nats_program, python)) = programs() else {
        return;
    };
    attended(|| {
        let runtime = tokio::runtime::Runtime::new().expect("a runtime");
        let outlived = runtime.block_on(outlives_all(&nats_program, &python));
        outlived.unwrap_or_else(|why| panic!("{why}"));
    });
}

async fn outlives_all(nats_program: &Path, python: &Path) -> Outcome {
    let mut cluster = Cluster::start(nats_program, python).await?;
    let (one, mut two) = (cluster.instance().await?, cluster.instance().await?);
    let (first, second) = (&one.caller, two.caller.clone());

    // What one stores the other serves.
    let room = first.room("ada").await?;
    let absent = second.join(&room).await?;
    assert_eq!(
        absent.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "no sender is there yet"
    );
    let mut sender = first.enter(&room).await?;
    let told: Value = second.get(&room.path(), &room.viewer).await?.json().await?;
    assert_eq!(
        told["avatar"]["sha256"],
        package().hash,
        "announced everywhere"
    );

    let read = second.get(&package().path(), &room.viewer).await?;
    assert!(
        read.bytes().await? == package().bytes,
        "through the other instance"
    );
    let eve = second.empty_room("eve").await?;
    let foreign = second.get(&package().path(), &eve.viewer).await?;
    assert_eq!(
        foreign.status(),
        StatusCode::SERVICE_UNAVAILABLE,
        "nobody shows it in Eve's room"
    );
    let part = second.request(Method::GET, &package().path(), &room.viewer);
    let part = part.header("range", "bytes=10-19").send().await?;
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT, "in parts");
    assert_eq!(
        part.bytes().await?,
        package().bytes[10..20],
        "the right part"
    );

    // A viewer on the other instance; the sender's answer goes there, as a balancer may send it.
    let session = second.meet(&room, &mut sender).await?;
    second.part(&room, &session, &mut sender).await?;
    let never = "0".repeat(32);
    assert_eq!(
        second.answer(&room, &never).await?,
        StatusCode::NOT_FOUND,
        "no viewer waits"
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
    cluster.nats.kill();
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

    // A sender that enters meanwhile is served here, and shared later.
    let mut sender = first.enter(&room).await?;
    first.meet(&room, &mut sender).await?;

    // NATS comes back, and with it the others' rooms, without the sender doing anything.
    let log = cluster.folder.path().join("nats.log");
    cluster.nats = nats(&cluster.nats_program, cluster.nats_port, &log);
    healthy(first).await?;
    healthy(&three.caller).await?;
    three.caller.meet(&room, &mut sender).await?;

    // The store dies: calls go on without it.
    cluster.moto.kill();
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
    let answer = caller.get("/readyz", "").await?;
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
