//! What can be wrong with an avatar package.

use crate::networks::GraphRefused;
use crate::{CostError, PersonError};
use std::path::PathBuf;

/// The member that holds the deform graph.
pub(super) const GRAPH: &str = "deform.onnx";

/// A package that cannot be written, or that must not be used. The text does not repeat the package's path: the caller
/// names it in its own error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackageError {
    /// There is no file at the path.
    #[error("there is no such file; `mon3tr bake --out FILE` makes one")]
    Missing,
    /// The path leads to a folder.
    #[error(
        "this is a folder; an avatar package is one file, as `mon3tr bake --out FILE` makes it"
    )]
    Folder,
    /// The file system refused.
    #[error("cannot {action} the file")]
    File {
        /// "open", "write" or "replace".
        action: &'static str,
        /// The package's path.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The bytes are no avatar package, or its archive is damaged.
    #[error(
        "this is no intact avatar package ({reason}); fetch it again, or rebuild it with `mon3tr bake`"
    )]
    Archive {
        /// What is wrong with the archive.
        reason: String,
    },
    /// The package was written by a newer program.
    #[error(
        "the package has format version {found}, but this program reads only up to {newest}: update mon3tr, or rebuild \
         the avatar with `mon3tr bake`"
    )]
    Newer {
        /// The package's format version.
        found: u32,
        /// The newest version this program reads.
        newest: u32,
    },
    /// A member is missing, damaged, or not what the manifest says.
    #[error("package member {member}: {reason}")]
    Member {
        /// The member's name.
        member: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The package is larger than one of its kind may be.
    #[error(
        "the avatar has {has} {what}, and that of another person may have {limit}, so that it does not fill this device: its owner can build a smaller one"
    )]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How much it has.
        has: u64,
        /// How much it may have.
        limit: u64,
    },
    /// Nobody who looks at the person could draw them in time.
    #[error(transparent)]
    Cost(CostError),
    /// A member's numbers contradict each other.
    #[error("package member {member} contradicts itself")]
    Contents {
        /// The member's name.
        member: String,
        /// The contradiction.
        #[source]
        source: PersonError,
    },
}

impl PackageError {
    pub(super) fn member(member: &str, reason: impl Into<String>) -> Self {
        Self::Member {
            member: member.to_owned(),
            reason: printable(reason),
        }
    }

    /// The deform graph is not in our form.
    pub(crate) fn graph(refused: GraphRefused) -> Self {
        Self::member(GRAPH, refused.to_string())
    }

    /// The deform graph's numbers do not fit each other.
    pub(crate) fn graph_contents(source: PersonError) -> Self {
        Self::contents(GRAPH)(source)
    }

    pub(super) fn archive(reason: impl Into<String>) -> Self {
        Self::Archive {
            reason: printable(reason),
        }
    }

    pub(super) fn contents(member: &str) -> impl FnOnce(PersonError) -> Self + '_ {
        move |source| Self::Contents {
            member: member.to_owned(),
            source,
        }
    }
}

/// A reason that may quote the file, without control characters for the terminal that prints it.
fn printable(reason: impl Into<String>) -> String {
    let reason = reason.into();
    if reason.chars().any(is_unprintable) {
        reason.replace(is_unprintable, "?")
    } else {
        reason
    }
}

/// Control characters, and those that reorder the text around them.
pub(super) fn is_unprintable(c: char) -> bool {
    let reorders =
        matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || reorders || matches!(c, '\u{2028}' | '\u{2029}')
}
