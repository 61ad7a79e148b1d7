//! The native half of a package for Quest: the receiver's library, built for the headset, and others' libraries beside it.
//!
//! [`native`] builds with Google's NDK, or without one; [`parts`] knows what `./run` has fetched; [`elf`] says whether Android will
//! load it all, and [`std_stubs`] whether ours calls functions that are only stubs on Android. The package itself is made by `mon3tr apk`.

#![forbid(unsafe_code)]

pub mod elf;
pub mod native;
pub mod parts;
pub mod std_stubs;
