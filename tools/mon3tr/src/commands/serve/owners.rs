//! Tokens of those who open rooms: made for a time, renewed before it is over, and taken back one by one.

use crate::owner_token::OWNER_TOKEN;
use crate::secret_argument::SecretArgument;
use anyhow::Context;
use server::{Id, Secret, now};
use std::convert::Infallible;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// Owner of the rooms and packages of the server's operator.
const HOST: &str = "host";

/// How long the operator's own token holds ...
const HOLDS: Duration = Duration::from_secs(90 * 86_400);

/// ... and when another one takes its place in the file: the one before holds on for so long.
const RENEWED_BEFORE: Duration = Duration::from_secs(60 * 86_400);

/// Between two looks whether it is time for that.
const LOOK: Duration = Duration::from_secs(3_600);

/// What `serve` does with tokens before it serves, if anything.
#[derive(Debug, clap::Args)]
pub(super) struct TokenOptions {
    /// Print a token for another owner of rooms and packages, and end
    #[arg(long, value_name = "NAME")]
    new_owner: Option<String>,
    /// How many days that token holds
    #[arg(long, value_name = "DAYS", default_value = "90", requires = "new_owner", value_parser = clap::value_parser!(u64).range(1..=3650))]
    days: u64,
    /// Take back a token of any kind, an owner's or one at the end of a link, or one by its name, and end; a server
    /// that runs knows it within two seconds. @FILE reads the token from a file, - from standard input
    #[arg(long, value_name = "@FILE|-|TOKEN", conflicts_with = "new_owner")]
    revoke: Option<SecretArgument>,
}

impl TokenOptions {
    /// Whether tokens of a server that has started before are asked for.
    pub(super) fn are_asked_for(&self) -> bool {
        self.new_owner.is_some() || self.revoke.is_some()
    }

    /// Does what was asked for; whether anything was.
    pub(super) fn run(&self, owners: &Owners) -> anyhow::Result<bool> {
        if let Some(name) = &self.new_owner {
            let holds = Duration::from_secs(self.days.saturating_mul(86_400));
            let (token, id) = owners.make(name, holds)?;
            println!("{token}");
            eprintln!(
                "it holds for {} days; its name is {id}: `serve --revoke {id}`, with the same --data, takes it back before",
                self.days
            );
            return Ok(true);
        }
        let Some(token) = &self.revoke else {
            return Ok(false);
        };
        let (id, is_known) = owners.name_of(&token.read("token")?)?;
        server::revoke(&owners.revoked_file(), id)?;
        if is_known {
            println!("the token called {id} holds no longer");
        } else {
            println!(
                "a token of the name {id} holds no longer; whether there is one, the server cannot tell by the name"
            );
        }
        Ok(true)
    }
}

/// The owners' tokens of the server with this folder.
#[derive(Debug)]
pub(super) struct Owners {
    folder: PathBuf,
    secret: Secret,
}

impl Owners {
    pub(super) fn new(folder: PathBuf, secret: Secret) -> Self {
        Self { folder, secret }
    }

    /// Where the operator's own token is.
    pub(super) fn token_file(&self) -> PathBuf {
        self.folder.join(OWNER_TOKEN)
    }

    /// Where the names of tokens are that were taken back.
    pub(super) fn revoked_file(&self) -> PathBuf {
        self.folder.join("revoked")
    }

    /// A new token and its name.
    fn make(&self, name: &str, holds: Duration) -> anyhow::Result<(String, Id)> {
        let expires = now().saturating_add(holds.as_secs());
        let token = self.secret.owner_token(name, expires)?;
        let (id, _) = (self.secret.look_at_token(&token)).context("a token that is not genuine")?;
        Ok((token, id))
    }

    /// The name of a token, given by itself or by its name; and whether the token itself was given and is genuine.
    fn name_of(&self, given: &str) -> anyhow::Result<(Id, bool)> {
        let given = given.trim();
        Id::parse(given)
            .map(|id| (id, false))
            .or_else(|| Some((self.secret.look_at_token(given)?.0, true)))
            .context("that is neither a token of this server nor the name of one (32 hexadecimal digits): of a link, give what follows the #, up to the first colon; with another --data folder than the usual one, give that, too")
    }

    /// Whether the token in the file holds for long enough.
    fn is_fresh(&self) -> bool {
        let kept = std::fs::read_to_string(self.token_file()).ok();
        // One that the secret before has signed is replaced.
        let kept = kept.filter(|token| self.secret.has_signed(token.trim()));
        let kept = kept.and_then(|token| self.secret.look_at_token(token.trim()));
        let Some((id, expires)) = kept else {
            return false;
        };
        let revoked = std::fs::read_to_string(self.revoked_file()).unwrap_or_default();
        let is_revoked = revoked.lines().any(|line| line.trim() == id.to_string());
        !is_revoked && expires > now().saturating_add(RENEWED_BEFORE.as_secs())
    }

    /// Puts a new token of the operator's into the file, unless the one that is there holds for long enough. The one before holds until it expires.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn renew(&self) -> anyhow::Result<()> {
        if self.is_fresh() {
            return Ok(());
        }
        let (token, _) = self.make(HOST, HOLDS)?;
        let path = self.token_file();
        let written = || {
            // Temporary files are their owner's alone.
            let mut file = tempfile::NamedTempFile::new_in(&self.folder)?;
            file.write_all(token.as_bytes())?;
            file.persist(&path)?;
            Ok::<_, std::io::Error>(())
        };
        written().with_context(|| format!("cannot write {}", path.display()))
    }

    /// Does so for as long as the server runs.
    pub(super) async fn keep_renewed(&self) -> Infallible {
        loop {
            tokio::time::sleep(LOOK).await;
            if let Err(why) = self.renew() {
                log::error!("the owner's token is not renewed: {why:#}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_operators_token_stays_while_it_holds_and_is_replaced_once_it_is_taken_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let secret = Secret::random().expect("random numbers");
        let owners = Owners::new(folder.path().to_owned(), secret.clone());
        let kept = || std::fs::read_to_string(owners.token_file()).expect("a token");
        owners.renew().expect("made");
        let first = kept();
        let (_, expires) = secret.look_at_token(&first).expect("genuine");
        assert!(expires.abs_diff(now() + 90 * 86_400) < 60, "{expires}");
        owners.renew().expect("looked at");
        assert_eq!(kept(), first, "it holds for long");
        let soon = secret.owner_token(HOST, now() + 59 * 86_400);
        std::fs::write(owners.token_file(), soon.expect("a token")).expect("written");
        owners.renew().expect("renewed");
        let second = kept();
        let (id, expires) = secret.look_at_token(&second).expect("genuine");
        assert!(expires > now() + 89 * 86_400);
        let revoke = TokenOptions {
            new_owner: None,
            days: 90,
            revoke: second.parse().ok(),
        };
        assert!(revoke.run(&owners).expect("revoked"));
        owners.renew().expect("renewed");
        let (other, _) = secret.look_at_token(&kept()).expect("genuine");
        assert_ne!(other, id, "another one");
        let nonsense = TokenOptions {
            revoke: "nonsense".parse().ok(),
            ..revoke
        };
        assert!(nonsense.run(&owners).is_err());
    }
}
