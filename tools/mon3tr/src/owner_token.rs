//! The right to open rooms and to put avatars on a server.

use crate::device_options::cache;
use crate::secret_argument::{self, SecretArgument};
use anyhow::bail;
use link_protocol::room_link::ServerUrl;
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
    /// The owner's token, which is in the file that `serve` names: @FILE reads it there, - from standard input
    /// [default: that of a server on this machine]
    #[arg(
        long = "owner-token",
        value_name = "@FILE|-|TOKEN",
        env = "MON3TR_OWNER_TOKEN",
        hide_env_values = true
    )]
    owner_token: Option<SecretArgument>,
}

impl OwnerToken {
    /// The token that was given, if one was.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn given(&self) -> anyhow::Result<Option<String>> {
        let given = self.owner_token.as_ref();
        given.map(|given| given.read("owner's token")).transpose()
    }

    /// The token for `server`.
    ///
    /// # Errors
    /// If it was not given, and the server is not on this machine; if its file cannot be read, or other users can read
    /// it.
    pub fn of(&self, server: &ServerUrl) -> anyhow::Result<String> {
        if let Some(token) = self.given()? {
            return Ok(token);
        }
        if !server.is_here() {
            bail!(
                "no owner's token: copy the file that `mon3tr serve` named where it runs, and give --owner-token @FILE"
            );
        }
        let file = server_folder(None)?.join(OWNER_TOKEN);
        if !file.exists() {
            bail!(
                "no owner's token: there is no {}: start `mon3tr serve` on this machine first, or give --owner-token @FILE with the file that `mon3tr serve` named, elsewhere with --data",
                file.display()
            );
        }
        secret_argument::from_file(&file)
    }
}
