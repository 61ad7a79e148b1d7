//! What the members of calls put into the store: beside what their owner has there, and no more than was agreed.

use crate::calls::{Call, rooms};
use crate::owners::named;
use crate::support::{Caller, Outcome, Package, Presence, TestServer, package};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::time::Duration;

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
    assert_eq!(more.status(), StatusCode::FORBIDDEN, "one too many");
    let again = caller.put_package(package(), &call.member).await?.status();
    assert_eq!(again, StatusCode::OK, "what is there costs nothing");
    let other = caller.call("ada").await?;
    put(caller, &named("more"), &other.member).await
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
