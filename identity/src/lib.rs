//! Who someone is: an Ed25519 key (RFC 8032), made once; what it signs; which other keys its owner lets drive their avatars; and
//! which they trust to bring compiled code.
//!
//! Whoever shows a signature shows the key with it, so everything here is checked without asking anyone. Which key is the right one a
//! viewer knows from a link ([`KeyHash`]), or from having met it before. What is signed is text whose first line says what it is
//! ([`Purpose`]), so a signature for one purpose is none for another. The crate opens no connection.
//!
//! ```
//! use identity::{Identity, Purpose};
//!
//! let ada = Identity::generate()?;
//! let signature = ada.sign(Purpose::Package, b"what is signed");
//! assert!(ada.public().verify(Purpose::Package, b"what is signed", &signature).is_ok());
//! assert!(ada.public().verify(Purpose::Sender, b"what is signed", &signature).is_err());
//! println!("{}", ada.public().fingerprint());
//! # Ok::<(), identity::IdentityError>(())
//! ```

#![forbid(unsafe_code)]

mod error;
mod key;
mod keyring;
mod line_file;
mod permit;
mod private;
mod secret;
mod signature;

pub use error::IdentityError;
pub use key::{KeyHash, PublicKey};
pub use keyring::Keyring;
pub use line_file::LineFile;
pub use permit::Permit;
pub use private::open_private;
pub use secret::Identity;
pub use signature::{Purpose, Signature};
