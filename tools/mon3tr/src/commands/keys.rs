//! `mon3tr keys`: one's own key, who may drive one's avatars, and whose packages may bring compiled code.

use crate::keys;
use anyhow::{Context, bail};
use identity::{Permit, PublicKey};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

const DAY: u64 = 86_400;

/// Options of `keys`.
#[derive(Debug, clap::Args)]
pub struct Options {
    #[command(subcommand)]
    what: Option<What>,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Let another key drive your avatars: prints a permit, for its owner to accept
    Allow {
        /// The key, as `mon3tr keys` prints it there
        key: PublicKey,
        /// For how long
        #[arg(long, default_value = "365", value_parser = clap::value_parser!(u64).range(1..=3650))]
        days: u64,
    },
    /// Keep a permit, as `allow` prints it
    Accept {
        /// OWNER KEY UNTIL SIGNATURE
        #[arg(required = true, num_args = 1..=4)]
        permit: Vec<String>,
    },
    /// Trust a key to bring graphs compiled for your NPU in the packages that it signs: they are code that cannot be checked. Everyone else's graphs are
    /// compiled here
    Trust {
        /// The key, as `mon3tr keys` prints it there
        key: PublicKey,
        /// Trust it no longer
        #[arg(long)]
        remove: bool,
    },
    /// Sign an avatar's package as yours: others then let nobody else drive it
    Sign {
        /// The package, which is written anew
        package: PathBuf,
    },
}

/// Runs `keys`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    let keyring = keys::open()?;
    let own = keyring.identity().public();
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .context("this machine's clock is before 1970")?
        .as_secs();
    match &options.what {
        None => {
            println!(
                "your key          {own}\nits fingerprint   {}\nkept in           {}",
                own.fingerprint(),
                keyring.file().display()
            );
            for permit in keyring.permits()? {
                let left = match permit.check(now) {
                    Ok(()) => format!("for {} days", (permit.until() - now).div_ceil(DAY)),
                    Err(why) => format!("but {why}"),
                };
                println!(
                    "may drive what is signed by {} {left}",
                    permit.owner().fingerprint()
                );
            }
            for key in keyring.trusted()? {
                println!("trusts            {key}, by whom graphs may be compiled");
            }
        }
        Some(What::Allow { key, days }) => {
            let permit = Permit::new(keyring.identity(), *key, now + days * DAY);
            println!(
                "for {days} days {} may drive your avatars, once it has run\n  mon3tr keys accept {permit}",
                key.fingerprint()
            );
        }
        Some(What::Accept { permit }) => {
            let permit: Permit = permit.join(" ").parse()?;
            if permit.key() != own {
                bail!(
                    "the permit is for the key {}, and this machine's is {}",
                    permit.key().fingerprint(),
                    own.fingerprint()
                );
            }
            permit.check(now)?;
            keyring.accept(&permit)?;
            println!(
                "this machine may drive the avatars of {}",
                permit.owner().fingerprint()
            );
        }
        Some(What::Trust { key, remove: false }) => {
            keyring.trust(*key)?;
            println!(
                "graphs that {} compiled for your NPU are used from now on",
                key.fingerprint()
            );
        }
        Some(What::Trust { key, remove: true }) => {
            if !keyring.distrust(*key)? {
                bail!("{} was not trusted", key.fingerprint());
            }
            println!(
                "graphs that {} compiled are not used any more",
                key.fingerprint()
            );
        }
        Some(What::Sign { package }) => {
            keys::sign(package)?;
            println!("{} is signed by {}", package.display(), own.fingerprint());
        }
    }
    Ok(())
}
