use std::path::PathBuf;

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
