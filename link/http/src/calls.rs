//! Calls of several: opening one, and who is in it.

use std::time::Duration;

use reqwest::{Method, StatusCode};

use crate::client::{CALL, LEAVE_SEAT, OPEN_CALL};
use crate::{Client, HttpError};
use link_protocol::Token;
use link_protocol::calls::{CallStatus, LeaveSeat, OpenCall, OpenedCall};
use link_protocol::limits::MAX_PEOPLE;
use link_protocol::room_link::ServerUrl;
use link_protocol::{CallLink, Name, RoomLink};

impl Client {
    /// Opens a call. Without a `lifetime` the server chooses one. One network address may take `seats_per_address`
    /// seats of it, three where nothing is said.
    ///
    /// # Errors
    /// [`HttpError::Unauthorized`] if this is no owner's token of that server, [`HttpError::NotFound`] of a server that is too old, and those of any
    /// request.
    pub async fn open_call(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        lifetime: Option<Duration>,
        seats_per_address: Option<u8>,
    ) -> Result<CallLink, HttpError> {
        let token = Token::new(owner_token)?;
        let order = OpenCall {
            lifetime_s: lifetime.map(|lifetime| lifetime.as_secs()),
            seats_per_address,
        };
        let request = self
            .request(Method::POST, server, &token, &["calls"])?
            .json(&order);
        let reply = self.exchange(server, OPEN_CALL, request).await?;
        if reply.status != StatusCode::CREATED {
            return Err(reply.refusal(server, &token, OPEN_CALL));
        }
        let opened: OpenedCall = reply.json(server, &token, OPEN_CALL)?;
        let link = CallLink::of(server.clone(), opened.call.as_str(), &opened.member_token)?;
        Ok(link)
    }

    /// Who is in a call: its seats, [`MAX_PEOPLE`] at most.
    ///
    /// # Errors
    /// [`HttpError::Unauthorized`] or [`HttpError::NotFound`] if the link is wrong or has expired, and those of any request.
    pub async fn call_status(&self, link: &CallLink) -> Result<CallStatus, HttpError> {
        let server = link.server();
        let request = self.request(
            Method::GET,
            server,
            link.token(),
            &["calls", link.call().as_str()],
        )?;
        let reply = self.exchange(server, CALL, request).await?;
        if reply.status != StatusCode::OK {
            return Err(reply.refusal(server, link.token(), CALL));
        }
        let mut status: CallStatus = reply.json(server, link.token(), CALL)?;
        status.seats.truncate(MAX_PEOPLE);
        Ok(status)
    }

    /// Leaves a seat on purpose: the server frees it as soon as the presence of `occupant` there ends. A server that is
    /// too old frees it so in any case.
    ///
    /// # Errors
    /// Those of any request.
    pub async fn leave_seat(&self, seat: &RoomLink, occupant: &Name) -> Result<(), HttpError> {
        let (server, token) = (seat.server(), seat.token());
        let segments = ["rooms", seat.room().as_str(), "presence"];
        let leaving = LeaveSeat {
            occupant: occupant.clone(),
        };
        let request = (self.request(Method::DELETE, server, token, &segments)?).json(&leaving);
        let reply = self.exchange(server, LEAVE_SEAT, request).await?;
        match reply.status {
            StatusCode::NO_CONTENT | StatusCode::METHOD_NOT_ALLOWED => Ok(()),
            _ => Err(reply.refusal(server, token, LEAVE_SEAT)),
        }
    }
}
