//! Owners beside each other: none keeps another one out, and each has its quota.

use crate::support::{Caller, Outcome, PATIENCE, Package, TestServer, package};
use reqwest::{Method, StatusCode};
use serde_json::Value;
use std::time::Duration;
use synthetic_person::Puppet;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

const RECEIVED: &str = "mon3tr_package_bytes_received_total ";

/// The synthetic person under another name: other bytes.
pub(crate) fn named(name: &str) -> Package {
    let mut avatar = Puppet::small().avatar();
    avatar.name = name.to_owned();
    Package::of(avatar.to_bytes().expect("a package"))
}

/// Begins an upload for this owner, which never ends.
pub(crate) async fn begin(caller: &Caller, token: &str) -> Outcome<TcpStream> {
    let package = package();
    let mut stream = caller.connect().await?;
    let head = format!(
        "PUT {} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {token}\r\nContent-Length: {}\r\n\r\n",
        package.path(),
        package.bytes.len()
    );
    stream.write_all(head.as_bytes()).await?;
    stream.write_all(&package.bytes[..100]).await?;
    Ok(stream)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_owner_with_22_uploads_under_way_keeps_no_other_owner_out() -> Outcome {
    let pause = Duration::from_secs(12);
    let server = TestServer::start_with(|c| c.limits.pause = pause).await?;
    let caller = &server.caller;
    let (ada, eve) = (caller.owner("ada"), caller.owner("eve"));
    let mut uploads = Vec::new();
    for _ in 0..22 {
        uploads.push(begin(caller, &eve).await?);
    }
    // As many as are left free: 8 of 16.
    let begun = async {
        while caller.metric(RECEIVED).await? < 8 * 100 {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        Outcome::Ok(())
    };
    tokio::time::timeout(PATIENCE, begun).await??;
    for name in ["one", "two", "three"] {
        let put = caller.put_package(&named(name), &ada).await?;
        assert_eq!(put.status(), StatusCode::CREATED, "ada is served");
    }
    // Those of eve's that got no place are told so before the first eight are found to pause.
    let (mut busy, mut paused) = (0, 0);
    for upload in &mut uploads {
        let mut answer = [0; 12];
        tokio::time::timeout(PATIENCE, upload.read_exact(&mut answer)).await??;
        match &answer {
            b"HTTP/1.1 503" => busy += 1,
            b"HTTP/1.1 408" => paused += 1,
            _ => return Err(String::from_utf8_lossy(&answer).into()),
        }
    }
    assert_eq!((busy, paused), (14, 8), "eve's");
    let put = caller.put_package(package(), &ada).await?;
    assert_eq!(put.status(), StatusCode::CREATED, "ada is served");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn owners_with_slow_uploads_in_all_places_keep_no_other_owner_out() -> Outcome {
    let server = TestServer::start_with(|c| c.limits.pause = Duration::from_secs(60)).await?;
    let caller = &server.caller;
    let mut slow = Vec::new();
    for owner in 0..6 {
        let owner = caller.owner(&format!("owner {owner}"));
        for _ in 0..9 {
            slow.push(begin(caller, &owner).await?);
        }
    }
    for name in ["ada", "bob"] {
        let put = caller.put_package(package(), &caller.owner(name)).await?;
        assert_eq!(put.status(), StatusCode::CREATED, "{name} is served");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_bytes_are_checked_once_whoever_puts_them() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let putting = (0..12).map(|number| {
        let (caller, token) = (
            caller.clone(),
            caller.owner(&format!("owner {}", number % 6)),
        );
        tokio::spawn(async move { Ok::<_, String>(put_patiently(&caller, &token).await) })
    });
    let mut created = 0;
    for one in putting.collect::<Vec<_>>() {
        let status = one.await??.map_err(|e| e.to_string())?;
        assert!(status.is_success(), "put: {status}");
        created += usize::from(status == StatusCode::CREATED);
    }
    assert_eq!(created, 6, "new to each owner once");
    let again = caller.put_package(package(), &caller.owner("late")).await?;
    assert_eq!(again.status(), StatusCode::CREATED, "new to this one");
    let checked = caller.metric("mon3tr_packages_checked_total ").await?;
    assert_eq!(checked, 1, "one check");
    Ok(())
}

/// Puts the package, again where the server is busy.
async fn put_patiently(caller: &Caller, token: &str) -> Outcome<StatusCode> {
    loop {
        let status = caller.put_package(package(), token).await?.status();
        if status != StatusCode::SERVICE_UNAVAILABLE {
            return Ok(status);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_package_over_its_owners_quota_is_refused_until_another_one_is_removed() -> Outcome {
    let (first, second, third) = (named("first"), named("second"), named("third"));
    let bytes = first.bytes.len() + second.bytes.len();
    for by_bytes in [false, true] {
        let server = TestServer::start_with(|c| {
            if by_bytes {
                c.limits.bytes_per_owner = bytes as u64;
            } else {
                c.limits.packages_per_owner = 2;
            }
        })
        .await?;
        let caller = &server.caller;
        let (ada, eve) = (caller.owner("ada"), caller.owner("eve"));
        for package in [&first, &second] {
            let put = caller.put_package(package, &ada).await?;
            assert_eq!(put.status(), StatusCode::CREATED, "within the quota");
        }
        let refused = caller.put_package(&third, &ada).await?;
        assert_eq!(refused.status(), StatusCode::FORBIDDEN, "too much");
        let said = refused.text().await?;
        for part in [
            "has 2 packages here",
            &bytes.to_string(),
            "DELETE /v1/packages",
        ] {
            assert!(said.contains(part), "{said}");
        }
        let known = caller.put_package(&first, &ada).await?;
        assert_eq!(known.status(), StatusCode::OK, "what is there stays so");
        let put = caller.put_package(&third, &eve).await?;
        assert_eq!(put.status(), StatusCode::CREATED, "another owner's quota");

        let list: Value = caller.get("/v1/packages", &ada).await?.json().await?;
        let mut listed: Vec<_> = list["packages"].as_array().into_iter().flatten().collect();
        listed.sort_by_key(|one| one["sha256"].as_str());
        let mut expected = [&first, &second].map(
            |package| serde_json::json!({ "sha256": package.hash, "bytes": package.bytes.len() }),
        );
        expected.sort_by_key(|one| one["sha256"].as_str().map(str::to_owned));
        assert_eq!(listed, expected.iter().collect::<Vec<_>>(), "her own");

        let gone = caller.delete(&second.path(), &ada).await?;
        assert_eq!(gone, StatusCode::NO_CONTENT, "removed");
        let put = caller.put_package(&third, &ada).await?;
        assert_eq!(put.status(), StatusCode::CREATED, "there is room again");
        let line = "mon3tr_uploads_refused_total{reason=\"Quota\"} ";
        assert_eq!(caller.metric(line).await?, 1, "counted");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_takes_no_more_than_it_may_of_all_owners_together() -> Outcome {
    let size = package().bytes.len() as u64;
    let server = TestServer::start_with(|c| c.limits.store_bytes = size + size / 2).await?;
    let caller = &server.caller;
    let put = caller.put_package(package(), &caller.owner("ada")).await?;
    assert_eq!(put.status(), StatusCode::CREATED, "there is room");
    let eve = caller.owner("eve");
    let full = caller.put_package(&named("one more"), &eve).await?;
    assert_eq!(full.status(), StatusCode::INSUFFICIENT_STORAGE);
    let ada = caller.owner("ada");
    let gone = caller.delete(&package().path(), &ada).await?;
    assert_eq!(gone, StatusCode::NO_CONTENT, "removed");
    let put = caller.put_package(&named("one more"), &eve).await?;
    assert_eq!(put.status(), StatusCode::CREATED, "there is room again");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn only_an_owner_sees_a_list_of_packages() -> Outcome {
    let server = TestServer::start().await?;
    let room = server.caller.room("ada").await?;
    for token in [&room.sender, &room.viewer] {
        let answer = server.caller.get("/v1/packages", token).await?;
        assert_eq!(answer.status(), StatusCode::NOT_FOUND, "a room's token");
    }
    let put = server
        .caller
        .request(Method::PUT, "/v1/packages", &room.viewer);
    assert_eq!(
        put.send().await?.status(),
        StatusCode::METHOD_NOT_ALLOWED,
        "a list is read"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_said_of_owners_is_mended_at_the_next_start() -> Outcome {
    let folder = tempfile::tempdir()?;
    let package = package();
    let ada = server::Id::of_owner("ada").to_string();
    let write = |name: String, bytes: &[u8]| -> Outcome {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().ok_or("no folder")?)?;
        Ok(std::fs::write(path, bytes)?)
    };
    // A process died between the names of one package, and while it removed another.
    write(format!("packages/{}", package.hash), &package.bytes)?;
    write(format!("records/{}/{ada}", package.hash), b"")?;
    write(format!("owned/{ada}/{}.5", "1".repeat(64)), b"")?;
    let path = folder.path().to_path_buf();
    let server = TestServer::start_with(|c| c.store = server::StoreConfig::Local(path)).await?;
    let owner = server.caller.owner("ada");
    let expected = serde_json::json!([{ "sha256": package.hash, "bytes": package.bytes.len() }]);
    let mended = async {
        loop {
            let list: Value = server
                .caller
                .get("/v1/packages", &owner)
                .await?
                .json()
                .await?;
            if list["packages"] == expected {
                return Outcome::Ok(());
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(PATIENCE, mended).await?
}
