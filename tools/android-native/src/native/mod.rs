//! Builds the library that the headset loads from its sources.

mod build;
mod error;
mod processor;
mod route;
mod toolchain;
mod without_ndk;

pub use build::{Built, Order, Purpose, build};
pub use error::NativeError;
pub use processor::Processor;
pub use route::{API_LEVEL, CLANG, Route};
