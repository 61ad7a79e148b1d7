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
