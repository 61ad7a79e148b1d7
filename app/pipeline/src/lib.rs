//! The receiver: an avatar and motion parameters in, pictures and per-stage times out.
//!
//! A call's frames go through [`lanes::Lanes`], a thread for each unit; stills go the same way step by step through a
//! [`receiver::Receiver`]. Which unit does what is decided in [`placement`], what each step took is told to a
//! [`profile::Collector`].

pub mod concealment;
pub mod control;
pub mod deform;
pub mod error;
pub mod inference;
pub mod lanes;
pub mod placement;
pub mod plan;
pub mod pool;
pub mod posing;
pub mod profile;
pub mod quality;
pub mod receiver;
pub mod stage;
pub mod timeline;
