//! The native half of a package for Quest: the receiver's library, built for the headset, and others' libraries beside it.
//!
//! [`native`] builds with Google's NDK, or without one; [`parts`] knows what `./run` has fetched; [`elf`] says whether Android will
//! load it all, and [`std_stubs`] whether ours calls what Android has in name alone. The package itself is the crate `apk`'s.

pub mod elf;
pub mod native;
pub mod parts;
pub mod std_stubs;
