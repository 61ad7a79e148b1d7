//! The command as its users meet it.

mod cli;
mod demo_person;
mod placements;
mod profile;
mod qnn;
mod scenes;
mod support;
