//! What can be tested only from outside a process: its death, its memory, its disk.

use crate::child::{Orders, ServerProcess};
use crate::support::{Outcome, PATIENCE, Package, files_below, package};
use futures_util::StreamExt;
use reqwest::{Method, StatusCode};
use sha2::{Digest, Sha256};
use spmm3::PARAMS;
use spmm3::networks::{Dense, MAX_NUMBERS};
use std::path::Path;
use std::time::Duration;
use synthetic_person::{Puppet, PuppetSize};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

fn orders(folder: &Path) -> Orders {
    Orders {
        folder: folder.join("store"),
        secret: folder.join("secret"),
        ..Orders::default()
    }
}

/// The most memory that the server has held so far; says that a test is skipped where the system does not tell.
fn measured(server: &ServerProcess) -> Outcome<Option<u64>> {
    let peak = server.peak_memory()?;
    if peak.is_none() {
        println!("skipped: this system does not tell a process's memory in /proc");
        assert_ne!(
            std::env::var("CI").as_deref(),
            Ok("true"),
            "CI must measure it"
        );
    }
    Ok(peak)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_killed_in_mid_upload_leaves_nothing_and_the_next_one_takes_the_package() -> Outcome
{
    let folder = tempfile::tempdir()?;
    let orders = orders(folder.path());
    let mut server = ServerProcess::start(&orders).await?;
    let owner = server.caller.owner("ada");
    let mut uploads = Vec::new();
    for _ in 0..3 {
        let mut stream = TcpStream::connect(server.caller.address).await?;
        let (path, size) = (package().path(), package().bytes.len());
        let head = format!(
            "PUT {path} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {owner}\r\nContent-Length: {size}\r\n\r\n"
        );
        stream.write_all(head.as_bytes()).await?;
        stream.write_all(&package().bytes[..size - 1]).await?;
        uploads.push(stream);
    }
    let sent = 3 * (package().bytes.len() as u64 - 1);
    let all_are_sent = async {
        let received = "mon3tr_package_bytes_received_total ";
        while server.caller.metric(received).await? < sent {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        Outcome::Ok(())
    };
    tokio::time::timeout(PATIENCE, all_are_sent).await??;
    server.process.kill_9();
    assert_eq!(
        files_below(&orders.folder)?,
        Vec::<String>::new(),
        "nothing is left"
    );
    let server = ServerProcess::start(&orders).await?;
    let path = package().path();
    let before = server.caller.get(&path, &owner).await?.status();
    assert_eq!(before, StatusCode::NOT_FOUND, "nothing half-stored");
    let put = server.caller.put_package(package(), &owner).await?;
    assert_eq!(
        put.status(),
        StatusCode::CREATED,
        "a token outlives its server"
    );
    let read = server.caller.get(&path, &owner).await?.bytes().await?;
    assert!(read == package().bytes, "whole");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_package_stored_before_kill_9_is_there_after_it() -> Outcome {
    let folder = tempfile::tempdir()?;
    let orders = orders(folder.path());
    let mut server = ServerProcess::start(&orders).await?;
    let owner = server.caller.owner("ada");
    let put = server.caller.put_package(package(), &owner).await?;
    assert_eq!(put.status(), StatusCode::CREATED, "stored");
    server.process.kill_9();
    let server = ServerProcess::start(&orders).await?;
    let read = server
        .caller
        .get(&package().path(), &owner)
        .await?
        .bytes()
        .await?;
    assert!(read == package().bytes, "whole");
    Ok(())
}

/// A package of 20 MB, put past the check (which has tests of its own) into the store of a server to be started.
fn big_package(store: &Path) -> Outcome<Package> {
    let mut bytes = Vec::with_capacity(20_000_000);
    let mut state = 1u64;
    while bytes.len() < 20_000_000 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        bytes.extend_from_slice(&state.to_le_bytes());
    }
    let package = Package::of(bytes);
    let record = store.join("records").join(&package.hash);
    std::fs::create_dir_all(&record)?;
    std::fs::create_dir_all(store.join("packages"))?;
    std::fs::write(record.join(server::Id::of_owner("ada").to_string()), "")?;
    std::fs::write(store.join("packages").join(&package.hash), &package.bytes)?;
    Ok(package)
}

#[tokio::test(flavor = "multi_thread")]
async fn two_hundred_downloads_at_once_are_whole_and_take_bounded_memory() -> Outcome {
    const DOWNLOADS: usize = 200;
    let folder = tempfile::tempdir()?;
    let orders = orders(folder.path());
    let package = big_package(&orders.folder)?;
    let (path, hash) = (package.path(), package.hash.clone());
    drop(package);
    let server = ServerProcess::start(&orders).await?;
    let owner = server.caller.owner("ada");
    server
        .caller
        .request(Method::HEAD, &path, &owner)
        .send()
        .await?;
    let Some(before) = measured(&server)? else {
        return Ok(());
    };
    // All are answered before any is read, so that the server holds whatever it holds for each.
    let mut answers = Vec::new();
    for _ in 0..DOWNLOADS {
        let request = server.caller.request(Method::GET, &path, &owner);
        // Of all of it; each part has its own, below.
        let answer = request.timeout(Duration::from_secs(3600)).send();
        let answer = tokio::time::timeout(PATIENCE, answer).await??;
        assert_eq!(answer.status(), StatusCode::OK, "answered");
        answers.push(answer);
    }
    let held = server.peak_memory()?.unwrap_or(0);
    let reading = answers.into_iter().map(|answer| {
        tokio::spawn(async move {
            let mut digest = Sha256::new();
            let mut body = answer.bytes_stream();
            while let Some(chunk) = tokio::time::timeout(PATIENCE, body.next()).await? {
                digest.update(&chunk?);
            }
            let text: String = digest
                .finalize()
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect();
            Outcome::Ok(text)
        })
    });
    for read in reading.collect::<Vec<_>>() {
        assert_eq!(read.await??, hash, "whole");
    }
    let after = server.peak_memory()?.unwrap_or(u64::MAX);
    let mib = |bytes: u64| bytes >> 20;
    println!(
        "{DOWNLOADS} downloads of 20 MB: peak memory {} MiB before, {} MiB when all were answered, {} MiB after",
        mib(before),
        mib(held),
        mib(after)
    );
    // The packages are 4000 MB together; what a connection may hold is 64 KiB and a chunk.
    let grown = after.saturating_sub(before);
    assert!(grown < 64 << 20, "the server grew by {} MiB", mib(grown));
    let sent = server
        .caller
        .metric("mon3tr_package_bytes_sent_total ")
        .await?;
    assert_eq!(sent, DOWNLOADS as u64 * 20_000_000, "counted");
    Ok(())
}

/// A small file whose check takes much memory: a graph of as many numbers as there may be, all alike.
fn most_numbers() -> Outcome<Package> {
    const HIDDEN: usize = 600_000;
    let mut puppet = Puppet::small();
    let network = &mut puppet.attributes;
    let bases = PuppetSize::SMALL.bases;
    let weights = vec![0.0; PARAMS * HIDDEN];
    network.first = Dense::new(PARAMS, HIDDEN, &weights, vec![0.0; HIDDEN])?;
    drop(weights);
    let same = *network.second.first().ok_or("no weights")?;
    network.second = vec![same; HIDDEN * bases];
    let numbers = HIDDEN * (PARAMS + bases);
    assert!(numbers > MAX_NUMBERS * 98 / 100, "nearly the most");
    Ok(Package::of(puppet.avatar().to_bytes()?))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_check_takes_no_more_memory_than_an_operator_is_told() -> Outcome {
    let folder = tempfile::tempdir()?;
    let orders = orders(folder.path());
    let server = ServerProcess::start(&orders).await?;
    let owner = server.caller.owner("ada");
    let put = server.caller.put_package(package(), &owner).await?;
    assert_eq!(put.status(), StatusCode::CREATED, "a small one");
    let Some(before) = measured(&server)? else {
        return Ok(());
    };
    let package = tokio::task::spawn_blocking(most_numbers).await??;
    let put = server.caller.put_package(&package, &owner).await?;
    assert_eq!(put.status(), StatusCode::CREATED, "an intact package");
    let grown = (server.peak_memory()?.unwrap_or(u64::MAX)).saturating_sub(before);
    println!(
        "the check of a package of {} KiB took {} MiB",
        package.bytes.len() >> 10,
        grown >> 20
    );
    // docs/operating.md says 1 GiB.
    assert!(
        (256 << 20..1 << 30).contains(&grown),
        "it took {} MiB",
        grown >> 20
    );
    Ok(())
}

/// Puts the package on a server whose disk is too small: a 507, nothing left, and the server goes on.
async fn is_refused_because_the_disk_is_full(server: &ServerProcess) -> Outcome {
    let caller = &server.caller;
    let owner = caller.owner("ada");
    for _ in 0..2 {
        let put = caller.put_package(package(), &owner).await?;
        assert_eq!(put.status(), StatusCode::INSUFFICIENT_STORAGE, "full");
        assert!(put.text().await?.contains("disk is full"), "in words");
    }
    let get = caller.get(&package().path(), &owner).await?.status();
    assert_eq!(get, StatusCode::NOT_FOUND, "nothing half-stored");
    let line = "mon3tr_uploads_refused_total{reason=\"DiskFull\"} ";
    assert_eq!(caller.metric(line).await?, 2, "counted");
    assert_eq!(
        caller.get("/healthz", "").await?.status(),
        StatusCode::OK,
        "it goes on"
    );
    caller.empty_room("ada").await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_the_file_size_limit_cuts_off_is_a_507_and_leaves_nothing() -> Outcome {
    let folder = tempfile::tempdir()?;
    let orders = orders(folder.path());
    // 32 KiB in sh's units of 512 bytes, or 64 KiB in bash's; ignored, the signal becomes an error of the write.
    let confine = "trap '' XFSZ; ulimit -f 64; exec \"$@\"";
    let server = ServerProcess::start_within(&orders, confine).await?;
    is_refused_because_the_disk_is_full(&server).await?;
    assert_eq!(
        files_below(&orders.folder)?,
        Vec::<String>::new(),
        "nothing is left"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_onto_a_full_disk_is_a_507_and_leaves_nothing_wherever_it_is_full() -> Outcome {
    let folder = tempfile::tempdir()?;
    // A disk of its own of 64 KiB, in a mount namespace of its own: as root, or as root of a user namespace.
    let disk = folder.path().join("disk");
    std::fs::create_dir(&disk)?;
    let namespaces = [
        "unshare --mount",
        "unshare --user --map-root-user --mount",
        "sudo -n unshare --mount",
    ];
    let works = |namespace: &&str| {
        let mount = format!(
            "{namespace} mount -t tmpfs -o size=64k none {}",
            disk.display()
        );
        let tried = std::process::Command::new("sh")
            .args(["-c", &mount])
            .output();
        tried.is_ok_and(|tried| tried.status.success())
    };
    let Some(namespace) = namespaces.iter().find(|n| works(n)) else {
        println!("skipped: no mount namespace may be made here, so no small disk either");
        assert_ne!(
            std::env::var("CI").as_deref(),
            Ok("true"),
            "CI must have one"
        );
        return Ok(());
    };
    let mounted = format!(
        "exec {} sh -c 'mount -t tmpfs -o size=64k none {} && exec \"$@\"' sh \"$@\"",
        // The environment carries the server's orders.
        namespace.replace("sudo -n", "sudo -n -E"),
        disk.display()
    );
    // Full where uploads are received, and full where they are stored.
    for (store, spool) in [("disk/store", "disk/spool"), ("disk/store", "spool")] {
        let orders = Orders {
            folder: folder.path().join(store),
            spool: Some(folder.path().join(spool)),
            secret: folder.path().join("secret"),
            ..Orders::default()
        };
        let mut server = ServerProcess::start_within(&orders, &mounted).await?;
        is_refused_because_the_disk_is_full(&server).await?;
        // Its disk is seen through its eyes.
        let id = server.process.0.id();
        let eyes = Path::new("/proc").join(id.to_string()).join("root");
        if let (true, Ok(inside)) = (*namespace != namespaces[2], orders.folder.strip_prefix("/")) {
            assert_eq!(
                files_below(&eyes.join(inside))?,
                Vec::<String>::new(),
                "nothing is left"
            );
        }
        server.process.kill_9();
    }
    Ok(())
}
