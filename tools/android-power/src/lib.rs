//! How warm Android says the device is ([`thermal`]), and what its scheduler is told of pictures ([`hints`]).
//!
//! Both are functions of Android's `libandroid.so` that came after the oldest system that the app runs on (API 29), so they are looked up when
//! the app runs: `shape` has their types, `native` is the one place that looks them up and calls them. Where there are none, on an older
//! Android or another system, there is nothing to do, and a line of the log at level debug says so once.

pub mod hints;
mod native;
mod shape;
pub mod thermal;
pub mod threads;

#[cfg(test)]
mod fake;

pub use native::System;
