//! The command as its users meet it.

mod cli;
mod demo_person;
mod scenes;
mod support;
