//! The right to open rooms and to put avatars on a server.

use crate::device_options::cache;
use anyhow::{Context, anyhow, bail};
use link_protocol::room_link::ServerUrl;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Where a server keeps the token, below its folder.
pub(crate) const OWNER_TOKEN: &str = "owner-token";

/// The folder of a server on this machine, where `data` names no other one.
pub(crate) fn server_folder(data: Option<&Path>) -> anyhow::Result<PathBuf> {
    match data {
        Some(folder) => Ok(folder.to_path_buf()),
        None => Ok(cache()?.join("server")),
    }
}

/// The option of commands that open rooms.
#[derive(Debug, Clone, clap::Args)]
pub struct OwnerToken {
    /// The owner's token: what is in the file that `serve` names [default: that of a server on this machine]
    #[arg(
        long = "owner-token",
        value_name = "TOKEN",
        env = "MON3TR_OWNER_TOKEN",
        hide_env_values = true
    )]
    owner_token: Option<String>,
}

impl OwnerToken {
    /// The token that was given, if one was.
    #[must_use]
    pub fn given(&self) -> Option<&str> {
        self.owner_token.as_deref()
    }

    /// The token for `server`.
    ///
    /// # Errors
    /// If it was not given, and the server is not on this machine.
    pub fn of(&self, server: &ServerUrl) -> anyhow::Result<String> {
        if let Some(token) = &self.owner_token {
            return Ok(token.clone());
        }
        if !server.is_here() {
            bail!(
                "no owner's token: give --owner-token: what is in the file that `mon3tr serve` named where it runs"
            );
        }
        let file = server_folder(None)?.join(OWNER_TOKEN);
        match std::fs::read_to_string(&file) {
            Ok(token) => Ok(token.trim().to_owned()),
            Err(error) if error.kind() == ErrorKind::NotFound => Err(anyhow!(
                "no owner's token: there is no {}: start `mon3tr serve` on this machine first, or give --owner-token: what is in the file that `mon3tr serve` named, elsewhere with --data",
                file.display()
            )),
            Err(error) => Err(error).with_context(|| format!("cannot read {}", file.display())),
        }
    }
}
