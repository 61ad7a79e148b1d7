//! A headset, through `OpenXR`.

mod error;
pub mod ext;
mod extensions;
#[cfg(test)]
pub(crate) mod fake;
mod input;
mod pose;

pub use error::XrError;
pub use extensions::Extensions;
pub use input::{Controls, Hand, Input};
