//! Where the app keeps files, and how many packages.

mod folders;
mod servers;
#[cfg(test)]
mod tests;

pub use folders::Folders;
pub use servers::KnownServers;
