//! The `mon3tr` command.
fn main() {}
