//! What the server and its forwarder's process say to one another: messages of JSON, each after its length (u32, big
//! endian).

use link_protocol::Name;
use link_protocol::rooms::RoomStatus;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

/// The longest message: an offer, escaped.
const MAX_BYTES: u32 = 8 << 20;

/// Messages that may wait to be written. A side that reads so slowly is taken for dead.
pub(super) const MAX_WAITING: usize = 1024;

/// From the server.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum ToForwarder {
    /// Take a viewer of a room, which the server calls by this number from now on.
    Take {
        viewer: u64,
        room: Name,
        session: Name,
        offer: String,
        network: Name,
    },
    /// A viewer has left.
    Leave { session: Name },
    /// The answer to [`ToServer::Status`].
    Status {
        question: u64,
        status: Option<RoomStatus>,
    },
    /// The answer to [`ToServer::Offer`]: the session's name and the sender's SDP.
    Answer {
        question: u64,
        answer: Option<(Name, String)>,
    },
}

/// From the forwarder. `viewer` is the number of a viewer of the room that is meant.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum ToServer {
    /// The answer to a viewer's offer, if it is taken.
    Taken { viewer: u64, answer: Option<String> },
    /// The room is not asked about by this number again.
    Forget { viewer: u64 },
    /// So many viewers are forwarded to now.
    Viewers { count: usize },
    /// What does the room's sender announce?
    Status { question: u64, viewer: u64 },
    /// Offer the room's sender a connection.
    Offer {
        question: u64,
        viewer: u64,
        sdp: String,
    },
    /// Tell the room's sender that a viewer is served no longer.
    Left { viewer: u64, session: Name },
}

/// Writes one message.
pub(super) async fn write(
    stream: &mut (impl AsyncWrite + Unpin),
    message: &impl Serialize,
) -> std::io::Result<()> {
    let bytes = serde_json::to_vec(message)?;
    let length = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    if length > MAX_BYTES {
        return Err(Error::new(
            ErrorKind::InvalidInput,
            "the message is too long",
        ));
    }
    stream.write_u32(length).await?;
    stream.write_all(&bytes).await?;
    stream.flush().await
}

/// Reads one message. Not to be cancelled: half of it would be lost.
pub(super) async fn read<T: DeserializeOwned>(
    stream: &mut (impl AsyncRead + Unpin),
) -> std::io::Result<T> {
    let length = stream.read_u32().await?;
    if length > MAX_BYTES {
        return Err(Error::new(
            ErrorKind::InvalidData,
            "the message is too long",
        ));
    }
    let mut bytes = vec![0; length as usize];
    stream.read_exact(&mut bytes).await?;
    Ok(serde_json::from_slice(&bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run<T>(task: impl Future<Output = T>) -> T {
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        runtime.expect("a runtime").block_on(task)
    }

    #[test]
    fn a_message_is_read_as_it_was_written_and_a_long_or_broken_one_is_an_error() {
        run(async {
            let name = Name::of_id([7; 16]);
            let message = ToForwarder::Take {
                viewer: 3,
                room: name.clone(),
                session: name.clone(),
                network: name.clone(),
                offer: "v=0\r\n".into(),
            };
            let mut bytes = Vec::new();
            write(&mut bytes, &message).await.expect("it is written");
            let again: ToForwarder = read(&mut &*bytes).await.expect("it is read");
            assert_eq!(format!("{again:?}"), format!("{message:?}"));
            let cut = bytes.get(..bytes.len() - 1).expect("shorter");
            assert!(read::<ToForwarder>(&mut &*cut).await.is_err(), "cut short");
            let long = (MAX_BYTES + 1).to_be_bytes();
            let error = read::<ToForwarder>(&mut &long[..])
                .await
                .expect_err("too long");
            assert_eq!(error.kind(), ErrorKind::InvalidData);
            let long = ToServer::Taken {
                viewer: 0,
                answer: Some("a".repeat(MAX_BYTES as usize)),
            };
            assert!(write(&mut Vec::new(), &long).await.is_err(), "too long");
        });
    }
}
