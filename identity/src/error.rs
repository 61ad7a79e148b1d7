use std::path::{Path, PathBuf};

/// Why a key, a signature or a permit is not taken.
#[derive(Debug, thiserror::Error)]
pub enum IdentityError {
    /// A file of one's own key, of permits or of trusted keys cannot be read or written.
    #[error("cannot {action} {}", path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: std::io::Error,
    },
    /// Other users of the machine may read or write a file that is its owner's alone.
    #[error(
        "{} is not used while other users of this machine may read or write it: run `chmod 600 {}`",
        path.display(),
        quoted(path)
    )]
    NotPrivate {
        /// The file.
        path: PathBuf,
    },
    /// The file holds no key.
    #[error(
        "{} holds no key of mon3tr's: move it away, and a new key is made (others will then not know you)",
        path.display()
    )]
    NoKey {
        /// The file.
        path: PathBuf,
    },
    /// The system gives no random numbers.
    #[error("no random numbers for a key")]
    Random(#[from] getrandom::Error),
    /// A text is not what it should be.
    #[error("not {0}")]
    Malformed(&'static str),
    /// A signature is not by the key that it is shown with, or not of this text.
    #[error("the signature does not belong to what it is shown with")]
    WrongSignature,
    /// A permit is over.
    #[error("the permit of its owner has expired")]
    Expired,
}

/// A path as a shell takes it.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}
