//! The command as its users meet it.

mod cli;
mod demo_person;
mod floor;
mod placements;
mod profile;
mod qnn;
mod scenes;
mod support;

const PROGRAM: &str = env!("CARGO_BIN_EXE_mon3tr");
