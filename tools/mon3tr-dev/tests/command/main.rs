//! The command as developers and operators meet it.

mod apart;
mod avatar;
mod bench;
mod canary;
mod cli;
#[path = "../../../mon3tr/tests/command/floor.rs"]
mod floor;
mod server;
mod soak;
#[path = "../../../mon3tr/tests/command/support.rs"]
#[allow(dead_code, reason = "shared with the tests of mon3tr")]
mod support;
mod units;

const PROGRAM: &str = env!("CARGO_BIN_EXE_mon3tr-dev");
