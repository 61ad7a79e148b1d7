//! From sources to the library that the headset loads.

mod build;
mod error;
mod route;
mod toolchain;
mod without_ndk;

pub use build::{Built, Order, build};
pub use error::NativeError;
pub use route::{API_LEVEL, CLANG, Route};
