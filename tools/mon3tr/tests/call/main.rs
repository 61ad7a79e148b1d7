//! Calls between real processes on this machine: a server, senders and receivers, through the network lab.
//!
//! Nothing here is timed: what is asserted is what comes, in what order, and what is said; waits end when something has happened.

mod attacks;
mod audience;
mod both_ways;
mod burden;
#[path = "../command/support.rs"]
#[allow(dead_code, reason = "shared with the tests of the other sub-commands")]
mod command;
mod demo;
mod door;
mod echo;
mod handover;
mod headset;
mod house;
mod identity;
mod interop;
mod lips;
mod member;
mod nat;
mod network;
mod outage;
mod people;
mod place;
mod restart;
mod room;
mod several;
mod voice;

const PROGRAM: &str = env!("CARGO_BIN_EXE_mon3tr");
