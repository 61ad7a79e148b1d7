//! From sources to the library that the headset loads.

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
