//! Where the app keeps files, and how many packages.

mod folders;
#[cfg(test)]
mod tests;

pub use folders::Folders;
