//! The avatar package, `.m3a`: one plain zip that common tools open, with a manifest, safetensors and an ONNX graph.
//!
//! Written deterministically; read as an untrusted file. Every size, hash, type, shape, index and number is checked
//! against the manifest and the limits here before anything uses it. It does not fetch packages and runs no network.
//!
//! The manifest's `expression_basis` names what the 50 expression slots mean ([`crate::ExpressionBasis`]; [`Manifest::basis`] says what a
//! package without it has). `expressions` holds named expressions in that basis, each 50 coefficients and an opening of the jaw: a
//! camera's face and the built-in motion are made of these, so a package shows what it names ([`crate::Expressions`]).
//!
//! A package may be signed by its owner's key ([`Avatar::save_signed`]): who it is then says [`Avatar::signer`], and a package whose signature does
//! not fit is refused.

mod archive;
mod avatar;
mod compiled;
mod error;
mod graph;
mod limits;
mod manifest;
mod members;
mod signed;
mod tensors;
mod write;

pub use archive::{MAX_BYTES, MAX_MEMBERS};
pub use avatar::Avatar;
pub use compiled::{MAX_COMPILED, MAX_COMPILED_BYTES};
pub use error::PackageError;
pub use limits::PackageLimits;
pub use manifest::{
    CompiledEntry, Counts, ExpressionEntry, FORMAT, MAX_CONTROLLERS, MAX_FACES, MAX_GAUSSIANS,
    MAX_VERTICES, Manifest, MemberEntry, TensorEntry, VERSION,
};
