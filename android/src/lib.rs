//! The receiver as an app for Meta Quest: Android's interface (an intent, a life-cycle, folders, a log), turned into what the
//! receiver understands. All but the few files that call Android itself builds and is tested on any machine.
//!
//! | what | where |
//! |---|---|
//! | server, room and choices, from the intent, a link or `mon3tr.toml` | [`settings`] |
//! | Android's life-cycle, as commands for the call | [`lifecycle`] |
//! | folders, and packages kept in them | [`storage`] |
//! | logcat, and panics in it | [`logcat`] |
//! | the panel while a setting is missing | [`first_run`] |
//! | which activity stays, where a link is opened while the app runs | [`succession`] |
//! | the call itself, behind [`lifecycle::Receiver`] | [`receiver`] |

#[cfg(target_os = "android")]
mod activity;
pub mod first_run;
#[cfg(target_os = "android")]
mod java;
pub mod launch;
pub mod lifecycle;
pub mod logcat;
pub mod package;
pub mod receiver;
pub mod settings;
pub mod storage;
pub mod succession;
