//! What can stop a sender.

use link_call::CallError;
use std::path::{Path, PathBuf};

/// An error on the sending side.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SendError {
    /// The server or the network.
    #[error(transparent)]
    Link(#[from] CallError),
    /// The store lacks the avatar and there is no token to upload it.
    #[error(
        "the server has no package {} of the room's owner yet, and only that owner may put it there: give the owner's token too (or the link \
         is the viewers', where the sender's is needed)",
        .0.display()
    )]
    NotUploaded(PathBuf),
    /// The source of motion failed, as it says itself.
    #[error(transparent)]
    Capture(Box<dyn std::error::Error + Send + Sync>),
    /// The file of a voice cannot be said.
    #[error("{} is no voice to send: {why}", path.display())]
    Voice {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
}

impl SendError {
    pub(crate) fn voice(path: &Path, why: String) -> Self {
        Self::Voice {
            path: path.to_owned(),
            why,
        }
    }
}
