//! What can keep a package from being written.

use std::io;
use std::path::{Path, PathBuf};

/// Why no package was written. Nothing is left at the place where it was to be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ApkError {
    /// A manifest or an XML resource says something that cannot be packaged.
    #[error("{file}:{line}: {why}")]
    Xml {
        /// The file, as the user knows it.
        file: String,
        /// The line in it, from 1.
        line: u32,
        /// What is wrong, and what to do.
        why: String,
    },
    /// The resource folder holds something that cannot be packaged.
    #[error("resource {}: {why}", path.display())]
    Resource {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong, and what to do.
        why: String,
    },
    /// A library or an asset cannot be a member of the package.
    #[error("{name} cannot be packaged: {why}")]
    Member {
        /// The member's name in the package.
        name: String,
        /// What is wrong, and what to do.
        why: String,
    },
    /// A key, a certificate or a key store cannot be used.
    #[error("{}: {why}", path.display())]
    Key {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        why: String,
    },
    /// The key did not sign.
    #[error("the package could not be signed")]
    Sign(#[source] rcgen::Error),
    /// A file could not be read or written.
    #[error("{what} {}", path.display())]
    Io {
        /// What was being done.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// Why not.
        #[source]
        source: io::Error,
    },
    /// The zip could not be written.
    #[error("could not write {name} into the package")]
    Zip {
        /// The member's name in the package.
        name: String,
        /// Why not.
        #[source]
        source: zip::result::ZipError,
    },
}

impl ApkError {
    pub(crate) fn io(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io {
            what,
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn key(path: &Path, why: impl Into<String>) -> Self {
        Self::Key {
            path: path.to_owned(),
            why: why.into(),
        }
    }

    pub(crate) fn resource(path: &Path, why: impl Into<String>) -> Self {
        Self::Resource {
            path: path.to_owned(),
            why: why.into(),
        }
    }
}
