//! Calls of several: opening one, and who is in it.

use std::time::Duration;

use reqwest::{Method, StatusCode};

use crate::client::{CALL, OPEN_CALL};
use crate::{Client, HttpError};
use link_protocol::CallLink;
use link_protocol::Token;
use link_protocol::calls::{CallStatus, OpenedCall};
use link_protocol::limits::MAX_PEOPLE;
use link_protocol::room_link::ServerUrl;
use link_protocol::rooms::OpenRoom;

impl Client {
    /// Opens a call. Without a `lifetime` the server chooses one.
    ///
    /// # Errors
    /// [`HttpError::Unauthorized`] if this is no owner's token of that server, [`HttpError::NotFound`] of a server that is too old, and those of any
    /// request.
    pub async fn open_call(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        lifetime: Option<Duration>,
    ) -> Result<CallLink, HttpError> {
        let token = Token::new(owner_token)?;
        let order = OpenRoom {
            lifetime_s: lifetime.map(|lifetime| lifetime.as_secs()),
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
}
