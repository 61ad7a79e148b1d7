//! What the members of calls put into the store: beside what their owner has there, and no more than was agreed.

use crate::calls::{Call, rooms};
use crate::owners::named;
use crate::support::{Caller, Outcome, PATIENCE, Package, Presence, TestServer, package};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::time::Duration;
use tokio::io::AsyncReadExt;

/// Times in the store are whole seconds.
const LATER: Duration = Duration::from_millis(1100);

/// Puts the package, which has to be new there.
async fn put(caller: &Caller, package: &Package, token: &str) -> Outcome {
    let put = caller.put_package(package, token).await?;
    let status = put.status();
    assert_eq!(status, StatusCode::CREATED, "{}", put.text().await?);
    Ok(())
}

/// Whether the bearer is told that the package is there.
async fn has(caller: &Caller, package: &Package, token: &str) -> Outcome<bool> {
    let head = caller.request(Method::HEAD, &package.path(), token);
    match head.send().await?.status() {
        StatusCode::OK => Ok(true),
        StatusCode::NOT_FOUND => Ok(false),
        other => Err(other.to_string().into()),
    }
}

/// The hashes in one of the owner's lists.
async fn listed(caller: &Caller, list: &str, token: &str) -> Outcome<BTreeSet<String>> {
    let lists: Value = caller.get("/v1/packages", token).await?.json().await?;
    let list = lists[list].as_array().ok_or("no such list")?;
    let hashes = list.iter().map(|one| one["sha256"].as_str());
    Ok(hashes.flatten().map(str::to_owned).collect())
}

fn hashes<'a>(packages: impl IntoIterator<Item = &'a Package>) -> BTreeSet<String> {
    packages.into_iter().map(|one| one.hash.clone()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn members_are_received_no_more_often_than_agreed() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let call = caller.call("ada").await?;
    put(caller, package(), &call.member).await?;
    // What is no package takes no package's place, but costs the server as much: so many are received and no more.
    for number in 0..95u8 {
        let wrong = Package::of(vec![number]);
        let wrong = caller.put_package(&wrong, &call.member).await?.status();
        assert_eq!(wrong, StatusCode::UNPROCESSABLE_ENTITY, "number {number}");
    }
    let more = caller.put_package(&named("more"), &call.member).await?;
    assert_eq!(more.status(), StatusCode::TOO_MANY_REQUESTS, "too many");
    let wait: u64 = more.headers()["retry-after"].to_str()?.parse()?;
    assert!(wait <= 61, "one comes back each minute: {wait} s");
    let again = caller.put_package(package(), &call.member).await?.status();
    assert_eq!(again, StatusCode::OK, "what is there costs nothing");
    let other = caller.call("ada").await?;
    put(caller, &named("more"), &other.member).await
}

#[tokio::test(flavor = "multi_thread")]
async fn failed_uploads_of_one_address_keep_no_other_member_of_the_call_out() -> Outcome {
    let server = TestServer::start_with(|c| {
        c.limits.requests_per_second = 0;
        c.limits.package_bytes = 1 << 20;
    })
    .await?;
    let caller = &server.caller;
    let call = caller.call("ada").await?;
    let hostile = caller.at([127, 0, 0, 9])?;
    let mut refused = BTreeSet::new();
    for number in 0..200u16 {
        let wrong = Package::of(number.to_le_bytes().to_vec());
        let put = hostile.request(Method::PUT, &wrong.path(), &call.member);
        let body = match number % 4 {
            0 => wrong.bytes.clone(),
            1 => b"other bytes".to_vec(),
            2 => vec![0; 2 << 20],
            _ => Vec::new(),
        };
        refused.insert(put.body(body).send().await?.status().as_u16());
        if number % 10 == 0 {
            // Given up in the middle.
            drop(crate::owners::begin(&hostile, &call.member).await?);
        }
    }
    assert_eq!(refused, [413, 422, 429].into(), "of all kinds");
    let honest = caller.at([127, 0, 0, 10])?;
    put(&honest, package(), &call.member).await?;
    let line = "mon3tr_uploads_refused_total{reason=\"Tries\"} ";
    assert!(caller.metric(line).await? >= 100, "counted");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn thousands_of_one_owners_calls_keep_no_other_owners_members_out() -> Outcome {
    let server = TestServer::start_with(|c| c.limits.requests_per_second = 0).await?;
    let caller = &server.caller;
    let eve = caller.owner("eve");
    let opening = (0..16).map(|part: u16| {
        let (caller, eve) = (caller.clone(), eve.clone());
        tokio::spawn(async move {
            for number in 0..4096 / 16 {
                let opened = caller.request(Method::POST, "/v1/calls", &eve);
                let opened: Value = opened.send().await?.json().await?;
                let member = opened["member_token"].as_str().ok_or("no token")?;
                let wrong = Package::of([part, number].map(u16::to_le_bytes).concat());
                let put = caller.put_package(&wrong, member).await?.status();
                assert_eq!(put, StatusCode::UNPROCESSABLE_ENTITY);
            }
            Outcome::Ok(())
        })
    });
    for part in opening.collect::<Vec<_>>() {
        part.await??;
    }
    let call = caller.call("ada").await?;
    put(caller, package(), &call.member).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_members_slow_uploads_keep_none_of_the_owners_other_calls_waiting() -> Outcome {
    let server = TestServer::start_with(|c| c.limits.pause = Duration::from_secs(60)).await?;
    let caller = &server.caller;
    let (call, other) = (caller.call("ada").await?, caller.call("ada").await?);
    let hostile = caller.at([127, 0, 0, 9])?;
    // The first one has the place of its address before the others ask.
    let mut slow = vec![crate::owners::begin(&hostile, &call.member).await?];
    let begun = async {
        while caller
            .metric("mon3tr_package_bytes_received_total ")
            .await?
            == 0
        {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        Outcome::Ok(())
    };
    tokio::time::timeout(PATIENCE, begun).await??;
    for _ in 0..22 {
        slow.push(crate::owners::begin(&hostile, &call.member).await?);
    }
    // In another call, and in the same one at another address.
    put(caller, package(), &other.member).await?;
    put(caller, &named("mine"), &call.member).await?;
    // They end, by their slowness, though they pause for no minute.
    let mut answer = [0; 12];
    tokio::time::timeout(PATIENCE, slow[0].read_exact(&mut answer)).await??;
    assert_eq!(&answer, b"HTTP/1.1 408", "too slow");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hostile_call_that_puts_its_most_leaves_its_owners_quota_alone() -> Outcome {
    let size = package().bytes.len() as u64;
    for by_bytes in [false, true] {
        let server = TestServer::start_with(|c| {
            if by_bytes {
                // Their names make them differ in a few bytes.
                c.limits.bytes_per_owner = 3 * size + size / 2;
            } else {
                c.limits.packages_per_owner = 3;
            }
        })
        .await?;
        let caller = &server.caller;
        let owner = caller.owner("ada");
        put(caller, &named("mine"), &owner).await?;
        let hostile = caller.call("ada").await?;
        for number in 0..24 {
            put(
                caller,
                &named(&format!("hostile {number}")),
                &hostile.member,
            )
            .await?;
        }
        let more = caller.put_package(&named("more"), &hostile.member).await?;
        assert_eq!(more.status(), StatusCode::FORBIDDEN, "its most");
        let own = ["mine", "another", "a third"].map(named);
        for package in &own[1..] {
            put(caller, package, &owner).await?;
        }
        assert_eq!(listed(caller, "packages", &owner).await?, hashes(&own));
        let kept = listed(caller, "members", &owner).await?.len();
        assert_eq!(kept, 3, "of the members'");
        let honest = caller.call("ada").await?;
        put(caller, package(), &honest.member).await?;
        let seats = rooms(&caller.seats(&honest).await?);
        let sits = caller.sit(&honest, &seats[0], "o1").await?.status();
        assert_eq!(sits, StatusCode::OK, "the next call's member");
        let stored = server.files()?;
        let stored = stored.iter().filter(|name| name.starts_with("packages/"));
        assert_eq!(
            stored.count(),
            6,
            "of what is left no more than twice the quota"
        );
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn where_members_have_no_room_left_the_oldest_package_makes_room_unless_it_is_shown()
-> Outcome {
    let server = TestServer::start_with(|c| c.limits.packages_per_owner = 2).await?;
    let caller = &server.caller;
    let call = caller.call("ada").await?;
    let token = &call.member;
    let [first, second, third, fourth] = ["1st", "2nd", "3rd", "4th"].map(named);
    for package in [&first, &second, &third] {
        put(caller, package, token).await?;
        tokio::time::sleep(LATER).await;
    }
    for (package, is_there) in [(&first, false), (&second, true), (&third, true)] {
        assert_eq!(has(caller, package, token).await?, is_there);
    }
    let of_first = format!("packages/{}", first.hash);
    assert!(!server.files()?.contains(&of_first), "nor its bytes");
    // The oldest one is somebody's in the call, who is to be seen by whoever comes.
    let seats = rooms(&caller.seats(&call).await?);
    let sits = caller.sit_as(&call, &seats[0], "o1", &second).await?;
    let _sits = Presence::new(sits);
    put(caller, &fourth, token).await?;
    for (package, is_there) in [(&second, true), (&third, false), (&fourth, true)] {
        assert_eq!(has(caller, package, token).await?, is_there);
    }
    let sits = caller.sit_as(&call, &seats[1], "o2", &fourth).await?;
    let _sits_too = Presence::new(sits);
    for package in [&second, &fourth] {
        let read = caller.get(&package.path(), token).await?;
        assert!(read.bytes().await? == package.bytes, "those who are there");
    }
    // Shown or not, newcomers are never kept out.
    put(caller, &first, token).await?;
    assert!(!has(caller, &second, token).await?, "the oldest");
    assert!(has(caller, &first, token).await?, "the newest");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_owner_lists_what_members_put_and_removes_it() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let (ada, eve) = (caller.owner("ada"), caller.owner("eve"));
    let call = caller.call("ada").await?;
    put(caller, package(), &call.member).await?;
    let lists: Value = caller.get("/v1/packages", &ada).await?.json().await?;
    let expected = json!([{ "sha256": package().hash, "bytes": package().bytes.len() }]);
    assert_eq!(lists["members"], expected, "a member's");
    assert_eq!(lists["packages"], json!([]), "none of her own");
    let others = listed(caller, "members", &eve).await?;
    assert_eq!(others, BTreeSet::new(), "of another's calls");
    assert!(!has(caller, package(), &ada).await?, "she has none to show");

    put(caller, package(), &ada).await?;
    put(caller, package(), &eve).await?;
    let foreign = caller.delete(&named("no").path(), &ada).await?;
    assert_eq!(foreign, StatusCode::NOT_FOUND, "nobody's");
    let gone = caller.delete(&package().path(), &ada).await?;
    assert_eq!(gone, StatusCode::NO_CONTENT, "both of them");
    for token in [&ada, &call.member] {
        assert!(!has(caller, package(), token).await?, "gone");
    }
    let read = caller.get(&package().path(), &eve).await?;
    assert!(read.bytes().await? == package().bytes, "another owner's");
    let gone = caller.delete(&package().path(), &eve).await?;
    assert_eq!(gone, StatusCode::NO_CONTENT, "the last one");
    assert_eq!(server.files()?, Vec::<String>::new(), "nothing is left");
    let checked = caller.metric("mon3tr_packages_checked_total ").await?;
    assert_eq!(checked, 1, "the same bytes");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_member_reaches_none_of_the_owners_own_packages_even_by_announcing_it() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let (owner, private) = (caller.owner("ada"), named("private"));
    put(caller, &private, &owner).await?;
    let call: Call = caller.call("ada").await?;
    let seats = rooms(&caller.seats(&call).await?);
    assert!(!has(caller, &private, &call.member).await?, "not told of");
    let sits = caller.sit_as(&call, &seats[0], "o1", &private).await?;
    assert_eq!(sits.status(), StatusCode::NOT_FOUND, "nor announced");
    let read = caller.get(&private.path(), &call.member).await?.status();
    assert_eq!(read, StatusCode::NOT_FOUND, "nor read");
    // Whoever shows it in the call, its owner too, puts it there as a member.
    put(caller, &private, &call.member).await?;
    let sits = caller.sit_as(&call, &seats[0], "o1", &private).await?;
    let _sits = Presence::new(sits);
    let read = caller.get(&private.path(), &call.member).await?;
    assert!(read.bytes().await? == private.bytes, "once it is shown");
    Ok(())
}
