//! Settings: which room or call to join and how, read from the launch intent's extras, from a `mon3tr://...` link and from
//! `mon3tr.toml`. The first of these that gives a value wins, value by value; but a token is only sent to a server that its own
//! source, or a weaker one, named. Every source is untrusted text: it is checked here, once, and the results are valid.

mod deep_link;
mod given;
mod key;
mod plain;
mod problem;
mod resolve;
mod room;
#[cfg(test)]
mod tests;
mod values;

pub use deep_link::{DEEP_CALL_LINK, DEEP_LINK, Destination, deep_link, read_deep_link};
pub use given::Given;
pub(crate) use given::LONGEST_FILE;
pub use key::{Key, Origin};
pub use problem::Problem;
pub use resolve::{Settings, Sources, Task};
pub use values::{AvatarFile, CertificateFile, DisplayRate, Sourced};
