//! Signatures: APK Signature Scheme v2 and v3, over the whole file (<https://source.android.com/docs/security/features/apksigning>).

mod block;
mod digest;
mod key_store;
mod sign;
mod signer;

pub(crate) use sign::sign;
pub use signer::Signer;
