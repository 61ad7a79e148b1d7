//! The body: the avatar's skeleton fitted to landmarks.

pub mod chain;
mod limits;
pub mod prior;
mod prior_table;
pub mod so3;
pub mod solver;
pub mod terms;
