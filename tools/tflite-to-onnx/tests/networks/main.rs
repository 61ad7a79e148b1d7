//! Real networks: what they compute once converted, and what becomes of damaged ones.

mod files;
mod hostile;
mod litert;
