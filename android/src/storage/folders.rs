//! The app's two folders: one that no other app can read, one that adb can.

use super::KnownServers;
use crate::package::SETTINGS_FILE;
use app_pipeline::compiled_sources::CompiledSources;
use identity::{IdentityError, Keyring};
use link_http::{HttpError, PackageCache};
use std::path::{Path, PathBuf};

/// Folders of the app.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folders {
    own: PathBuf,
    shared: PathBuf,
}

impl Folders {
    /// With what Android calls the internal and the external files folder.
    #[must_use]
    pub fn new(own: impl Into<PathBuf>, shared: impl Into<PathBuf>) -> Self {
        Self {
            own: own.into(),
            shared: shared.into(),
        }
    }

    /// `mon3tr.toml`, where adb can push it.
    #[must_use]
    pub fn settings_file(&self) -> PathBuf {
        self.shared.join(SETTINGS_FILE)
    }

    /// Where a profile is written, so that adb can pull it.
    #[must_use]
    pub fn profile(&self) -> PathBuf {
        self.shared.join("profile")
    }

    /// The avatar that a profile shows, where adb can push it.
    #[must_use]
    pub fn demo_avatar(&self) -> PathBuf {
        self.shared.join("avatar.m3a")
    }

    /// The wearer's own avatar of that name, where adb can push it.
    #[must_use]
    pub fn avatar(&self, name: &str) -> PathBuf {
        self.shared.join(name)
    }

    /// A file of certificates of that name, where adb can push it.
    #[must_use]
    pub fn certificates(&self, name: &str) -> PathBuf {
        self.shared.join(name)
    }

    /// One's own key, and the permits of others' avatars and the keys that the wearer trusts, which adb can push and other apps cannot.
    ///
    /// # Errors
    /// If the key cannot be read or made.
    pub fn keys(&self) -> Result<Keyring, IdentityError> {
        let [permits, trusted] = ["permits", "trusted"].map(|name| self.shared.join(name));
        Keyring::open(self.own.join("key"), permits, trusted)
    }

    /// The file of the people whom the wearer has met.
    #[must_use]
    pub fn people_met(&self) -> PathBuf {
        self.own.join("met")
    }

    /// Whether the wearer was asked before what they allow ([`Self::note_leave_asked_for`]).
    #[must_use]
    pub fn was_leave_asked_for(&self) -> bool {
        self.leave_asked_for().exists()
    }

    /// From now on they were.
    pub fn note_leave_asked_for(&self) {
        if let Err(error) = std::fs::write(self.leave_asked_for(), "") {
            log::debug!("that the wearer was asked is not kept: {error}");
        }
    }

    fn leave_asked_for(&self) -> PathBuf {
        self.own.join("leave-asked-for")
    }

    /// The servers that the wearer has agreed to go to.
    #[must_use]
    pub fn servers(&self) -> KnownServers {
        KnownServers::new(self.own.join("servers"))
    }

    /// From where networks compiled for the NPU are taken: compiled here and kept where no other app can write, or in packages signed by the headset's
    /// own key or one that the wearer trusts.
    #[must_use]
    pub fn compiled(&self) -> CompiledSources {
        let trusted = self.keys().and_then(|keys| {
            let own = keys.identity().public();
            Ok([vec![own], keys.trusted()?].concat())
        });
        CompiledSources {
            cache: Some(self.own.join("compiled")),
            trusted: trusted.unwrap_or_else(|error| {
                let error = anyhow::Error::from(error)
                    .context("the headset's key, or the file `trusted` beside the avatar");
                log::warn!("no package's compiled networks are used: {error:#}");
                Vec::new()
            }),
        }
    }

    /// The folder whose contents no other app can read.
    #[must_use]
    pub fn own(&self) -> &Path {
        &self.own
    }

    /// The packages, at most so many bytes of them. The least recently used packages over that limit are removed now,
    /// and so are interrupted downloads that were not resumed.
    ///
    /// # Errors
    /// [`HttpError::Cache`] if the folder cannot be made.
    pub fn packages(&self, most_bytes: u64) -> Result<PackageCache, HttpError> {
        let cache = PackageCache::new(self.own.join("packages"))?.with_limit(most_bytes);
        cache.tidy();
        Ok(cache)
    }
}
