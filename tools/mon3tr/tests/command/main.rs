//! The command as its users meet it.

mod budget;
mod camera;
mod cli;
mod demo_person;
mod floor;
#[path = "../call/house.rs"]
#[allow(dead_code, reason = "shared with the tests of calls")]
mod house;
mod placements;
mod profile;
mod qnn;
mod scenes;
mod support;

use support as command;

const PROGRAM: &str = env!("CARGO_BIN_EXE_mon3tr");
