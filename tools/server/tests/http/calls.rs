//! Calls of several: seats, who may take one, and what a member may put into the store.

use crate::support::{
    Caller, Outcome, Package, Presence, Room, TestServer, announcement, another_package, package,
};
use reqwest::{Method, Response, StatusCode};
use serde_json::{Value, json};
use std::time::Duration;

/// A call as its owner got it.
pub(crate) struct Call {
    pub(crate) id: String,
    pub(crate) member: String,
}

impl Call {
    pub(crate) fn path(&self) -> String {
        format!("/v1/calls/{}", self.id)
    }

    /// A seat as a room, whose sender and viewers are the members.
    pub(crate) fn seat(&self, room: &str) -> Room {
        Room {
            id: room.to_owned(),
            sender: self.member.clone(),
            viewer: self.member.clone(),
        }
    }
}

impl Caller {
    pub(crate) async fn call(&self, owner: &str) -> Outcome<Call> {
        let token = self.owner(owner);
        let answer = self
            .request(Method::POST, "/v1/calls", &token)
            .send()
            .await?;
        assert_eq!(answer.status(), StatusCode::CREATED, "a call is opened");
        let opened: Value = answer.json().await?;
        let text = |key: &str| opened[key].as_str().unwrap_or_default().to_owned();
        Ok(Call {
            id: text("call"),
            member: text("member_token"),
        })
    }

    /// The seats as a member is told them.
    pub(crate) async fn seats(&self, call: &Call) -> Outcome<Vec<Value>> {
        let answer = self.get(&call.path(), &call.member).await?;
        assert_eq!(answer.status(), StatusCode::OK, "members are told");
        let status: Value = answer.json().await?;
        Ok(status["seats"].as_array().cloned().unwrap_or_default())
    }

    /// Wants to sit down as `occupant`.
    pub(crate) async fn sit(&self, call: &Call, room: &str, occupant: &str) -> Outcome<Response> {
        self.sit_as(call, room, occupant, package()).await
    }

    /// The same, with this avatar.
    pub(crate) async fn sit_as(
        &self,
        call: &Call,
        room: &str,
        occupant: &str,
        avatar: &Package,
    ) -> Outcome<Response> {
        let mut body = announcement();
        body["avatar"] = json!({ "sha256": avatar.hash, "bytes": avatar.bytes.len() });
        body["person"] = json!(format!("{occupant}'s name"));
        body["occupant"] = json!(occupant);
        let path = format!("/v1/rooms/{room}/presence");
        let request = self.request(Method::POST, &path, &call.member);
        let request = request.timeout(Duration::from_secs(3600));
        Ok(request.json(&body).send().await?)
    }
}

pub(crate) fn rooms(seats: &[Value]) -> Vec<String> {
    (seats.iter())
        .map(|seat| seat["room"].as_str().unwrap_or_default().to_owned())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn members_put_their_avatars_take_seats_and_meet() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let call = caller.call("ada").await?;
    let seats = caller.seats(&call).await?;
    let rooms = rooms(&seats);
    assert_eq!(rooms.len(), 8, "{seats:?}");
    assert!(seats.iter().all(|seat| seat.get("taken").is_none()));
    // The owner has no package yet: a member puts one.
    let absent = caller.sit(&call, &rooms[0], "o1").await?.status();
    assert_eq!(absent, StatusCode::NOT_FOUND, "no avatar yet");
    let put = caller.put_package(package(), &call.member).await?.status();
    assert_eq!(put, StatusCode::CREATED, "a member's");
    let mut first = Presence::new(caller.sit(&call, &rooms[0], "o1").await?);
    let told = caller.seats(&call).await?;
    assert_eq!(
        told[0]["taken"],
        json!({ "announcement": announcement(), "person": "o1's name" }),
        "what the others read, without the occupant"
    );
    assert!(told[1].get("taken").is_none(), "{told:?}");
    // It is another's seat, until its occupant comes back.
    let refused = caller.sit(&call, &rooms[0], "o2").await?.status();
    assert_eq!(refused, StatusCode::CONFLICT, "taken");
    let mut again = Presence::new(caller.sit(&call, &rooms[0], "o1").await?);
    let replaced = first.next().await?;
    assert_eq!(replaced, Some(("replaced".into(), json!({}))));
    let _second = Presence::new(caller.sit(&call, &rooms[1], "o2").await?);
    caller.meet(&call.seat(&rooms[0]), &mut again).await?;
    // A member reads the avatars of who is there, and no others of the call's owner.
    let hidden = another_package();
    let stored = caller.put_package(&hidden, &caller.owner("ada")).await?;
    assert_eq!(stored.status(), StatusCode::CREATED);
    for (path, expected) in [
        (package().path(), StatusCode::OK),
        (hidden.path(), StatusCode::NOT_FOUND),
    ] {
        let read = caller.get(&path, &call.member).await?;
        assert_eq!(read.status(), expected, "{path}");
    }
    let nameless = caller.announce(&call.seat(&rooms[2])).await?.status();
    assert_eq!(
        nameless,
        StatusCode::UNPROCESSABLE_ENTITY,
        "without an occupant"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_member_has_no_right_beyond_its_call() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let (call, other) = (caller.call("ada").await?, caller.call("ada").await?);
    let room = caller.room("ada").await?;
    let theirs = rooms(&caller.seats(&other).await?);
    for path in [
        other.path(),
        room.path(),
        format!("/v1/rooms/{}", theirs[0]),
    ] {
        let status = caller.get(&path, &call.member).await?.status();
        assert_eq!(status, StatusCode::NOT_FOUND, "{path}");
    }
    for (path, token) in [
        (call.path(), &room.viewer),
        (call.path(), &room.sender),
        (call.path(), &caller.owner("ada")),
    ] {
        let status = caller.get(&path, token).await?.status();
        assert_eq!(status, StatusCode::NOT_FOUND, "{path}");
    }
    for path in ["/v1/rooms", "/v1/calls"] {
        let request = caller.request(Method::POST, path, &call.member);
        let status = request.send().await?.status();
        assert_eq!(status, StatusCode::NOT_FOUND, "{path}");
    }
    let sat = caller.sit(&call, &theirs[0], "o1").await?.status();
    assert_eq!(sat, StatusCode::NOT_FOUND, "a seat of another call");
    let removed = caller.delete(&package().path(), &call.member).await?;
    assert_eq!(removed, StatusCode::NOT_FOUND, "the owner's package stays");
    Ok(())
}

/// A call of which one address may have so many seats, with an avatar in its store.
async fn call_with(caller: &Caller, order: &Value) -> Outcome<Call> {
    let token = caller.owner("ada");
    let opens = caller
        .request(Method::POST, "/v1/calls", &token)
        .json(order);
    let opened: Value = opens.send().await?.json().await?;
    let text = |key: &str| opened[key].as_str().unwrap_or_default().to_owned();
    let call = Call {
        id: text("call"),
        member: text("member_token"),
    };
    let put = caller.put_package(package(), &call.member).await?;
    assert!(put.status().is_success(), "{}", put.status());
    Ok(call)
}

#[tokio::test(flavor = "multi_thread")]
async fn one_address_takes_as_many_seats_as_the_opener_allows() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    for (order, expected) in [
        (json!({}), 3),
        (json!({ "seats_per_address": 1 }), 1),
        (json!({ "seats_per_address": 8 }), 8),
    ] {
        let call = call_with(caller, &order).await?;
        let rooms = rooms(&caller.seats(&call).await?);
        let mut seated = Vec::new();
        for (number, room) in rooms.iter().enumerate() {
            let sits = caller.sit(&call, room, &format!("o{number}")).await?;
            let status = sits.status();
            if number < expected {
                assert_eq!(status, StatusCode::OK, "{order}: seat {number}");
                seated.push(Presence::new(sits));
            } else {
                assert_eq!(status, StatusCode::FORBIDDEN, "{order}: seat {number}");
                let said = sits.text().await?;
                assert!(said.contains("--seats-per-address"), "{said}");
            }
        }
        // An occupant who comes back is no further one.
        let again = caller.sit(&call, &rooms[0], "o0").await?.status();
        assert_eq!(again, StatusCode::OK, "{order}");
    }
    let token = caller.owner("ada");
    for wrong in [0, 9, 255] {
        let order = json!({ "seats_per_address": wrong });
        let opens = caller
            .request(Method::POST, "/v1/calls", &token)
            .json(&order);
        let status = opens.send().await?.status();
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{wrong}");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_seat_is_kept_for_its_occupant_for_ten_seconds_unless_they_leave_it() -> Outcome {
    let server = TestServer::start().await?;
    let caller = &server.caller;
    let call = call_with(caller, &json!({})).await?;
    let room = rooms(&caller.seats(&call).await?)[0].clone();
    let is_kept = async || Outcome::Ok(caller.seats(&call).await?[0]["kept"] == json!(true));
    let leaves = async |occupant: &str| {
        let path = format!("/v1/rooms/{room}/presence");
        let request = caller.request(Method::DELETE, &path, &call.member);
        let request = request.json(&json!({ "occupant": occupant }));
        Outcome::Ok(request.send().await?.status())
    };
    let sits = Presence::new(caller.sit(&call, &room, "o1").await?);
    assert!(!is_kept().await?, "it is taken");
    drop(sits);
    let broke = std::time::Instant::now();
    while !is_kept().await? {
        assert!(broke.elapsed() < Duration::from_secs(5), "it is not kept");
    }
    let told = caller.seats(&call).await?;
    assert!(told[0].get("taken").is_none(), "nobody is there: {told:?}");
    let other = caller.sit(&call, &room, "o2").await?.status();
    assert_eq!(other, StatusCode::CONFLICT, "kept");
    // Who does not know what the occupant said changes nothing.
    assert_eq!(leaves("o2").await?, StatusCode::NO_CONTENT);
    assert!(is_kept().await?);
    let again = Presence::new(caller.sit(&call, &room, "o1").await?);
    // Left on purpose, by the occupant alone.
    assert_eq!(leaves("o1").await?, StatusCode::NO_CONTENT);
    drop(again);
    let other = loop {
        let other = caller.sit(&call, &room, "o2").await?;
        if other.status() == StatusCode::OK {
            break Presence::new(other);
        }
        assert!(broke.elapsed() < Duration::from_secs(8), "it is kept");
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    drop(other);
    while !is_kept().await? {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let broke = std::time::Instant::now();
    while is_kept().await? {
        assert!(broke.elapsed() < Duration::from_secs(30), "it is kept");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert!(broke.elapsed() > Duration::from_secs(8), "not long enough");
    let third = caller.sit(&call, &room, "o3").await?.status();
    assert_eq!(third, StatusCode::OK, "free");
    // A sender's and a viewer's token leave no seat.
    let owned = caller.room("ada").await?;
    for token in [&owned.sender, &owned.viewer] {
        let path = format!("{}/presence", owned.path());
        let request = caller.request(Method::DELETE, &path, token);
        let status = request.json(&json!({ "occupant": "o" })).send().await?;
        assert_eq!(status.status(), StatusCode::NOT_FOUND);
    }
    Ok(())
}
